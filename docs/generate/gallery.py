"""The gallery: faults of simulated rigs, what `analyze` says of each, and what the line that it names makes of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from docs.generate.lanes import Panel, picture
from syncrelay.config import GroupConfig, load_text
from syncrelay.explain import in_words
from syncrelay.recordings.analysis import Change, GroupAnalysis, patch
from syncrelay.recordings.analysis.analysis import analyze_group, group_of
from syncrelay.recordings.analysis.changes import with_changes
from syncrelay.recordings.analysis.streams import stamped
from syncrelay.recordings.cases.models import Case
from syncrelay.recordings.cases.sources import START, Arrival, arrivals, streams

PAGE: Final = Path(__file__).parents[1] / "reference" / "gallery.md"
PICTURES: Final = PAGE.with_suffix("")
_GROUP: Final = "front"
_CAMERA, _LIDAR, _IMU, _RADAR = "/camera/image_raw", "/lidar/points", "/imu/data", "/radar/points"
_TYPES: Final = {_CAMERA: "Image", _LIDAR: "PointCloud2", _IMU: "Imu", _RADAR: "PointCloud2"}

_Source = Mapping[str, str]
_CAMERA_30: Final[_Source] = {
    "rate": "30 Hz",
    "phase": "5ms",
    "jitter": "1ms",
    "latency": "20ms",
    "latency_jitter": "4ms",
    "drop": "2%",
}
_CAMERA_10: Final[_Source] = {**_CAMERA_30, "rate": "10 Hz"}
_LIDAR_10: Final[_Source] = {
    "rate": "10 Hz",
    "jitter": "1ms",
    "latency": "40ms",
    "latency_jitter": "6ms",
    "drop": "1%",
}
_IMU_100: Final[_Source] = {
    "rate": "100 Hz",
    "phase": "3ms",
    "jitter": "300us",
    "latency": "2ms",
    "latency_jitter": "1ms",
}
_RADAR_10: Final[_Source] = {"rate": "10 Hz", "jitter": "1ms", "latency": "20ms"}
_NEAR: Final = {"policy": "approximate_time", "slop": "20ms"}


# Problems are keys of tables, and never equal.
@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A rig with one fault, and its cure: for a topic, or for the group where it is None, keys and values.

    Sets are counted that have the `counted` topics, by default all. The picture shows the recording from `shown` on, in
    seconds, for `lasts`.
    """

    name: str
    title: str
    story: str
    group: Mapping[str, str]
    sensors: Mapping[str, _Source]
    cure: Sequence[tuple[str | None, str, str | int]]
    after: str
    what_if: Sequence[str] = ()
    optional: Sequence[str] = ()
    counted: Sequence[str] = ()
    unstamped: Sequence[str] = ()
    shown: float = 20.0
    lasts: float = 1.0

    @property
    def text(self) -> str:
        """The file before the cure."""
        keys = "".join(f"    {key}: {value}\n" for key, value in self.group.items())
        topics = "".join(
            f"      - topic: {topic}\n        type: sensor_msgs/msg/{_TYPES[topic]}\n"
            + ("        required: false\n" if topic in self.optional else "")
            for topic in self.sensors
        )
        return f"version: 1\ngroups:\n  {_GROUP}:\n{keys}    topics:\n{topics}"

    @property
    def changes(self) -> list[Change]:
        """The cure as `analyze` would write it."""
        places = {topic: index for index, topic in enumerate(self.sensors)}
        return [
            Change(_GROUP, None if topic is None else places[topic], key, value, "") for topic, key, value in self.cure
        ]


