"""No option without an effect: each is changed, and what comes out has to change with it."""

import json
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from syncrelay.config import Config, load_text
from syncrelay.config.file import file_format
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.frames import Edge, Frames
from syncrelay.sync import Match, Message, Outcome
from tests.drawn_files import models_of

MS = 1_000_000
IMAGE = "sensor_msgs/msg/Image"
APPROXIMATE = {"policy": "approximate_time", "slop": "20ms"}
EXACT = {"policy": "exact_time"}
LATEST = {"policy": "latest_time", "trigger": "/a"}
CLOCK = {"policy": "latest_time", "trigger": "20 Hz"}
KEYED = {"policy": "equal_key", "key": "header.stamp"}
OPTIONAL = {"required": False}


def file(keys: dict[str, Any] = APPROXIMATE, *, first: dict[str, Any] | None = None, **top: Any) -> str:
    """A file with one group of these keys, whose first topic has keys of its own. JSON is YAML."""
    topics = [{"topic": "/a", "type": IMAGE, **(first or {})}, {"topic": "/b", "type": IMAGE}]
    return json.dumps({"version": 1, "groups": {"front": {"topics": topics, **keys}}, **top})


def sets_of(*arrivals: tuple[int, int]) -> Callable[[Config], object]:
    """The sets that the first group's engine makes of messages, given as input and milliseconds."""

    def sets(config: Config) -> object:
        engine = config.groups[0].engine()
        fed = (Message(index, stamp * MS, None) for index, stamp in arrivals)
        outcomes = (outcome for message in fed for outcome in engine.add(message, now=0))
        return [
            ([message and message.stamp // MS for message in outcome.messages], outcome.stamp)
            for outcome in outcomes
            if isinstance(outcome, Match)
        ]

    return sets


def sets_by_clock(*arrivals: tuple[int, int]) -> Callable[[Config], object]:
    """The stamps of sets of messages that arrive as they are stamped, in milliseconds, and when each left."""

    def sets(config: Config) -> object:
        left: list[object] = []

        def take(outcomes: Sequence[Outcome], now: int) -> None:
            left.extend((now // MS, each.stamps, each.stamp) for each in outcomes if isinstance(each, Match))

        EngineDriver(config.groups[0], take).run(Message(index, ms * MS, ms * MS) for index, ms in arrivals)
        return left

    return sets


def sets_after(wait_ms: int, *arrivals: tuple[int, int]) -> Callable[[Config], object]:
    """How many sets have left some time after these messages."""

    def sets(config: Config) -> object:
        engine = config.groups[0].engine()
        for index, stamp in arrivals:
            engine.add(Message(index, stamp * MS, None), now=0)
        engine.expire(now=wait_ms * MS)
        return engine.sets

    return sets


def sets_with_transforms(wait_ms: int) -> Callable[[Config], object]:
    """How many sets have left some time after they were matched, when the transform from `arm` to `base` came."""

    def sets(config: Config) -> object:
        frames = Frames()
        engine = config.groups[0].engine(frames)
        for index in (0, 1):
            engine.add(Message(index, 100 * MS, None, frame="arm"), now=0)
        engine.expire(now=(wait_ms - 1) * MS)
        frames.add(Edge("base", "arm", 0, is_static=True))
        engine.expire(now=wait_ms * MS)
        return engine.sets

    return sets


def outputs(config: Config) -> object:
    return [topic.output for group in config.groups for topic in group.topics]


def of_bundle(config: Config) -> object:
    return config.groups[0].bundle


def own_topics(config: Config) -> object:
    """The names that the node must have for itself."""
    return config.names.written


def of_first_topic(name: str) -> Callable[[Config], object]:
    return lambda config: getattr(config.groups[0].topics[0], name)


def host_time(config: Config) -> object:
    """What a stamp of the first topic is matched by, that is received a second later."""
    clock = config.groups[0].topics[0].device_clock()
    return clock.host_time(5 * 1000 * MS, 6 * 1000 * MS) if clock else None


NEAR_PAIRS = sets_of((0, 1), (1, 3), (0, 101), (1, 103), (0, 201), (1, 203))
WIDER_PAIRS = sets_of((0, 100), (1, 110), (0, 200), (1, 210), (0, 300), (1, 310))
ONE_INPUT_AHEAD = sets_of((0, 10), (0, 20), (1, 10))
TWO_SPANS_TO_CHOOSE_FROM = sets_of((0, 8), (1, 11), (0, 13), (0, 19))

EXACT_PAIRS = sets_of((0, 10), (1, 10), (0, 20), (1, 20), (0, 200), (1, 200))
BY_CLOCK = sets_by_clock((0, 10), (1, 20), (0, 40), (1, 45), (0, 190))
LATEST_OF_BOTH = sets_of((1, 10), (0, 100), (1, 110), (0, 120))
OPEN_PAIR = sets_after(50, (0, 100), (1, 101))

Row = tuple[str, str, Callable[[Config], object]]


def of_group(outcome: Callable[[Config], object], keys: dict[str, Any] = APPROXIMATE, **values: Any) -> Row:
    """Two files of groups with these keys, which differ in one: its values, or the one that it has in the second."""
    ((key, value),) = values.items()
    one, other = ({key: each} for each in value) if isinstance(value, tuple) else ({}, {key: value})
    return file({**keys, **one}), file({**keys, **other}), outcome


def of_topic(outcome: Callable[[Config], object], keys: dict[str, Any] = APPROXIMATE, **key: Any) -> Row:
    """Two files of groups with these keys; the first topic of the second has a key more."""
    return file(keys), file(keys, first=key), outcome


def of_section(outcome: Callable[[Config], object], **section: Any) -> Row:
    return file(), file(**section), outcome


def of_node(name: str, value: object) -> Row:
    return of_section(lambda config: getattr(config.node, name), node={name: value})


WITH_OPTIONAL = {**EXACT, "topics": [{"topic": "/a", "type": IMAGE, **OPTIONAL}, {"topic": "/b", "type": IMAGE}]}
BUNDLE = {"topic": "/set", "type": "dock_msgs/msg/Stereo"}
BY_B = {**LATEST, "trigger": "/b", "max_age": "1s"}


def _of_three(first: dict[str, Any]) -> str:
    """A file whose group needs two of three inputs, of which the first has these keys."""
    rows = [{"topic": topic, "type": IMAGE} for topic in ("/a", "/b", "/c")]
    return file({**EXACT, "max_wait": "10ms", "quorum": 2, "topics": [{**rows[0], **first}, *rows[1:]]})


OPTIONS: dict[str, Row] = {
    "policy": (file(), file(EXACT), NEAR_PAIRS),
    "queue_size": of_group(ONE_INPUT_AHEAD, EXACT, queue_size=(1, 2)),
    "slop": of_group(WIDER_PAIRS, slop="5ms"),
    "slop: none": of_group(WIDER_PAIRS, slop=("5ms", "none")),
    "age_penalty": of_group(TWO_SPANS_TO_CHOOSE_FROM, age_penalty=(0, 1)),
    "restamp": of_group(NEAR_PAIRS, restamp="earliest"),
    "restamp: latest": of_group(NEAR_PAIRS, restamp=("earliest", "latest")),
    "restamp: input": of_group(NEAR_PAIRS, restamp=("/a", "/b")),
    "required": of_topic(sets_of((1, 10), (0, 20)), {**EXACT, "max_wait": 1}, **OPTIONAL),
    "max_wait": of_group(sets_after(50, (1, 100)), WITH_OPTIONAL, max_wait=("10ms", "1s")),
    "quorum": of_group(sets_after(50, (0, 100)), {**EXACT, "max_wait": "10ms"}, quorum=1),
    "required: with a quorum": (
        _of_three({}),
        _of_three({"required": True}),
        sets_after(50, (1, 100), (2, 100)),
    ),
    "max_wait: all required": of_group(OPEN_PAIR, max_wait="10ms"),
    "max_rate": of_group(EXACT_PAIRS, EXACT, max_rate="10 Hz"),
    "every": of_group(EXACT_PAIRS, EXACT, every=2),
    "trigger": of_group(LATEST_OF_BOTH, LATEST, trigger="/b"),
    "trigger: a clock": of_group(BY_CLOCK, LATEST, trigger=("30 Hz", 20)),
    "max_wait: by a clock": of_group(BY_CLOCK, CLOCK, max_wait="30ms"),
    "max_age: by a clock": of_group(BY_CLOCK, CLOCK, max_age="20ms"),
    "restamp: trigger": of_group(BY_CLOCK, CLOCK, restamp="trigger"),
    "restamp: trigger of an input": of_group(LATEST_OF_BOTH, LATEST, restamp=("earliest", "trigger")),
    "max_age": of_group(LATEST_OF_BOTH, LATEST, max_age="50ms"),
    "max_age: own": of_topic(LATEST_OF_BOTH, BY_B, max_age="5ms"),
    "max_age: own, by a clock": of_topic(BY_CLOCK, CLOCK, max_age="20ms"),
    "key": of_group(of_first_topic("key"), KEYED, key="header.frame_id"),
    "key: own": of_topic(of_first_topic("key"), KEYED, key="header.stamp.sec"),
    "offset": of_topic(sets_of((0, 150), (1, 100)), EXACT, offset="-50ms"),
    "min_period": of_topic(sets_of((0, 14), (1, 15)), min_period="90ms"),
    "tolerance": of_topic(
        sets_after(50, (0, 100), (1, 113)),
        {**APPROXIMATE, "quorum": 1, "max_wait": "10ms"},
        tolerance="2ms",
    ),
    "topic": of_topic(of_first_topic("topic"), topic="/z"),
    "type": of_topic(of_first_topic("type"), type="sensor_msgs/msg/Imu"),
    "output": of_topic(outputs, output="/z"),
    "output_prefix": of_group(outputs, output_prefix="/z"),
    "transforms": of_group(sets_with_transforms(150), EXACT, transforms={"target": "base"}),
    "target": of_group(sets_with_transforms(50), EXACT, transforms=({"target": "base"}, {"target": "map"})),
    "wait": of_group(
        sets_with_transforms(150), EXACT, transforms=({"target": "base"}, {"target": "base", "wait": "200ms"})
    ),
    "bundle": of_group(lambda config: config.groups[0].outputs, bundle=BUNDLE),
    "fields": of_group(of_bundle, bundle=(BUNDLE, {**BUNDLE, "fields": {"a": "/b"}})),
    "outputs": (
        file({**APPROXIMATE, "bundle": BUNDLE}),
        file({**APPROXIMATE, "bundle": BUNDLE, "outputs": False}),
        outputs,
    ),
    "lazy": of_group(lambda config: config.groups[0].options.lazy, lazy=True),
    "manifest": of_group(own_topics, manifest=False),
    "qos": of_topic(of_first_topic("qos"), qos="sensor_data"),
    "stamp": of_topic(of_first_topic("stamp"), stamp="receive"),
    "clock": of_topic(host_time, clock="device"),
    "delay": of_topic(host_time, clock="device", delay="8ms"),
    "field": of_topic(of_first_topic("stamp"), stamp={"field": "header.stamp"}),
    "topics": of_topic(outputs, topic="/z"),
    "groups": (file(), file().replace("front", "back"), outputs),
    "name": of_node("name", "z"),
    "namespace": of_node("namespace", "/z"),
    "transport": of_node("transport", "large_messages"),
    "services": of_node("services", value=False),
    "lifecycle": of_node("lifecycle", value=True),
    "use_sim_time": of_node("use_sim_time", value=True),
    "node": of_section(lambda config: config.node, node={"name": "z"}),
    "metrics": of_section(lambda config: config.listen, metrics=None),
    "listen": of_section(lambda config: config.listen, metrics={"listen": "0.0.0.0:80"}),
    "hosts": of_section(lambda config: config.listen and config.listen.hosts, metrics={"hosts": ["robot"]}),
    "hosts: beside listen": of_section(
        lambda config: config.listen and config.listen.hosts, metrics={"listen": "0.0.0.0:80", "hosts": ["robot"]}
    ),
    "ready": of_section(lambda config: config.listen and config.listen.ready_share, metrics={"ready": {"share": 0.8}}),
    "share": of_section(lambda config: config.listen and config.listen.ready_share, metrics={"ready": {"share": 0.5}}),
    "diagnostics": of_section(lambda config: config.diagnostics, diagnostics=None),
    "scalars": of_section(lambda config: config.diagnostics, diagnostics={"scalars": True}),
    "defaults": of_section(outputs, defaults={"output_prefix": "/z"}),
}
LEROBOT: dict[str, Any] = {"fps": 10, "task": "pick", "features": {"action": "/a:height"}}


def _of_two_groups(group: str) -> str:
    """A file of which one group's sets become a LeRobotDataset."""
    groups = {name: json.loads(file())["groups"]["front"] for name in ("front", "back")}
    return json.dumps({"version": 1, "groups": groups, "export": {"lerobot": LEROBOT | {"group": group}}})


_OF_LEROBOT: dict[str, dict[str, Any]] = {
    "fps": {"fps": 20},
    "task": {"task": "place"},
    "max_gap": {"max_gap": "3s"},
    "incomplete": {"incomplete": "keep"},
    "features": {"features": {"action": "/b:height"}},
}
OPTIONS |= {
    key: (file(export={"lerobot": LEROBOT}), file(export={"lerobot": LEROBOT | keys}), lambda config: config.lerobot)
    for key, keys in _OF_LEROBOT.items()
}
OPTIONS["max_gap: longer"] = (
    file(export={"lerobot": LEROBOT | {"max_gap": "2s"}}),
    file(export={"lerobot": LEROBOT | {"max_gap": "3s"}}),
    lambda config: config.lerobot,
)
OPTIONS |= dict.fromkeys(("export", "lerobot"), of_section(lambda config: config.lerobot, export={"lerobot": LEROBOT}))
OPTIONS["group"] = (_of_two_groups("front"), _of_two_groups("back"), lambda config: config.lerobot)
QOS_POLICIES = {
    "history": "keep_all",
    "depth": 5,
    "reliability": "best_effort",
    "durability": "volatile",
    "deadline": "1s",
    "lifespan": 1,
    "liveliness": "automatic",
    "liveliness_lease_duration": {"sec": 1, "nsec": 0},
}
OPTIONS |= {key: of_topic(of_first_topic("qos"), qos={key: value}) for key, value in QOS_POLICIES.items()}


@pytest.mark.parametrize(("one", "other", "outcome"), OPTIONS.values(), ids=OPTIONS)
def test_changing_an_option_changes_what_comes_out(one, other, outcome, environ):
    assert outcome(load_text(one, environ=environ)) != outcome(load_text(other, environ=environ))


def test_every_key_of_the_file_is_an_option_under_test():
    keys = {key for model in models_of(file_format().file) for key in model.model_fields}
    assert keys - OPTIONS.keys() == {"version"}


@pytest.mark.parametrize(("key", "field"), file_format().defaults.model_fields.items())
def test_a_default_counts_where_the_group_is_silent_and_only_there(key, field, environ):
    one, other, outcome = OPTIONS[key]
    expected = outcome(load_text(other, environ=environ))
    group = json.loads(other)["groups"]["front"]
    unlike = field.examples[0] if field.examples else "equal_key" if key == "policy" else not group[key]
    overruled = file(group, defaults={key: unlike})
    assert outcome(load_text(overruled, environ=environ)) == expected
    silent = {name: value for name, value in group.items() if name != key}
    assert outcome(load_text(file(silent, defaults={key: group[key]}), environ=environ)) == expected
    assert expected != outcome(load_text(one, environ=environ))
