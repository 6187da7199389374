"""`syncrelay graph`: what is drawn of a file and of the relay that runs it, by each of its three ways to draw."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from syncrelay.cli.graph.dot import as_dot
from syncrelay.cli.graph.drawing import Drawing, Mark, drawing_of
from syncrelay.cli.graph.layout import Placed, layout_of
from syncrelay.cli.graph.mermaid import as_mermaid
from syncrelay.cli.graph.svg import as_svg
from syncrelay.config import load, load_text
from syncrelay.status import status_of
from syncrelay.status.document import read_status
from tests.cli.command import ROOT, run, run_here
from tests.top import states
from tests.top.relay_server import serving

_SVG = "{http://www.w3.org/2000/svg}"
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
_FORMATS = {"mermaid": as_mermaid, "dot": as_dot, "svg": as_svg}


def drawn(text: str = _FILE, **options) -> Drawing:
    return drawing_of(load_text(text), title="fusion.yaml", **options)


def hostile() -> Drawing:
    """The rig's file, and a relay that says what no relay says."""
    told = status_of(states.rig()).as_dict()
    for group in told["groups"]:
        for each in group["findings"]:
            each["text"] = _HOSTILE
        for each in group["inputs"]:
            each["type"] = _HOSTILE
    return drawing_of(load_text(_RIG), title=_HOSTILE, state=read_status(json.dumps(told).encode()))


_RIG = states.file(
    front=states.group({"/camera/image_raw": states.IMAGE, "/lidar/points": states.CLOUD}),
    rear=states.group({"/rear/image_raw": states.IMAGE, "/lidar/points": states.CLOUD}),
    inertial=states.group({"/lidar/points": states.CLOUD, "/imu/data": states.IMU}, queue_size=5),
    radar=states.group({"/lidar/points": states.CLOUD, "/radar/points": None}),
    new=states.group({f"/{'/'.join(['long'] * 40)}": states.IMAGE, f"/{'x' * 200}": states.IMAGE}),
)


def test_a_drawing_has_what_the_file_says():
    drawing = drawn()
    assert [(each.name, each.lines) for each in drawing.inputs] == [
        ("/lidar", ("sensor_msgs/msg/PointCloud2",)),
        ("/robot/camera", ("sensor_msgs/msg/Image",)),
        ("/odom", ("type from the graph",)),
    ]
    front, state = drawing.groups
    assert front.box.lines == ("approximate_time", "queue_size 20", "max_wait 100ms", "slop 20ms")
    assert [(link.input, link.label, link.is_dashed) for link in front.links] == [
        (0, "", False),
        (1, "optional, offset -12ms", True),
    ]
    assert [(link.input, link.label) for link in state.links] == [(0, "trigger"), (2, "stamp receive")]
    assert [each.name for each in state.outputs] == ["/cloud", "/state/odom"]


def test_a_running_relay_adds_rates_and_the_finding_that_explains_most():
    drawing = drawing_of(load_text(_RIG), title="", state=status_of(states.rig()))
    boxes = {group.box.name: group.box for group in drawing.groups}
    assert boxes["front"].lines[-1] == "OK, 10 of 10 sets/s"
    assert (boxes["front"].mark, boxes["front"].finding) == (Mark.OK, None)
    assert boxes["rear"].mark is Mark.ERROR
    assert (boxes["rear"].finding or "").startswith("other clock: ")
    assert (boxes["new"].mark, boxes["new"].finding) == (Mark.NONE, None)
    inputs = {each.name: each for each in drawing.inputs}
    assert inputs["/imu/data"].lines == ("sensor_msgs/msg/Imu", "200 Hz")
    assert (inputs["/radar/points"].lines[-1], inputs["/radar/points"].mark) == ("no messages", Mark.STALE)
    assert drawing.groups[0].outputs[0].lines == ("1 subscriber",)


@pytest.mark.parametrize("name", _FORMATS)
def test_every_name_is_drawn_and_once(name: str):
    text = _FORMATS[name](drawn())
    for topic in ("/robot/camera", "/odom", "/front/lidar", "/cloud"):
        assert len(re.findall(rf"[\"\]>]{re.escape(topic)}[\"<\\]", text)) == 1, topic


