"""What is observed live is measured as a recording is."""

from syncrelay.config import load, load_text
from syncrelay.recordings.analysis.live import LiveStreams, analyze_live
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import BEGIN, MS

_PAIR = inputs({"/camera": VECTOR, "/lidar": VECTOR})
_GROUP = {"policy": "approximate_time", "slop": "5ms", "topics": _PAIR}


def _heard(live, group, *, first, count):
    """Tell of so many messages at 10 Hz: a lidar's are stamped 7 ms after a camera's, received 20 and 30 ms later."""
    camera = [BEGIN + n * 100 * MS for n in range(first, first + count)]
    live.take(group, [[(at, at + 20 * MS) for at in camera], [(at + 7 * MS, at + 37 * MS) for at in camera]])


def test_messages_are_in_the_order_of_their_arrival():
    read = load_text(config({"front": _GROUP}))
    live = LiveStreams(read.groups)
    _heard(live, "front", first=0, count=3)
    camera, lidar = live.streams(read.groups[0])
    assert (camera.places[:].tolist(), lidar.places[:].tolist()) == ([0, 2, 4], [1, 3, 5])


def test_only_the_last_messages_are_kept():
    read = load_text(config({f"g{number}": _GROUP for number in range(100)}))
    live = LiveStreams(read.groups)
    for second in range(200):
        _heard(live, "g0", first=10 * second, count=10)
    camera, lidar = live.streams(read.groups[0])
    assert len(camera.stamps) == len(lidar.stamps) == 1000
    assert camera.stamps[-1] == BEGIN + 1999 * 100 * MS


def test_of_what_came_from_nobody_nothing_is_suggested():
    read = load_text(config({"front": _GROUP}))
    (analysis,) = analyze_live(read, read.groups, LiveStreams(read.groups))
    assert analysis.suggestion.hints == ("no values to suggest: no messages of /camera, /lidar",)


def test_a_group_that_goes_by_keys_is_left_out():
    keyed = {"policy": "equal_key", "topics": [{**each, "key": "vector.x"} for each in _PAIR]}
    read = load_text(config({"front": _GROUP, "keyed": keyed}))
    found = list(analyze_live(read, read.groups, LiveStreams(read.groups)))
    assert [each.group.name for each in found] == ["front"]


def test_a_group_is_measured_by_its_own_file_of_a_directory(tmp_path):
    (tmp_path / "front.yaml").write_text(config({"front": _GROUP}))
    (tmp_path / "node.yaml").write_text("version: 1\nnode: {name: rig}\n")
    (tmp_path / "rear.yaml").write_text(config({"rear": _GROUP}))
    read = load(str(tmp_path))
    live = LiveStreams(read.groups)
    _heard(live, "rear", first=0, count=50)
    _, rear = analyze_live(read, read.groups, live)
    assert (rear.group.name, rear.suggestion.now, rear.suggestion.then) == ("rear", 0, 50)
