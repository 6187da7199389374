"""Inputs and groups that findings are about."""

from pathlib import Path

from syncrelay.config import Distance
from syncrelay.explain import Code, Distribution, Endpoint, Mismatch, Severity, Tolerance
from syncrelay.explain.clocks import Drift
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason
from tests.explain.support.groups import IMAGE, MS, NOW, S, a_group, an_input

LIDAR = an_input("/lidar")

UNFIT = Endpoint("/usb_cam", IMAGE, Mismatch("reliability", "best_effort", "reliable"))

STRANGER = Endpoint("/usb_cam", "std_msgs/msg/Int64")

QUIET = {"rate_hz": 0.0, "last_received": NOW - 7 * S, "fed": 0}

ONCE = {**QUIET, "usual_hz": 0.0, "longest_pause": 0}

AGES = {"policy": "latest_time", "trigger": 1, "tolerance": None, "distance": Distance.AGE, "repeats": True}

HALF_A_SECOND = {**AGES, "tolerance": Tolerance("max_age", 500 * MS)}


def said_of_cases() -> dict[str, tuple[Code, Severity, str, str | None]]:
    """What is found in each case: the code, how bad it is, the sentence, and what is suggested."""
    text = (Path(__file__).parents[1] / "findings.txt").read_text()
    said = {}
    for block in text.strip().split("\n\n"):
        name, kind, sentence, *suggestion = block.split("\n")
        code, severity = kind.split(", ")
        said[name] = Code(code), Severity[severity.upper()], sentence, "\n".join(suggestion) or None
    return said


def camera(**facts):
    return an_input("/camera", node="/usb_cam", **facts)


def dropped(reason, count, *, fed=100, **figures):
    return camera(figures={"dropped": {reason: count}, "fed": fed, **figures})


def fed(*, needed_queue=None):
    return InputCounts(600, 0, {}, 10, needed_queue)


def overflowing(needed):
    figures = {"dropped": {DropReason.OVERFLOW: 90}}
    return camera(counts=fed(needed_queue=needed), figures=figures)


def wide(*spans_ms, **figures):
    spans = Distribution([round(each * MS) for each in spans_ms])
    return {"nearest": spans, "nearest_since": spans, **figures}


def stamped(shift, *, delay=5 * MS, pace_hz=10.0):
    """The figures of the last stamps of an input at 10 Hz."""
    stamps = tuple(NOW - S * (100 - number) // 10 + shift for number in range(100))
    return {"stamps": stamps, "delay": None, "delays": (delay,) * 100, "pace_hz": pace_hz}


def without_camera(**figures):
    inputs = camera(required=False, figures=figures), LIDAR, an_input("/imu")
    return a_group(*inputs, figures={"missing": (1.0, 0.0, 0.0)}, max_wait=100 * MS)


def drifting(slope, *, watched=60 * S, bend=0.0):
    return camera(figures={"drift": Drift(slope, bend, watched)})


STEADY = an_input("/lidar", figures={"drift": Drift(0.0, 0.0, 60 * S)})
