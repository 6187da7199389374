"""Who only looks sees it on a terminal, and writes what fits."""

import re
import sys

import pytest

from syncrelay.config import load_text
from tests.cli.terminals import on_terminal
from tests.ros.sensors import front, play, stream
from tests.ros.stage import Stage
from tests.ros.streams import MS, merged

pytestmark = pytest.mark.ros

_RIG = merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7))


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
