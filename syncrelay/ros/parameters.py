"""The parameters of the relay's node, for `ros2 param get`; only the relay itself changes them."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.parameter import Parameter

from syncrelay.config.file import relay_form
from syncrelay.config.wording import all_of, quoted
from syncrelay.printable import printable

_GROUPS: Final = "groups"


class Parameters:
    """Declares `config`, `version` and `groups`. On the main thread."""

    def __init__(self, node: Any, *, paths: Sequence[str], version: str) -> None:
        self._node = node
        self._groups: list[str] | None = None
        for name, value, description in (
            ("config", [printable(path) for path in paths] or [""], "The files that the relay runs."),
            ("version", version, "The version of syncrelay."),
        ):
            _declare(node, name, value, ParameterDescriptor(description=description, read_only=True))
        # rclpy lets not even the node itself change a read-only parameter, so `_judged` refuses the changes of others.
        # The type is given because rclpy would infer another one from an empty list.
        constraints = "Set by the relay alone, at the start and at each reload."
        descriptor = ParameterDescriptor(description="The groups that run.", additional_constraints=constraints)
        _declare(node, _GROUPS, Parameter.Type.STRING_ARRAY, descriptor)
        node.add_on_set_parameters_callback(self._judged)

    def name_groups(self, groups: Sequence[str]) -> None:
        """Set `groups`, which are running now."""
        if list(groups) != self._groups:
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
    # Values from --ros-args or a parameter file would be wrong, so they are ignored.
    node.declare_parameter(name, value, descriptor, ignore_override=True)


def misplaced(names: Iterable[str]) -> str | None:
    """Say where parameters belong that --ros-args or a parameter file sets, and only the relay's file can; or None.

    Parameters of other nodes, which a file may set for all nodes, are passed over.
    """
    by_place: dict[str, list[str]] = {}
    for name in names:
        place = _place(name)
        if place is not None:
            by_place.setdefault(place, []).append(quoted(name))
    if not by_place:
        return None
    places = [f"{all_of(those)} belong{'s' if len(those) == 1 else ''} {place}" for place, those in by_place.items()]
    return f"these are not set by ROS parameters: {'; '.join(places)}"


def _place(name: str) -> str | None:
    first, *below = name.split(".")
    levels = list(relay_form().levels.items())
    if name == "config":
        return "behind `--config`"
    if first == "qos_overrides":
        return "in the file, as the `qos` of a topic"
    if below and first not in levels[0][1].model_fields:
        return None
    key = below[-1] if below else first
    level = next((level for level, model in levels if key in model.model_fields), None)
    return level and ("in the file" if level == levels[0][0] else f"in the file, in {level}")
