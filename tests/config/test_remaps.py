"""Names after remaps: whatever is wrong with them is what would be wrong with a file that had these names."""

import json
import random
from collections.abc import Iterator
from typing import Any

import pytest

from syncrelay.config import Config, ConfigError, Problem, load_text
from syncrelay.config.names import expand

_IMAGE = "sensor_msgs/msg/Image"
_NAMES = ("/a", "/b", "/c", "a", "b", "~/a", "/f/a", "/g/a", "/out")
_SEEDS = range(200)


def _file(groups: dict[str, list[dict[str, Any]]]) -> str:
    as_written = {name: {"policy": "exact_time", "topics": topics} for name, topics in groups.items()}
    return json.dumps({"version": 1, "groups": as_written}, indent=1)


def _groups(chance: random.Random) -> dict[str, list[dict[str, Any]]]:
    return {
        name: [_topic(topic, chance) for topic in chance.sample(_NAMES, chance.randint(2, 3))]
        for name in ("f", "g")[: chance.randint(1, 2)]
    }


def _topic(topic: str, chance: random.Random) -> dict[str, Any]:
    output = {"output": chance.choice(_NAMES)} if chance.random() < 0.3 else {}
    type_name = chance.choice([_IMAGE] * 9 + ["sensor_msgs/msg/Imu"])
    return {"topic": topic, "type": type_name, **output}


class _Remaps:
    """What rcl makes of names: expanded in the node's namespace, then replaced where a rule names them."""

    def __init__(self, chance: random.Random) -> None:
        self._namespace = chance.choice(["", "", "/robot"])
        names = [self._expanded(name) for name in _NAMES] + ["/f/b", "/g/b", "/f/c"]
        targets = [*names, "/rosout", "/diagnostics"]
        self._rules = {chance.choice(names): chance.choice(targets) for _ in range(chance.randint(0, 3))}

    def __call__(self, name: str) -> str:
        return self._rules.get(self._expanded(name), self._expanded(name))

    def _expanded(self, name: str) -> str:
        return expand(name, node="syncrelay", namespace=self._namespace)


def _loaded(chance: random.Random) -> Config:
    while True:
        try:
            return load_text(_file(_groups(chance)), environ={})
        except ConfigError:
            continue


def _under(config: Config, remaps: _Remaps) -> str:
    """The file that has of itself the names that remaps make of those of another."""
    return _file(
        {
            group.name: [
                {"topic": remaps(topic.topic), "type": topic.type, "output": remaps(topic.output)}
                for topic in group.topics
            ]
            for group in config.groups
        }
    )


def _faults(problems: tuple[Problem, ...]) -> list[tuple[str, str]]:
    """The kinds of errors with their topics; which of a topic's keys a name comes from differs."""
    return sorted((problem.code, problem.path.rpartition(".")[0]) for problem in problems if problem.span)


def _faults_of_file(text: str) -> list[tuple[str, str]]:
    try:
        return _faults(load_text(text, environ={}).notes)
    except ConfigError as error:
        return _faults(error.problems)


def _cases() -> Iterator[tuple[Config, _Remaps]]:
    for seed in _SEEDS:
        chance = random.Random(seed)
        yield _loaded(chance), _Remaps(chance)


def _all_groups(config: Config) -> list[str]:
    return [group.name for group in config.groups]


def test_remaps_have_the_errors_of_a_file_that_has_their_names():
    refused = 0
    for config, remaps in _cases():
        found = config.names.problems(remaps, groups=_all_groups(config))
        expected = _faults_of_file(_under(config, remaps))
        refused += bool(expected)
        assert _faults(found) == expected
    # Neither all nor none: both sides have been seen.
    assert len(_SEEDS) // 10 < refused < len(_SEEDS) // 2


def test_what_remaps_leave_in_order_has_no_loop_and_no_name_twice():
    for config, remaps in _cases():
        if config.names.problems(remaps, groups=_all_groups(config)):
            continue
        topics = [topic for group in config.groups for topic in group.topics]
        outputs = [remaps(topic.output) for topic in topics]
        assert len(set(outputs)) == len(outputs)
        assert not set(outputs) & {remaps(topic.topic) for topic in topics}
        for group in config.groups:
            assert len({remaps(topic.topic) for topic in group.topics}) == len(group.topics)


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        (
            {"/f/a": "/a"},
            (
                "the default output `/a`, remapped from `/f/a`, is also an input (line 8), which makes a loop:"
                " choose another `output`"
            ),
        ),
        (
            {"/a": "/f/a"},
            (
                "the default output `/f/a` is also an input (line 8, remapped from `/a`), which makes a loop:"
                " choose another `output`"
            ),
        ),
        ({"/a": "/b"}, "`/b` is in this group twice, first on line 8, remapped from `/a`"),
        (
            {"/f/a": "/f/b"},
            "the default output `/f/b` is already used on line 8, remapped from `/f/a`: choose another `output`",
        ),
    ],
)
def test_a_name_that_a_remap_made_is_said_beside_the_one_in_the_file(rules, sentence):
    config = load_text(_file({"f": [{"topic": "/a", "type": _IMAGE}, {"topic": "/b", "type": _IMAGE}]}), environ={})
    (problem,) = config.names.problems(lambda name: rules.get(name, name), groups=["f"])
    assert problem.text == sentence


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        (
            {"~/f/sets": "/diagnostics"},
            (
                "its manifest `/diagnostics`, remapped from `/syncrelay/f/sets`, is a topic that the node itself uses"
                " for its diagnostics: remap it to another name, or set `manifest: false`"
            ),
        ),
        (
            {"~/g/sets": "/same", "~/f/sets": "/same"},
            (
                "its manifest `/same`, remapped from `/syncrelay/g/sets`, is a topic that the node itself uses for the"
                " manifest of the group f: remap it to another name, or set `manifest: false`"
            ),
        ),
        (
            {"~/f/sets": "/f/b"},
            (
                "the output `/f/b` is a topic that the node itself uses for the manifest of the group f: choose"
                " another `output`"
            ),
        ),
    ],
)
def test_a_manifest_that_a_remap_gives_a_name_of_something_else_is_refused(rules, sentence):
    groups = {name: [{"topic": f"/{name}1", "type": _IMAGE}, {"topic": "/b", "type": _IMAGE}] for name in "fg"}
    config = load_text(_file(groups), environ={})
    (problem,) = config.names.problems(lambda name: rules.get(name, config.node.absolute(name)), groups=["f", "g"])
    assert (problem.code, problem.text) == ("own_topic", sentence)


def test_what_another_process_runs_has_names_of_its_own():
    groups = {name: [{"topic": f"/{name}1", "type": _IMAGE}, {"topic": "/b", "type": _IMAGE}] for name in "fg"}
    config = load_text(_file(groups), environ={})
    remaps = {"/f/f1": "/g/g1"}
    assert config.names.problems(lambda name: remaps.get(name, name), groups=["f", "g"])
    assert config.names.problems(lambda name: remaps.get(name, name), groups=["f"]) == ()
