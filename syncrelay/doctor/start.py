"""A node is started and ended as a check, in a process of its own: rcl and broken message libraries may end that."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, Final

from syncrelay.doctor.diagnosis import Diagnosis, Severity, error, info

_DEADLINE_S: Final = 60.0
_COLOUR: Final = re.compile(r"\x1b\[[0-9;]*m")
_OVERRULED: Final = ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")


class Step(Enum):
    """The steps in their order, but ARGUMENTS: what comes after --ros-args can fail at any of the last three."""

    IMPORT = "import"
    TYPES = "types"
    INIT = "init"
    NODE = "node"
    NAMES = "names"
    ARGUMENTS = "arguments"


_WHAT: Final = {
    Step.IMPORT: "rclpy cannot be imported",
    Step.TYPES: "message types cannot be imported",
    Step.INIT: "ROS does not start",
    Step.NODE: "no node starts here",
    Step.NAMES: "a node starts here, but fails at once",
}


@dataclass(frozen=True, slots=True)
class Plan:
    """What to try: a node of this name, the import of types, and what remaps make of topic names.

    `use_sim_time` is what the file says.
    """

    node: str = "syncrelay"
    namespace: str = ""
    types: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    ros_args: tuple[str, ...] = ()
    use_sim_time: bool = False


@dataclass(frozen=True, slots=True)
class StartResult:
    """How it went. `failed` is the step that failed, None if all went well, and `fault` says why.

    `unusable` has the fault of every type that cannot be imported. `names` are the topics after all remaps. `path` is
    how messages pass, a BackendName; it is empty where the one that the environment asks for cannot be used, and
    `path_fault` then says why. Otherwise `path_fault` is why they do not pass in compiled code, `path_cost` what that
    costs, and `path_advice` what to do about it.
    """

    failed: Step | None = None
    fault: str = ""
    unusable: Mapping[str, str] = field(default_factory=dict)
    node: str = ""
    names: Mapping[str, str] = field(default_factory=dict)
    use_sim_time: bool = False
    middleware: str = ""
    path: str = ""
    path_fault: str = ""
    path_cost: str = ""
    path_advice: str = ""


def start_node(plan: Plan, environ: Mapping[str, str]) -> StartResult:
    """Start a node as planned, end it, and return how that went. It finds nobody and nobody finds it."""
    quiet = {name: value for name, value in environ.items() if name not in _OVERRULED}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "syncrelay.doctor.start_process"],
            input=json.dumps(asdict(plan)),
            env={**quiet, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"},
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_DEADLINE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return StartResult(Step.IMPORT, f"it did not finish within {_DEADLINE_S:.0f} s")
    except OSError as error:
        return StartResult(Step.IMPORT, f"{sys.executable} cannot be started: {error.strerror}")
    return _read(done)


def _read(done: "subprocess.CompletedProcess[str]") -> StartResult:
    """Return what the process said: of each field the last."""
    said: dict[str, Any] = {"step": Step.IMPORT.value}
    # What libraries print on the way is no object.
    for line in done.stdout.splitlines():
        if line.startswith('{"step"'):
            said |= json.loads(line)
    step, last_type = Step(said.pop("step")), said.pop("type", None)
    if done.returncode == 0 and "names" in said:
        return StartResult(**said)
    if "fault" not in said:
        end = _end(done.returncode, done.stderr)
        if step is Step.TYPES and last_type:
            said["unusable"] = {**said["unusable"], last_type: end}
        else:
            said["fault"] = end
    return StartResult(step, **said)


def _end(code: int, stderr: str) -> str:
    """How the process ended that said no more, with its last words."""
    how = f"the process was ended by signal {-code}" if code < 0 else f"the process ended with {code}"
    lines = [_COLOUR.sub("", line).strip() for line in stderr.splitlines()]
    words = next((line for line in reversed(lines) if line), "")
    return f"{how}: {words}" if words else how


def check_start(started: StartResult, *, before: Sequence[Diagnosis]) -> Iterator[Diagnosis]:
    """Yield why a node does not start, unless an error that was found `before` explains it.

    Of one that starts, yield why messages pass at a higher cost, or not at all as the environment asks.
    """
    if started.path_fault and not started.path:
        yield error(
            "receive_path",
            started.path_fault,
            impact="the relay exits at once",
            fix="unset SYNCRELAY_RECEIVE: the relay then takes the better path of those that work here",
        )
    elif started.path_fault:
        yield info(
            "receive_path",
            f"messages pass through {started.path}: {started.path_fault}",
            impact=f"the relay works, but {started.path_cost}",
            fix=started.path_advice,
        )
    if started.failed is Step.ARGUMENTS:
        fault, _, advice = started.fault.partition("\n")
        yield error("ros_args", fault, impact="the relay exits at once with code 2", fix=advice.strip())
        return
    if started.failed is None or any(found.severity is Severity.ERROR for found in before):
        return
    yield error(
        "no_start",
        f"{_WHAT[started.failed]}:\n{started.fault}",
        impact="the relay does not start either",
        fix="search for the line above, and try an empty environment: env -i HOME=$HOME PATH=$PATH syncrelay doctor\n"
        "if that works, a variable of this shell is the cause; with wheels of ROS, `pip check` shows which do not fit",
    )
