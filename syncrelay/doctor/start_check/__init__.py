"""A node started and ended as a check, in its own process: rcl and broken message libraries may end that."""

import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, Final

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
            [sys.executable, "-m", "syncrelay.doctor.start_check"],
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
