"""No option without an effect: each is changed, and what comes out has to change with it."""

import json
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from syncrelay.config import Config, load_text
from syncrelay.config.file import file_format
from syncrelay.explain.dry_run import EngineDriver
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


def outputs(config: Config) -> object:
    return [topic.output for group in config.groups for topic in group.topics]


def own_topics(config: Config) -> object:
    """The names that the node must have for itself."""
    return config.names.written


def of_first_topic(name: str) -> Callable[[Config], object]:
    return lambda config: getattr(config.groups[0].topics[0], name)


NEAR_PAIRS = sets_of((0, 1), (1, 3), (0, 101), (1, 103), (0, 201), (1, 203))
WIDER_PAIRS = sets_of((0, 100), (1, 110), (0, 200), (1, 210), (0, 300), (1, 310))
ONE_INPUT_AHEAD = sets_of((0, 10), (0, 20), (1, 10))
TWO_SPANS_TO_CHOOSE_FROM = sets_of((0, 8), (1, 11), (0, 13), (0, 19))

EXACT_PAIRS = sets_of((0, 10), (1, 10), (0, 20), (1, 20), (0, 200), (1, 200))
BY_CLOCK = sets_by_clock((0, 10), (1, 20), (0, 40), (1, 45), (0, 190))
LATEST_OF_BOTH = sets_of((1, 10), (0, 100), (1, 110), (0, 120))
OPEN_PAIR = sets_after(50, (0, 100), (1, 101))

