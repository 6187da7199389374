"""`syncrelay tap` as a user starts it, on the relay's own server."""

import json
import random
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest

from syncrelay.config import Listen, load_text
from syncrelay.explain import GroupLines, RecentDrop, Tape
from syncrelay.status import RelayState, Taps
from syncrelay.status.as_document import status_of
from syncrelay.status.server import Server
from syncrelay.sync import DropReason
from syncrelay.top.tap import plain_line
from tests.cli.command import run
from tests.hostile_names import assert_shown_safely, hostile_name
from tests.top import states
from tests.top.speaker import answering

_MS = 1_000_000
_AT = 1_700_000_000 * 1000 * _MS
FILE = """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    max_wait: 100ms
    topics:
      - {topic: /camera, type: sensor_msgs/msg/Image}
      - {topic: /lidar, type: sensor_msgs/msg/Image}
      - {topic: /imu, type: sensor_msgs/msg/Imu, required: false}
"""
(GROUP,) = load_text(FILE).groups
_LEFT, _RECEIVED = _AT + 9 * _MS, _AT + 7 * _MS
A_SET = (_AT, _AT + 5 * _MS, None)
A_DROP = RecentDrop(1, _AT, DropReason.OVERFLOW)


def lines_of(group, *, topics=None) -> GroupLines:
    return GroupLines(group, topics or [topic.topic for topic in group.topics])


@contextmanager
def leaving(*outcomes, state: RelayState | None = None) -> Iterator[str]:
    """The URL of a relay from which these leave, again and again while somebody taps it."""
    taps, is_over = Taps(Tape(), str), Event()

    def leave() -> None:
        while not is_over.wait(0.01):
            for each in outcomes if taps.tape.is_on else ():
                taps.tape.note(GROUP, each, _LEFT, _RECEIVED)

    with Server(Listen("127.0.0.1", range(1))) as server:
        server.serve(lambda: state or states.healthy(), taps)
        thread = Thread(target=leave)
        thread.start()
        yield server.place.url
        is_over.set()
        thread.join()


