"""`syncrelay graph`: what is drawn of files, as Mermaid and as text."""

import pathlib
import re

import pytest

from syncrelay.config import load, load_text
from syncrelay.config.graph import Box, Drawing, Path, as_mermaid, as_text, drawing_of
from tests.cli.command import ROOT, run_here

_HOSTILE = "\"]; click g0 href 'x' </text><script>alert(1)</script> #quot; %%{init: {}}%% \\N\\l & <b> \u202e"
_FILE = """\
version: 1
node: {namespace: /robot}
defaults: {queue_size: 20}
groups:
  front:
    policy: approximate_time
    slop: 20ms
    max_wait: 100ms
    topics:
      - {topic: /lidar, type: sensor_msgs/msg/PointCloud2}
      - {topic: camera, type: sensor_msgs/msg/Image, required: false, offset: -12ms}
  state:
    policy: latest_time
    trigger: /lidar
    topics:
      - {topic: /lidar, type: sensor_msgs/msg/PointCloud2, output: /cloud}
      - {topic: /odom, stamp: receive}
  fixed:
    policy: latest_time
    trigger: 29.97 Hz
    topics: [{topic: /lidar}, {topic: /odom}]
  whole:
    policy: latest_time
    trigger: /lidar
    bundle: {topic: set, type: my_msgs/msg/Set}
    topics: [{topic: /lidar}, {topic: /imu, type: sensor_msgs/msg/Imu}]
"""
_TEXT = """\
fusion.yaml

front: approximate_time, queue_size 20, max_wait 100ms, slop 20ms
  /lidar (sensor_msgs/msg/PointCloud2)                          -> /front/lidar
  /robot/camera (sensor_msgs/msg/Image, optional, offset -12ms) -> /robot/front/camera

state: latest_time, queue_size 20
  /lidar (sensor_msgs/msg/PointCloud2, trigger) -> /cloud
  /odom (type from the graph, stamp receive)    -> /state/odom

fixed: latest_time, trigger 29.97 Hz, queue_size 20
  /lidar (sensor_msgs/msg/PointCloud2) -> /fixed/lidar
  /odom (type from the graph)          -> /fixed/odom

whole: latest_time, queue_size 20
  /lidar (sensor_msgs/msg/PointCloud2, trigger) -> /whole/lidar
  /imu (sensor_msgs/msg/Imu)                    -> /whole/imu
  whole sets (my_msgs/msg/Set)                  -> /robot/set
"""
_BOX = Box(_HOSTILE, (_HOSTILE, "slop 20ms"))
_ANYTHING = Drawing(_HOSTILE, (_BOX,), ((_BOX, (Path(0, _HOSTILE, is_optional=True, output=_HOSTILE),), _BOX),))


def test_the_text_has_what_the_file_says(tmp_path: pathlib.Path):
    (tmp_path / "fusion.yaml").write_text(_FILE)
    done = run_here("graph", "fusion.yaml", "--format", "text", folder=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, _TEXT, "")


_LABEL = r'"[A-Za-z0-9 _./,:~+#;()<>-]*"'
_NODE = re.compile(rf"  (i\d+\[{_LABEL}\]|g\d+\({_LABEL}\)|g\d+ --> o\d+_\d+\[{_LABEL}\])")
_LINK = re.compile(rf"  i\d+ (-->|-\.->)(\|{_LABEL}\|)? g\d+")


@pytest.mark.parametrize(
    "drawing", [drawing_of(load_text(_FILE), title="fusion.yaml"), _ANYTHING], ids=["file", "hostile"]
)
def test_mermaid_has_lines_of_its_grammar_alone_whatever_is_drawn(drawing: Drawing):
    first, title, third, kind, *lines = as_mermaid(drawing)
    assert (first, third, kind) == ("---", "---", "flowchart LR")
    assert re.fullmatch(r'title: "[A-Za-z0-9 _./,:~+?-]*"', title)
    assert [line for line in lines if not any(each.fullmatch(line) for each in (_NODE, _LINK))] == []
    # Every character that is not plain is an entity; what is left of them is our own `<br/>`.
    labels = "".join(re.findall(r'"([^"]*)"', "\n".join(lines)))
    assert re.sub(r"#\d+;|<br/>", "", labels).isascii()
    assert not set("<>#;()") & set(re.sub(r"#\d+;|<br/>", "", labels))


@pytest.mark.parametrize("path", sorted((pathlib.Path(ROOT) / "configs").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_path_of_an_example_is_drawn_in_both_forms(path: pathlib.Path):
    drawing = drawing_of(load(str(path)), title=path.name)
    paths = [each for _, paths, _ in drawing.groups for each in paths]
    mermaid, text = list(as_mermaid(drawing)), list(as_text(drawing))
    assert sum("> g" in line or "| g" in line for line in mermaid) == len(paths)
    assert sum(" -> " in line for line in text) == len(paths)
