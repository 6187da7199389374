"""What came of starting a node for a check."""

from collections.abc import Iterator, Sequence
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, Severity, error, info
from syncrelay.doctor.start_check import StartResult, Step

_WHAT: Final = {
    Step.IMPORT: "rclpy cannot be imported",
    Step.TYPES: "message types cannot be imported",
    Step.INIT: "ROS does not start",
    Step.NODE: "no node starts here",
    Step.NAMES: "a node starts here, but fails at once",
}


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
        "if that works, a variable of this shell is the cause",
    )
