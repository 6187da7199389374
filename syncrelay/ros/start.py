"""The relay's node: rclpy started as the file and the command line say, and its log on /rosout."""

import logging
import os
import re
from collections.abc import Callable, Sequence
from typing import Any, Final

import rclpy
from rclpy.context import Context
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.signals import SignalHandlerOptions

from syncrelay.config.wording import quoted
from syncrelay.environment.domain import require_domain
from syncrelay.errors import RosUnavailableError, SyncRelayError, UsageError
from syncrelay.printable import one_entry, printable
from syncrelay.ros.environment import keep_stdout, log_arguments
from syncrelay.ros.parameters import misplaced

_LOG = logging.getLogger("syncrelay")

# The place in rcl's sources where it failed, which is of no use to the user.
_PLACE_IN_RCL: Final = re.compile(r", at [^ ,]+:\d+")
# How rcl's messages about arguments begin.
_OF_ARGUMENTS: Final = re.compile(
    r"(Couldn't parse|Enclave name is not valid|invalid node name|invalid namespace|[^:]*external configuration).*",
    re.DOTALL,
)


def start(ros_args: Sequence[str], *, simulated: bool) -> Context:
    """Start rclpy in a context of its own, signals left alone; `simulated` time is what the file asks for.

    Raises UsageError where ROS rejects the arguments, RosUnavailableError where it does not start.
    """
    # The command line comes after the file and overrides it. Our own log is on stderr already, so rcl must not print it
    # again.
    wish = ["-p", "use_sim_time:=true"] if simulated else []
    ours = ["--ros-args", "--disable-stdout-logs", *log_arguments(), *wish, "--"]
    require_domain(os.environ)
    keep_stdout()
    context = Context()
    try:
        rclpy.init(
            args=[*ours, "--ros-args", *ros_args], context=context, signal_handler_options=SignalHandlerOptions.NO
        )
    except _rclpy.UnknownROSArgsError as error:
        raise _rejected(ros_args, f"{error} is unknown") from error
    except _rclpy.RCLError as error:
        raise _refused(f"rclpy does not start: {error}", ros_args) from error
    return context


def make_node(
    name: str,
    *,
    namespace: str,
    context: Context,
    ros_args: Sequence[str],
    make: Callable[..., Any] = rclpy.create_node,
) -> Any:
    """Make the relay's node, and warn of ROS parameters that have no effect; raises as `start`."""
    try:
        node = make(name, namespace=namespace, context=context)
    except NameValidationException as error:
        what, name, *_ = (line.strip(" '") for line in str(error).splitlines())
        raise _rejected(ros_args, f"{what} {quoted(name)}") from error
    except ParameterException as error:
        raise _rejected(ros_args, str(error)) from error
    except _rclpy.RCLError as error:
        raise _refused(f"no node starts: {error}", ros_args) from error
    overrides = node._parameter_overrides  # noqa: SLF001  rclpy tells them only to who declares them
    warning = misplaced(parameter for parameter in overrides if not node.has_parameter(parameter))
    if warning is not None:
        _LOG.warning("%s", warning)
    return node


def resolver(node: Any, ros_args: Sequence[str]) -> Callable[[str], str]:
    """Return a function from a topic's name to its name in the graph, after all remaps.

    It raises UsageError if remaps turn the name into one that ROS refuses.
    """

    def resolve(name: str) -> str:
        try:
            return str(node.resolve_topic_name(name))
        except _rclpy.RCLError as error:
            raise _rejected(ros_args, f"they give the topic {quoted(name)} a name that ROS rejects: {error}") from error

    return resolve


class RosoutHandler(logging.Handler):
    """Passes records of ROS's five severities to a node's logger: for /rosout and ROS's log file."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name

    def emit(self, record: logging.LogRecord) -> None:
        try:
            text = one_entry(record.getMessage())
            # rclpy's own logger would name this line as the source, and search all modules for it.
            if _rclpy.rclpy_logging_logger_is_enabled_for(self._name, record.levelno):
                _rclpy.rclpy_logging_rcutils_log(
                    record.levelno, self._name, text, record.funcName or "", record.pathname, record.lineno
                )
        except Exception:  # noqa: BLE001  logging never raises, as with every handler
            self.handleError(record)


def _refused(words: str, ros_args: Sequence[str]) -> SyncRelayError:
    of_arguments = _OF_ARGUMENTS.search(words)
    return _rejected(ros_args, of_arguments.group()) if of_arguments else RosUnavailableError(words)


def _rejected(ros_args: Sequence[str], reason: str) -> UsageError:
    words = printable(" ".join(ros_args))
    why = printable(_PLACE_IN_RCL.sub("", reason))
    return UsageError(
        f"ROS rejects --ros-args {words}: {why}\n"
        "  remaps are written -r FROM:=TO, parameters -p NAME:=VALUE, a namespace -r __ns:=/NAMESPACE"
    )
