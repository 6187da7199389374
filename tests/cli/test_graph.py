"""`syncrelay graph`: what is drawn of a file and of the relay that runs it, as Mermaid and as text."""

import json
import re
from pathlib import Path

import pytest

from syncrelay.config import load, load_text
from syncrelay.status import status_of
from syncrelay.status.document import read_status
from syncrelay.top.graph import Drawing, Mark, as_mermaid, as_text, drawing_of
from tests.cli.command import ROOT, run, run_here
from tests.status.support.serving import running
from tests.top import states

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
"""
_TEXT = """\
fusion.yaml

front: approximate_time, queue_size 20, max_wait 100ms, slop 20ms
  /lidar (sensor_msgs/msg/PointCloud2)                          -> /front/lidar
  /robot/camera (sensor_msgs/msg/Image, optional, offset -12ms) -> /robot/front/camera

state: latest_time, queue_size 20
  /lidar (sensor_msgs/msg/PointCloud2, trigger) -> /cloud
  /odom (type from the graph, stamp receive)    -> /state/odom
"""
_RIG = states.file(
    front=states.group({"/camera/image_raw": states.IMAGE, "/lidar/points": states.CLOUD}),
    rear=states.group({"/rear/image_raw": states.IMAGE, "/lidar/points": states.CLOUD}),
    inertial=states.group({"/lidar/points": states.CLOUD, "/imu/data": states.IMU}, queue_size=5),
    radar=states.group({"/lidar/points": states.CLOUD, "/radar/points": None}),
    new=states.group({f"/{'/'.join(['long'] * 40)}": states.IMAGE, f"/{'x' * 200}": states.IMAGE}),
)


def drawn() -> Drawing:
    return drawing_of(load_text(_FILE), title="fusion.yaml")


def hostile() -> Drawing:
    """The rig's file, and a relay that says what no relay says."""
    told = status_of(states.rig()).as_dict()
    for group in told["groups"]:
        for each in group["findings"]:
            each["text"] = _HOSTILE
        for each in group["inputs"]:
            each["type"] = _HOSTILE
    return drawing_of(load_text(_RIG), title=_HOSTILE, status=read_status(json.dumps(told).encode()))


def test_the_text_has_what_the_file_says(tmp_path: Path):
    (tmp_path / "fusion.yaml").write_text(_FILE)
    done = run_here("graph", "fusion.yaml", "--format", "text", folder=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, _TEXT, "")


def test_a_running_relay_adds_rates_and_the_finding_that_explains_most():
    drawing = drawing_of(load_text(_RIG), title="", status=status_of(states.rig()))
    boxes = {box.name: box for box, _ in drawing.groups}
    assert boxes["front"].lines[-1] == "OK, 10 of 10 sets/s"
    assert (boxes["front"].mark, boxes["front"].finding) == (Mark.OK, None)
    assert boxes["rear"].mark is Mark.ERROR
    assert (boxes["rear"].finding or "").startswith("other clock: ")
    assert (boxes["new"].mark, boxes["new"].finding) == (Mark.NONE, None)
    inputs = {each.name: each for each in drawing.inputs}
    assert inputs["/imu/data"].lines == ("sensor_msgs/msg/Imu", "200 Hz")
    assert (inputs["/radar/points"].lines[-1], inputs["/radar/points"].mark) == ("no messages", Mark.STALE)
    assert drawing.groups[0][1][0].output.lines == ("1 subscriber",)
    assert f"  {boxes['rear'].finding}" in as_text(drawing)


_LABEL = r'"[A-Za-z0-9 _./,:~+#;()<>-]*"'
_NODE = re.compile(rf"  (i\d+\[{_LABEL}\]|g\d+\({_LABEL}\)|g\d+ --> o\d+_\d+\[{_LABEL}\])")
_LINK = re.compile(rf"  i\d+ (-->|-\.->)(\|{_LABEL}\|)? g\d+")
_STYLE = re.compile(r"  (classDef \w+ [\w:#,\- ]+|class [ig\d,]+ \w+)")


@pytest.mark.parametrize("drawing", [drawn(), hostile()], ids=["file", "hostile"])
def test_mermaid_has_lines_of_its_grammar_alone_whatever_a_relay_says(drawing: Drawing):
    first, title, third, kind, *lines = as_mermaid(drawing)
    assert (first, third, kind) == ("---", "---", "flowchart LR")
    assert re.fullmatch(r'title: "[A-Za-z0-9 _./,:~+?-]*"', title)
    assert [line for line in lines if not any(each.fullmatch(line) for each in (_NODE, _LINK, _STYLE))] == []
    # Every character that is not plain is an entity; what is left of them is our own `<br/>`.
    labels = "".join(re.findall(r'"([^"]*)"', "\n".join(lines)))
    assert re.sub(r"#\d+;|<br/>", "", labels).isascii()
    assert not set("<>#;()") & set(re.sub(r"#\d+;|<br/>", "", labels))


@pytest.mark.parametrize("path", sorted((Path(ROOT) / "configs").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_path_of_an_example_is_drawn_in_both_forms(path: Path):
    drawing = drawing_of(load(str(path)), title=path.name)
    paths = [each for _, paths in drawing.groups for each in paths]
    mermaid, text = list(as_mermaid(drawing)), list(as_text(drawing))
    assert sum("> g" in line or "| g" in line for line in mermaid) == len(paths)
    assert sum(" -> " in line for line in text) == len(paths)


def test_the_command_draws_files_together_and_says_what_the_relay_does_not_run(tmp_path: Path):
    (tmp_path / "fusion.yaml").write_text(_RIG)
    alone = run("graph", "fusion.yaml", folder=tmp_path)
    assert (alone.returncode, alone.stderr) == (0, "")
    assert alone.stdout.startswith('---\ntitle: "fusion.yaml"\n---\nflowchart LR\n')
    with running(states.rig()) as server:
        live = run_here("graph", "fusion.yaml", "--format", "text", "--url", server.url, folder=tmp_path)
    assert live.returncode == 0
    assert live.stderr == "syncrelay: /syncrelay does not run new: drawn without figures\n"
    assert "OK, 10 of 10 sets/s" in live.stdout
    (tmp_path / "old.yaml").write_text(states.file(front=states.group({"/old": states.IMAGE, "/lidar/points": None})))
    with running(states.rig()) as server:
        other = run_here("graph", "old.yaml", "--url", server.url, folder=tmp_path)
    assert "<br/>as /camera/image_raw<br/>" in other.stdout
    assert other.stderr.splitlines()[-1] == (
        "syncrelay: front of /syncrelay matches /camera/image_raw, which the files do not have there: a remap, or it"
        " runs another version of them"
    )
    gone = run_here("graph", "fusion.yaml", "--url", server.url, folder=tmp_path)
    assert (gone.returncode, gone.stdout) == (1, "")
    assert gone.stderr.startswith(f"syncrelay: no relay answers at {server.url}\n")
