"""What the pages for users of message_filters, topic_tools and Autoware make of nodes of public projects, run."""

import re
from pathlib import Path

import pytest

from syncrelay.recordings.cases import check, load_suite_text

_HOWTO = Path(__file__).parents[1] / "docs" / "howto"
_PAGES = [(_HOWTO / f"from_{name}.md").read_text() for name in ("message_filters", "topic_tools", "autoware")]
_CASES = {
    "stereo": """
  what has one stamp leaves at once, and what is older is superseded:
    drawing: |
      left/image_rect   |a.b
      left/camera_info  |A.B
      right/image_rect  |..1
      right/camera_info |..5
      -> 5: a superseded, A superseded, bB15
  stamps that differ are not of one moment:
    period: 1ns
    drawing: |
      left/image_rect   |a
      left/camera_info  |.A
      right/image_rect  |1
      right/camera_info |5
""",
    "rgbd": """
  the nearest three get the latest stamp, however far apart they are:
    drawing: |
      rgb/image       |a.........b
      depth/image     |...A......B
      rgb/camera_info |c.........d
      -> b: aAc stamped A
      -> d: bBd stamped b
""",
    "outliers": """
  grid and cloud of one stamp leave when the later one has come, and a cloud without its grid is superseded:
    drawing: |
      map        |a....c
      pointcloud |AB...C
      arrive: A B a c C
      -> a: aA
      -> C: B superseded, cC
  the oldest of six clouds without a grid overflows:
    drawing: |
      map        |.......
      pointcloud |ABCDEF.
      -> F: A overflow
""",
    "merged": """
  the nearest two get the stamp of the first, however far apart they are:
    drawing: |
      clustering/objects  |a.........b.........c
      centerpoint/objects |....A.........B......
      -> b: aA stamped a
      -> c: bB stamped b
""",
    "calibration": """
  a pair leaves four times a second:
    inputs:
      infra1/image_rect_raw: {rate: 30 Hz, drop: 5%}
      infra2/image_rect_raw: {rate: 30 Hz, drop: 5%}
    lasts: 30s
    expect: {sets: ">= 100", span_max: 0, drops: {overflow: 0}}
  no more than four leave:
    inputs:
      infra1/image_rect_raw: {rate: 30 Hz}
      infra2/image_rect_raw: {rate: 30 Hz}
    lasts: 30s
    expect: {sets: "<= 121", span_max: 0}
""",
    "scene": """
  the three leave together once a second:
    inputs:
      color/image_raw: {rate: 30 Hz, jitter: 1ms}
      depth/image_rect_raw: {rate: 30 Hz, jitter: 1ms, phase: 3ms}
      color/points: {rate: 15 Hz, jitter: 1ms}
    lasts: 30s
    expect: {sets: ">= 28", span_max: "<= 20ms", inputs: {color/points: {in_sets: "<= 31"}}}
""",
}
_FILES = {
    name: text
    for page in _PAGES
    for text, name in re.findall(r"^```yaml\n(version: 1\ngroups:\n  (?=(\w+)).*?)^```", page, re.DOTALL | re.MULTILINE)
}


@pytest.mark.parametrize("name", _CASES)
def test_a_node_of_a_public_project_becomes_a_file_that_does_the_same(name, tmp_path):
    (tmp_path / "fusion.yaml").write_text(_FILES[name])
    text = f"version: 1\nconfig: fusion.yaml\ncases:{_CASES[name]}"
    outcomes = [*check(load_suite_text(text, name=str(tmp_path / "suite.yaml")))]
    assert outcomes
    assert [each for each in outcomes if not each.passed] == []