def parsed(svg: str) -> ET.Element:
    return ET.fromstring(svg)  # noqa: S314  it is ours


def texts(svg: str) -> list[str]:
    return [each.text or "" for each in parsed(svg).iter(f"{_SVG}text")]


def test_an_svg_is_xml_that_holds_hostile_words_as_text_alone():
    svg = as_svg(hostile())
    root = parsed(svg)
    assert {each.tag.removeprefix(_SVG) for each in root.iter()} == {
        *("svg", "title", "desc", "style", "defs", "marker", "path", "rect", "text", "g")
    }
    assert "</text><script>alert(1)</script>" in "".join(texts(svg))
    assert root.findtext(f"{_SVG}title", "").startswith('"]; click g0')


def test_an_svg_can_be_read_aloud():
    root = parsed(as_svg(drawn()))
    assert root.get("role") == "img"
    assert root.findtext(f"{_SVG}title") == "fusion.yaml"
    assert (
        "front (approximate_time, queue_size 20, max_wait 100ms, slop 20ms) matches /lidar and /robot/camera, and"
        in root.findtext(f"{_SVG}desc", "")
    )


def _overlap(one: Placed, other: Placed) -> bool:
    return (
        one.x < other.right and other.x < one.right and one.y < other.y + other.height and other.y < one.y + one.height
    )


_MANY = states.file(
    **{
        f"g{number}": states.group({f"/in{number * step % 17}": states.IMAGE for step in (1, 3, 5)} | {"/all": None})
        for number in range(1, 12)
    }
)


@pytest.mark.parametrize("text", [_FILE, _RIG, _MANY], ids=["file", "rig", "many"])
def test_no_box_of_an_svg_stands_on_another_and_all_are_within_it(text: str):
    layout = layout_of(drawn(text))
    placed = [*layout.boxes, *layout.groups]
    assert [(one.lines, other.lines) for one, other in combinations(placed, 2) if _overlap(one, other)] == []
    assert all(each.x > 0 and each.y > 0 and each.right < layout.width for each in placed)
    assert all(each.y + each.height < layout.height for each in placed)
    assert all(line.start[0] < line.end[0] - line.level for line in layout.lines)


def test_a_line_of_an_svg_is_level_under_its_label_so_that_it_does_not_cross_it():
    lines, svg = [line for line in layout_of(drawn()).lines if line.label], as_svg(drawn())
    assert lines
    for line in lines:
        (x, y), level = line.end, line.level
        assert level > 6.6 * len(line.label)
        assert f' {x - level:.1f} {y:.1f}H{x:.1f}"' in svg


_LABEL = r'"[A-Za-z0-9 _./,:~+#;()<>-]*"'
_NODE = re.compile(rf"  (i\d+\[{_LABEL}\]|g\d+\({_LABEL}\)|g\d+ --> o\d+_\d+\[{_LABEL}\])")
_LINK = re.compile(rf"  i\d+ (-->|-\.->)(\|{_LABEL}\|)? g\d+")
_STYLE = re.compile(r"  (classDef \w+ [\w:#,\- ]+|class [ig\d,]+ \w+)")


@pytest.mark.parametrize("drawing", [drawn(), hostile()], ids=["file", "hostile"])
def test_mermaid_has_lines_of_its_grammar_alone_whatever_a_relay_says(drawing: Drawing):
    first, title, third, kind, *lines = as_mermaid(drawing).splitlines()
    assert (first, third, kind) == ("---", "---", "flowchart LR")
    assert re.fullmatch(r'title: "[A-Za-z0-9 _./,:~+?-]*"', title)
    assert [line for line in lines if not any(each.fullmatch(line) for each in (_NODE, _LINK, _STYLE))] == []
    # Every character that is not plain is an entity; what is left of them is our own `<br/>`.
    labels = "".join(re.findall(r'"([^"]*)"', "\n".join(lines)))
    assert re.sub(r"#\d+;|<br/>", "", labels).isascii()
    assert not set("<>#;()") & set(re.sub(r"#\d+;|<br/>", "", labels))


