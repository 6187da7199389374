"""What came of starting a node for a trial."""

from collections.abc import Iterator, Sequence
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, Severity, know, mend
from syncrelay.ros.trial import Step, Trial

_WHAT: Final = {
    Step.IMPORT: "rclpy cannot be imported",
    Step.TYPES: "message types cannot be imported",
    Step.INIT: "ROS does not start",
    Step.NODE: "a node does not start here",
    Step.NAMES: "a node started here does not live",
}


def check_start(trial: Trial, *, before: Sequence[Diagnosis]) -> Iterator[Diagnosis]:
    """Yield why a node does not start, unless something to mend that was found `before` explains it.

    Of one that starts, yield why it receives at a higher cost, if it does.
    """
    if trial.path_fault:
        yield know(
            "receive_path",
            f"messages pass through rclpy: librcl is not as expected here ({trial.path_fault})",
            so="the relay works, and each message costs it more CPU",
            do="report it, with the first line of this examination",
        )
    if trial.failed is Step.ARGUMENTS:
        fault, _, advice = trial.fault.partition("\n")
        yield mend("ros_args", fault, so="the relay ends at once with exit code 2", do=advice.strip())
        return
    if trial.failed is None or any(found.severity is Severity.MEND for found in before):
        return
    yield mend(
        "no_start",
        f"{_WHAT[trial.failed]}:\n{trial.fault}",
        so="the relay does not start either",
        do="search for the line above; try in an empty environment: env -i HOME=$HOME PATH=$PATH syncrelay doctor\n"
        "where that works, a variable of this shell is to blame",
    )