def test_each_set_and_drop_is_a_line_with_the_offset_of_each_input(tmp_path):
    with leaving(A_SET, A_DROP) as url:
        done = run("tap", "--url", url, "-n", "4", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    lines = sorted(re.sub(r"^\d\d:\d\d:\d\d\.009 ", "", line) for line in done.stdout.splitlines())
    drop = "front: drop, /lidar overflow (its queue was full) after 2 ms"
    a_set = "front: set, span 5 ms, latency 2 ms: /camera +0 s, /lidar +5 ms, /imu missing"
    assert lines == [drop, drop, a_set, a_set]


def test_a_set_is_shown_as_it_was_matched_with_the_offsets_of_the_file():
    (group,) = load_text(FILE.replace("/lidar, ", "/lidar, offset: -5ms, ")).groups
    line = json.loads(lines_of(group).of_set(A_SET, left=_LEFT, received=_RECEIVED))
    assert (line["stamps"]["/lidar"], line["offsets"]) == (_AT + 5 * _MS, {"/lidar": -5 * _MS})
    assert plain_line(line).endswith("set, span 0 s, latency 2 ms: /camera +0 s, /lidar +0 s, /imu missing")


def test_json_lines_are_those_of_replay_and_say_what_was_not_needed(tmp_path):
    with leaving(A_SET, A_DROP) as url:
        done = run("tap", "front", "--json", "--url", url, "-n", "2", folder=tmp_path)
    assert done.returncode == 0
    assert sorted(map(json.loads, done.stdout.splitlines()), key=lambda line: "stamps" in line) == [
        {
            "group": "front",
            "time": _LEFT,
            "topic": "/lidar",
            "stamp": _AT,
            "received": _RECEIVED,
            "reason": "overflow",
            "unneeded": False,
        },
        {
            "group": "front",
            "time": _LEFT,
            "stamps": {"/camera": _AT, "/lidar": _AT + 5 * _MS, "/imu": None},
            "offsets": {},
            "span": 5 * _MS,
            "latency": 2 * _MS,
            "missing": ["/imu"],
        },
    ]


@pytest.mark.parametrize("words", [["--drops"], ["--reason", "overflow"]])
def test_only_drops_are_printed_where_they_are_asked_for(tmp_path, words):
    with leaving(A_SET, A_DROP) as url:
        done = run("tap", *words, "--url", url, "-n", "2", folder=tmp_path)
    assert [line.split()[2] for line in done.stdout.splitlines()] == ["drop,", "drop,"]


@pytest.mark.parametrize("key", ["time", "span", "latency", "stamps"])
def test_a_line_of_another_server_ends_it_with_a_sentence(tmp_path, key):
    sane = {"group": "front", "time": _AT, "stamps": {"/a": _AT}, "offsets": {}, "span": 0, "latency": 0}
    line = sane | {key: {"/a": 10**400} if key == "stamps" else 10**400}
    body = json.dumps({"after": 1, "more": False, "lost": 0, "lines": [line]}).encode()
    with answering(status_of(states.healthy()).as_json(), body) as url:
        done = run("tap", "--url", url, folder=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"syncrelay: the relay at {url} cannot be followed any more: what listens there is not a relay, or runs"
        " another version\n"
    )


def test_the_pages_show_what_is_printed():
    (group,) = load_text(
        """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    topics:
      - {topic: /camera/image_raw, type: sensor_msgs/msg/Image}
      - {topic: /lidar/points, type: sensor_msgs/msg/PointCloud2}
"""
    ).groups
    lines = lines_of(group)
    a_set = lines.of_set((_AT, _AT + 7 * _MS), left=_AT + 9_200_000, received=_AT + 8 * _MS)
    a_drop = lines.of_drop(
        RecentDrop(0, _AT, DropReason.TOO_FAR, unneeded=True), left=_AT + 63 * _MS, received=_AT + 2 * _MS
    )
    page = (Path(__file__).parents[2] / "docs" / "howto" / "observe.md").read_text()
    for line in (a_set, a_drop):
        assert plain_line(json.loads(line)).split(maxsplit=1)[1] in page


def test_what_a_reason_means_is_left_out_where_the_line_would_be_too_wide():
    topic = f"/{'a' * 65}"
    lines = lines_of(GROUP, topics=["/camera", topic, "/imu"])
    line = json.loads(lines.of_drop(A_DROP, left=_LEFT, received=_RECEIVED))
    shown = plain_line(line | {"group": "front"})
    assert shown.endswith(f" front: drop, {topic} overflow after 2 ms")
    assert len(shown) <= 120
    short = plain_line(line | {"topic": "/lidar"})
    assert short.endswith(" overflow (its queue was full) after 2 ms")


def test_lines_are_json_and_shown_safely_whatever_names_and_numbers_are():
    chance = random.Random(19)
    for _ in range(200):
        names = [
            chance.choice([hostile_name(chance), "100%", "%d", '"\\u0000"', "\0x"]) + str(each) for each in range(3)
        ]
        stamps = [chance.choice([None, chance.randrange(2**70)]) for _ in range(2)] + [chance.randrange(2**63)]
        lines = lines_of(GROUP, topics=names)
        line = json.loads(lines.of_set(stamps, left=5, received=7))
        matched = [stamp for stamp in stamps if stamp is not None]
        assert line["stamps"] == dict(zip(names, stamps, strict=True))
        assert line["missing"] == [name for name, stamp in line["stamps"].items() if stamp is None]
        assert (line["span"], line["latency"], line["time"]) == (max(matched) - min(matched), -2, 5)
        assert json.loads(lines.of_drop(A_DROP, left=5, received=7))["topic"] == names[1]
        shown = plain_line(line | {"group": hostile_name(chance)})
        assert "\n" not in shown
        assert_shown_safely(shown)