@pytest.mark.skipif(shutil.which("dot") is None, reason="there is no dot: apt-get install graphviz")
@pytest.mark.parametrize("drawing", [drawn(), hostile()], ids=["file", "hostile"])
def test_graphviz_draws_every_box_and_line(drawing: Drawing):
    done = subprocess.run(
        [shutil.which("dot") or "", "-Tjson0"], input=as_dot(drawing), capture_output=True, text=True, check=True
    )
    told = json.loads(done.stdout)
    links = sum(len(group.links) + len(group.outputs) for group in drawing.groups)
    outputs = sum(len(group.outputs) for group in drawing.groups)
    assert len(told["objects"]) == len(drawing.inputs) + len(drawing.groups) + outputs
    assert len(told["edges"]) == links
    assert done.stderr == ""


@pytest.mark.parametrize("path", sorted((Path(ROOT) / "configs").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_example_can_be_drawn(path: Path):
    drawing = drawing_of(load(str(path)), title=path.name)
    for draw in _FORMATS.values():
        assert draw(drawing)


def test_the_command_draws_files_together_and_says_what_the_relay_does_not_run(tmp_path: Path):
    (tmp_path / "fusion.yaml").write_text(_RIG)
    alone = run("graph", "fusion.yaml", folder=tmp_path)
    assert (alone.returncode, alone.stderr) == (0, "")
    assert alone.stdout.startswith('---\ntitle: "fusion.yaml"\n---\nflowchart LR\n')
    with serving(states.rig()) as server:
        live = run_here("graph", "fusion.yaml", "--format", "svg", "--url", server.url, folder=tmp_path)
    assert live.returncode == 0
    assert live.stderr == "syncrelay: /syncrelay does not run new: drawn without figures\n"
    assert "OK, 10 of 10 sets/s" in texts(live.stdout)
    (tmp_path / "old.yaml").write_text(states.file(front=states.group({"/old": states.IMAGE, "/lidar/points": None})))
    with serving(states.rig()) as server:
        other = run_here("graph", "old.yaml", "--url", server.url, folder=tmp_path)
    assert "<br/>as /camera/image_raw<br/>" in other.stdout
    assert other.stderr.splitlines()[-1] == (
        "syncrelay: front of /syncrelay matches /camera/image_raw, which the files do not have there: a remap, or it"
        " runs another version of them"
    )
    gone = run_here("graph", "fusion.yaml", "--url", server.url, folder=tmp_path)
    assert (gone.returncode, gone.stdout) == (1, "")
    assert gone.stderr.startswith(f"syncrelay: no relay answers at {server.url}\n")


_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Of each text, whether it is wider than the box that it stands in; and the colour of the paper.
_LOOK = """() => ({
  wide: [...document.querySelectorAll("g.topic, g.group")].flatMap((box) => {
    const around = box.querySelector("rect").getBoundingClientRect();
    return [...box.querySelectorAll("text")].filter((text) => {
      const {right, bottom} = text.getBoundingClientRect();
      return right > around.right || bottom > around.bottom;
    }).map((text) => text.textContent);
  }),
  paper: getComputedStyle(document.querySelector(".paper")).fill,
})"""


@pytest.fixture
def browser() -> Iterator[object]:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install '.[test]'")
    if _CHROMIUM is None:
        pytest.skip("there is no chromium: apt-get install chromium")
    with sync_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=_CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


def test_in_a_browser_texts_are_within_their_boxes_in_light_and_dark(browser, tmp_path: Path):
    (tmp_path / "graph.svg").write_text(as_svg(hostile()))
    papers = {}
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto((tmp_path / "graph.svg").as_uri())
        looked = page.evaluate(_LOOK)
        assert looked["wide"] == []
        papers[scheme] = looked["paper"]
    assert papers == {"light": "rgb(255, 255, 255)", "dark": "rgb(13, 17, 23)"}
