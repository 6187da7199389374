"""Who only looks publishes nothing, and who relays tells of others that publish the same outputs."""

import re
import sys

import pytest

from syncrelay.config import load_text
from tests.cli.terminals import on_terminal
from tests.ros.processes import wait_until
from tests.ros.sensors import PAIR, assert_looked_at_a_healthy_rig, front, play, stream
from tests.ros.stage import Collector, Stage
from tests.ros.status import findings
from tests.ros.streams import MS, merged

pytestmark = pytest.mark.ros

_RIG = merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7))
_SCALARS = {"diagnostics": {"scalars": True}}
_PUBLISHED = ("/front/camera", "/front/lidar", "/diagnostics", "/syncrelay/front/sets_hz")


def _publishers(collector: Collector) -> list[int]:
    return [len(collector.endpoints(topic, kind="publisher", node="/syncrelay")) for topic in _PUBLISHED]


def test_who_observes_beside_the_relay_publishes_nothing_and_sees_no_rival(stage: Stage):
    collector = stage.collector()
    relay = stage.relay(front(top=_SCALARS))
    play(stage, _RIG)
    wait_until(lambda: _publishers(collector) == [1, 1, 1, 1], "the relay's publishers")
    looks = stage.observe(front(top=_SCALARS), "--seconds", "12", "--json")
    inputs = [f"{topic} of both" for topic in PAIR]
    wait_until(
        lambda: (
            [len(collector.endpoints(topic, kind="subscription")) for topic in PAIR] == [2, 2] or not looks.running()
        ),
        f"subscriptions of {inputs}",
    )
    assert collector.nodes().count("/syncrelay") == 1
    seen: list[list[int]] = []

    def over() -> bool:
        seen.append(_publishers(collector))
        return not looks.running()

    wait_until(over, "the end of the look")
    assert all(each == [1, 1, 1, 1] for each in seen)
    assert_looked_at_a_healthy_rig(looks)
    assert "output_taken" not in looks.stdout
    assert "output_taken" not in findings(relay)


def test_a_file_is_tried_on_a_terminal_and_one_that_fits_is_written(stage: Stage):
    (stage.folder / "tried.yaml").write_text(front(slop="1ms"))
    argv = [sys.executable, "-m", "syncrelay", "observe", "--config", "tried.yaml", "--write", "new.yaml"]
    with on_terminal(argv, folder=stage.folder, environ={**stage.environment, "COLUMNS": "70"}) as look:
        play(stage, _RIG)
        look.wait_for("over slop")
        look.press("q")
        assert look.wait_for_end() == 1
    shown, told = look.written.split("\x1b[?1049l")
    assert "with tried.yaml" in shown
    assert "would have left: 0 sets" in told
    # An error once the group is silent, which takes longer than to see why.
    assert re.search("exit code 1: front has 1 (warning|error)", told)
    # What was logged meanwhile, where the look took long, stands as it is.
    lines = [line for line in told.splitlines()[1:] if not line.startswith("[WARN]")]
    assert [line for line in lines if len(line) > 70 and not line.startswith("    ")] == []
    (group,) = load_text((stage.folder / "new.yaml").read_text()).groups
    assert group.options.model_dump()["slop"] == 7 * MS