OPTIONS = {
    "policy": (file(), file(EXACT), NEAR_PAIRS),
    "queue_size": (file({**EXACT, "queue_size": 1}), file({**EXACT, "queue_size": 2}), ONE_INPUT_AHEAD),
    "slop": (file(), file({**APPROXIMATE, "slop": "5ms"}), WIDER_PAIRS),
    "age_penalty": (
        file({**APPROXIMATE, "age_penalty": 0}),
        file({**APPROXIMATE, "age_penalty": 1}),
        TWO_SPANS_TO_CHOOSE_FROM,
    ),
    "restamp": (file(), file({**APPROXIMATE, "restamp": "earliest"}), NEAR_PAIRS),
    "restamp: latest": (
        file({**APPROXIMATE, "restamp": "earliest"}),
        file({**APPROXIMATE, "restamp": "latest"}),
        NEAR_PAIRS,
    ),
    "restamp: input": (
        file({**APPROXIMATE, "restamp": "/a"}),
        file({**APPROXIMATE, "restamp": "/b"}),
        NEAR_PAIRS,
    ),
    "required": (
        file({**EXACT, "max_wait": 1}),
        file({**EXACT, "max_wait": 1}, first=OPTIONAL),
        sets_of((1, 10), (0, 20)),
    ),
    "max_wait": (
        file({**EXACT, "max_wait": "10ms"}, first=OPTIONAL),
        file({**EXACT, "max_wait": "1s"}, first=OPTIONAL),
        sets_after(50, (1, 100)),
    ),
    "max_wait: all required": (file(), file({**APPROXIMATE, "max_wait": "10ms"}), OPEN_PAIR),
    "max_rate": (file(EXACT), file({**EXACT, "max_rate": "10 Hz"}), EXACT_PAIRS),
    "every": (file(EXACT), file({**EXACT, "every": 2}), EXACT_PAIRS),
    "trigger": (file(LATEST), file({**LATEST, "trigger": "/b"}), LATEST_OF_BOTH),
    "trigger: a clock": (file({**LATEST, "trigger": "30 Hz"}), file({**LATEST, "trigger": 20}), BY_CLOCK),
    "max_wait: by a clock": (file(CLOCK), file({**CLOCK, "max_wait": "30ms"}), BY_CLOCK),
    "max_age: by a clock": (file(CLOCK), file({**CLOCK, "max_age": "20ms"}), BY_CLOCK),
    "restamp: trigger": (file(CLOCK), file({**CLOCK, "restamp": "trigger"}), BY_CLOCK),
    "restamp: trigger of an input": (
        file({**LATEST, "restamp": "earliest"}),
        file({**LATEST, "restamp": "trigger"}),
        LATEST_OF_BOTH,
    ),
    "max_age": (file(LATEST), file({**LATEST, "max_age": "50ms"}), LATEST_OF_BOTH),
    "max_age: own": (
        file({**LATEST, "trigger": "/b", "max_age": "1s"}),
        file({**LATEST, "trigger": "/b", "max_age": "1s"}, first={"max_age": "5ms"}),
        LATEST_OF_BOTH,
    ),
    "max_age: own, by a clock": (file(CLOCK), file(CLOCK, first={"max_age": "20ms"}), BY_CLOCK),
    "key": (file(KEYED), file({**KEYED, "key": "header.frame_id"}), of_first_topic("key")),
    "key: own": (file(KEYED), file(KEYED, first={"key": "header.stamp.sec"}), of_first_topic("key")),
    "offset": (file(EXACT), file(EXACT, first={"offset": "-50ms"}), sets_of((0, 150), (1, 100))),
    "min_period": (file(), file(first={"min_period": "90ms"}), sets_of((0, 14), (1, 15))),
    "topic": (file(), file(first={"topic": "/z"}), of_first_topic("topic")),
    "type": (file(), file(first={"type": "sensor_msgs/msg/Imu"}), of_first_topic("type")),
    "output": (file(), file(first={"output": "/z"}), outputs),
    "output_prefix": (file(), file({**APPROXIMATE, "output_prefix": "/z"}), outputs),
    "lazy": (file(), file({**APPROXIMATE, "lazy": True}), lambda config: config.groups[0].options.lazy),
    "manifest": (file(), file({**APPROXIMATE, "manifest": False}), own_topics),
    "qos": (file(), file(first={"qos": "sensor_data"}), of_first_topic("qos")),
    "stamp": (file(), file(first={"stamp": "receive"}), of_first_topic("stamp")),
    "field": (file(), file(first={"stamp": {"field": "header.stamp"}}), of_first_topic("stamp")),
    "topics": (file(), file(first={"topic": "/z"}), outputs),
    "groups": (file(), file().replace("front", "back"), outputs),
    "name": (file(), file(node={"name": "z"}), lambda config: config.node.name),
    "namespace": (file(), file(node={"namespace": "/z"}), lambda config: config.node.namespace),
    "transport": (file(), file(node={"transport": "large_messages"}), lambda config: config.node.transport),
    "services": (file(), file(node={"services": False}), lambda config: config.node.services),
    "coalesce": (file(), file(node={"coalesce": "1ms"}), lambda config: config.node.coalesce),
    "lifecycle": (file(), file(node={"lifecycle": True}), lambda config: config.node.lifecycle),
    "use_sim_time": (file(), file(node={"use_sim_time": True}), lambda config: config.node.use_sim_time),
    "node": (file(), file(node={"name": "z"}), lambda config: config.node),
    "metrics": (file(), file(metrics=None), lambda config: config.listen),
    "listen": (file(), file(metrics={"listen": "0.0.0.0:80"}), lambda config: config.listen),
    "hosts": (file(), file(metrics={"hosts": ["robot"]}), lambda config: config.listen),
    "hosts: beside listen": (
        file(metrics={"listen": "0.0.0.0:80"}),
        file(metrics={"listen": "0.0.0.0:80", "hosts": ["robot"]}),
        lambda config: config.listen,
    ),
    "diagnostics": (file(), file(diagnostics=None), lambda config: config.diagnostics),
    "scalars": (file(), file(diagnostics={"scalars": True}), lambda config: config.diagnostics),
    "defaults": (file(), file(defaults={"output_prefix": "/z"}), outputs),
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
OPTIONS |= {
    key: (file(), file(export={"lerobot": LEROBOT}), lambda config: config.lerobot) for key in ("export", "lerobot")
}
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
    "avoid_ros_namespace_conventions": True,
}
OPTIONS |= {
    key: (file(), file(first={"qos": {key: value}}), of_first_topic("qos")) for key, value in QOS_POLICIES.items()
}


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
