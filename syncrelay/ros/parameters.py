"""What the relay's node tells of itself as parameters: for `ros2 param get`, and read-only for all but itself."""

from collections.abc import Sequence
from typing import Any, Final

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.parameter import Parameter

from syncrelay.printable import printable

_GROUPS: Final = "groups"


class Parameters:
    """Declares `config`, `version` and `groups`. On the main thread."""

    def __init__(self, node: Any, *, paths: Sequence[str], version: str) -> None:
        self._node = node
        # None until the parameter is declared: a managed node may have no groups for a while.
        self._groups: list[str] | None = None
        for name, value, description in (
            ("config", [printable(path) for path in paths] or [""], "The files that the relay runs."),
            ("version", version, "The version of syncrelay."),
        ):
            _declare(node, name, value, ParameterDescriptor(description=description, read_only=True))
        node.add_on_set_parameters_callback(self._judged)

    def name_groups(self, groups: Sequence[str]) -> None:
        """Tell that these groups run now."""
        if self._groups is None:
            # rclpy lets nobody change what is read-only, the node itself neither: others are refused below.
            constraints = "Set by the relay alone, at the start and at each reload."
            descriptor = ParameterDescriptor(description="The groups that run.", additional_constraints=constraints)
            self._groups = list(groups)
            _declare(self._node, _GROUPS, self._groups, descriptor)
        elif list(groups) != self._groups:
            self._groups = list(groups)
            self._node.set_parameters([Parameter(_GROUPS, Parameter.Type.STRING_ARRAY, self._groups)])

    def _judged(self, parameters: Sequence[Any]) -> Any:
        """Refuse another value than the true one, whoever sets it."""
        for parameter in parameters:
            if parameter.name == _GROUPS and list(parameter.value or []) != self._groups:
                reason = "`groups` is what the relay runs: change its file, then call ~/reload"
                return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)


def _declare(node: Any, name: str, value: Any, descriptor: Any) -> None:
    # What --ros-args or a parameter file says of them is not so.
    node.declare_parameter(name, value, descriptor, ignore_override=True)