PROBLEMS: Final = (
    Problem(
        "clock_ahead",
        "A clock that is 80 ms ahead",
        "A camera and a lidar run at 5 Hz, started by one trigger. The camera's clock is 80 ms ahead.",
        _NEAR,
        {
            _CAMERA: {**_CAMERA_10, "rate": "5 Hz", "phase": "0ms", "offset": "80ms"},
            _LIDAR: {**_LIDAR_10, "rate": "5 Hz"},
        },
        [(_CAMERA, "offset", "-80ms")],
        "One trigger starts both, so the offset is right: a slop of 90 ms would let in pairs of two moments, too."
        " An `offset` is for matching alone: messages leave with their own stamps.",
        lasts=1.6,
    ),
    Problem(
        "drift",
        "A clock that drifts",
        "The camera's clock gains 0.8 ms a second. For 18 s slop still covers it.",
        _NEAR,
        {_CAMERA: _CAMERA_10, _LIDAR: _LIDAR_10},
        [(_CAMERA, "clock", "device"), (_CAMERA, "delay", "14.8ms")],
        "Its stamps are mapped to the host's time by when messages arrive. `delay` is the least time that they take.",
        what_if=[f"drift: {_CAMERA} 800ppm"],
        shown=17.5,
        lasts=1.6,
    ),
    Problem(
        "tai",
        "A sensor on PTP time",
        "The lidar stamps in TAI, as PTP clocks do, and the camera in UTC.",
        _NEAR,
        {_CAMERA: _CAMERA_30, _LIDAR: {**_LIDAR_10, "offset": "37s"}},
        [(_LIDAR, "offset", "-37s")],
        "In the first picture the lidar's messages stand where they arrived.",
    ),
    Problem(
        "unstamped",
        "A driver that sets no stamp",
        "Every image has stamp 0.",
        {**_NEAR, "slop": "30ms"},
        {_CAMERA: _CAMERA_30, _LIDAR: {**_LIDAR_10, "latency": "25ms"}},
        [(_CAMERA, "stamp", "receive")],
        "The time of receipt is late by the latency, and as uneven. A driver that stamps is better.",
        unstamped=[_CAMERA],
    ),
    Problem(
        "narrow_slop",
        "A slop that is too narrow",
        "At 30 Hz, a frame is up to 17 ms from a scan. The file allows 5 ms.",
        {**_NEAR, "slop": "5ms"},
        {_CAMERA: {**_CAMERA_30, "phase": "12ms"}, _LIDAR: _LIDAR_10},
        [(None, "slop", "25ms")],
        "No trigger starts both, so the slop is right and the offset is not.",
    ),
    Problem(
        "short_queue",
        "A queue that is too short",
        "The lidar's driver takes 120 ms for a scan. Meanwhile 12 messages of the IMU arrive, and its queue holds 5.",
        {**_NEAR, "queue_size": "5"},
        {_IMU: _IMU_100, _LIDAR: {**_LIDAR_10, "latency": "120ms"}},
        [(None, "queue_size", 41)],
        "The queue has to hold the IMU's messages until the scan arrives.",
        lasts=0.5,
    ),
    Problem(
        "dead_sensor",
        "A sensor that dies",
        "The radar stops after 12 s, and no set leaves without it.",
        _NEAR,
        {_CAMERA: _CAMERA_30, _LIDAR: _LIDAR_10, _RADAR: _RADAR_10},
        [(None, "max_wait", "60ms"), (_RADAR, "required", False)],
        "No finding suggests this, as only you know whether your consumer can do without the radar. Without it, each"
        " set leaves `max_wait` later.",
        what_if=[f"dead: {_RADAR} from 12s"],
        counted=[_CAMERA, _LIDAR],
        shown=11.5,
    ),
    Problem(
        "late_optional",
        "An optional sensor that comes too late",
        "The radar needs 90 ms, and sets wait 10 ms for it: all leave without it. Counted are sets with the radar.",
        {**_NEAR, "max_wait": "10ms"},
        {_CAMERA: _CAMERA_30, _LIDAR: _LIDAR_10, _RADAR: {**_RADAR_10, "latency": "90ms"}},
        [(None, "max_wait", "75ms")],
        "Waiting for the radar adds up to 65 ms of latency.",
        optional=[_RADAR],
    ),
)

_HEAD: Final = """\
<!-- Made by `make reference` of simulated rigs: docs/generate/gallery.py. -->
# Eight problems and their cures

Each rig is simulated for a minute and has one fault. The pictures show about a second of it as the report of
`syncrelay analyze` does, before the cure and after it: time runs to the right, a disc is a message in a set, a line
joins a set, and the other shapes are [reasons](drop_reasons.md) why a message is in none. [Findings](findings.md) has
all that can be found, and what to do.
"""
_SECTION: Final = """\
## {title}

{story}

![{title}: {before} of {possible} sets before the cure, {now} of {possible} after it](gallery/{name}.svg)

`analyze` says:

> {finding}

This cures it. Before, {before} of {possible} possible sets left; with it, {now}:

```yaml
{cure}```

{after}
"""


def gallery() -> tuple[str, dict[str, str]]:
    """Return the text of the page, and the pictures by their names."""
    sections, pictures = [_HEAD], {}
    for problem in PROBLEMS:
        section, pictures[f"{problem.name}.svg"] = _shown(problem)
        sections.append(section)
    return "\n".join(sections), pictures


def _shown(problem: Problem) -> tuple[str, str]:
    received = _received(problem)
    file = load_text(problem.text).groups[0]
    before, after = (
        _analyzed(text, received, file) for text in (problem.text, with_changes(problem.text, problem.changes))
    )
    possible = after.suggestion.possible
    counts = [_sets_of(group, problem.counted or [*problem.sensors]) for group in (before, after)]
    window = (problem.shown, problem.lasts)
    drawn = picture(
        [
            Panel(f"{name}: {count} of {possible} sets", group)
            for name, count, group in zip(("before", "after"), counts, (before, after), strict=True)
        ],
        begin=START,
        window=window,
    )
    section = _SECTION.format(
        title=problem.title,
        name=problem.name,
        story=problem.story,
        finding=in_words(before.findings[0].finding),
        cure=patch(problem.changes, {_GROUP: [*problem.sensors]}),
        before=counts[0],
        now=counts[1],
        possible=possible,
        after=problem.after,
    )
    return section, drawn


def _received(problem: Problem) -> list[Arrival]:
    """Return the messages of a minute, in order of receipt."""
    case: dict[str, Any] = {"lasts": "60s", "inputs": problem.sensors, "expect": {"sets": 1}}
    made = Case.model_validate({**case, "what_if": tuple(problem.what_if)})
    group = load_text(problem.text).groups[0]
    topics = [*problem.sensors]
    places = {topic: index for index, topic in enumerate(topics)}
    received, idle = arrivals(made, None, group, places, made.what_if or ())
    assert not idle  # noqa: S101  each fault is one
    return [each._replace(stamp=0) if topics[each.input] in problem.unstamped else each for each in received]


def _analyzed(text: str, received: Sequence[Arrival], file: GroupConfig) -> GroupAnalysis:
    group = group_of(text, _GROUP)
    return analyze_group(group, tuple(stamped(group, streams(received, file))), text)


def _sets_of(group: GroupAnalysis, topics: Sequence[str]) -> int:
    """Return how many sets of one moment have messages of these topics."""
    places = [place for place, topic in enumerate(group.group.topics) if topic.topic in topics]
    whole = sum(all(each.stamps[place] is not None for place in places) for each in group.evaluation.sets)
    return min(whole, group.suggestion.now)
