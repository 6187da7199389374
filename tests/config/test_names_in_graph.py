"""Names as they are in the graph, with remaps and without: a file is refused for those that meet and for no others."""

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest

from syncrelay.config import Config, ConfigError, Problem, QosPreset, load, load_text
from syncrelay.config.names import expand
from tests.faults.extent import chosen

_IMAGE = "sensor_msgs/msg/Image"
_NAMES = ("/a", "/b", "/c", "a", "b", "~/a", "/f/a", "/g/a", "/out")
_SEEDS = range(chosen(short=100, long=4000))


def _file(groups: dict[str, dict[str, Any]], **top: Any) -> str:
    return json.dumps({"version": 1, **top, "groups": groups}, indent=1)


def _group(*topics: dict[str, Any], **keys: Any) -> dict[str, Any]:
    return {"policy": "exact_time", **keys, "topics": [{"type": _IMAGE, **topic} for topic in topics]}


def _drawn(chance: random.Random) -> dict[str, dict[str, Any]]:
    """One or two groups of few names; some topics have another type or QoS, or an output."""

    def maybe(likelihood: float, **keys: tuple[Any, ...]) -> dict[str, Any]:
        return {key: chance.choice(values) for key, values in keys.items() if chance.random() < likelihood}

    def topic(name: str) -> dict[str, Any]:
        rare = maybe(0.05, type=("sensor_msgs/msg/Imu",), qos=("sensor_data",))
        return {"topic": name, **rare, **maybe(0.3, output=_NAMES)}

    return {
        name: _group(
            *(topic(each) for each in chance.sample(_NAMES, chance.randint(2, 3))),
            **maybe(0.3, output_prefix=("", "/", "~", "/x", "x", "/f")),
        )
        for name in ("f", "g")[: chance.randint(1, 2)]
    }


def _problems(text: str) -> tuple[Problem, ...]:
    try:
        return load_text(text, environ={}).notes
    except ConfigError as error:
        return error.problems


def _names_of(groups: dict[str, Any], *, of: str, namespace: str = "") -> list[tuple[str, str]]:
    """The inputs or outputs of a file as README says that they are named, each with its group."""
    named = []
    for group, keys in groups.items():
        for topic in keys["topics"]:
            below = topic["topic"].removeprefix("~").removeprefix("/")
            prefix = keys.get("output_prefix", f"{topic['topic'].removesuffix(below)}{group}")
            default = topic["topic"] if prefix == "" else f"{prefix.rstrip('/')}/{below}"
            name = topic["topic"] if of == "topic" else topic.get("output", default)
            if name.startswith("~"):
                name = f"{namespace}/syncrelay{name[1:]}"
            named.append((group, name if name.startswith("/") else f"{namespace}/{name}"))
    return named


def _meet(groups: dict[str, Any], *, namespace: str) -> bool:
    inputs, outputs = (_names_of(groups, of=of, namespace=namespace) for of in ("topic", "output"))
    topics = [topic for keys in groups.values() for topic in keys["topics"]]
    asked = {(name, each["type"], each.get("qos")) for (_, name), each in zip(inputs, topics, strict=True)}
    received, published = {name for _, name in inputs}, {name for _, name in outputs}
    is_twice = len(set(inputs)) < len(inputs) or len(published) < len(outputs) or len(asked) > len(received)
    return is_twice or bool(received & published)


def test_a_file_is_refused_for_names_that_meet_in_the_relay_and_for_no_others():
    refused = 0
    for seed in _SEEDS:
        chance = random.Random(seed)
        groups, namespace = _drawn(chance), chance.choice(("", "/robot"))
        text = _file(groups, node={"namespace": namespace}, diagnostics=None)
        if _meet(groups, namespace=namespace):
            refused += 1
            with pytest.raises(ConfigError):
                load_text(text, environ={})
            continue
        config = load_text(text, environ={})
        outputs = [config.node.absolute(topic.output) for group in config.groups for topic in group.topics]
        assert outputs == [name for _, name in _names_of(groups, of="output", namespace=namespace)]
        inputs = [name for group in config.groups for name in group.inputs.names]
        assert inputs == [name for _, name in _names_of(groups, of="topic", namespace=namespace)]
    assert len(_SEEDS) / 10 < refused < len(_SEEDS) * 0.9


def test_groups_have_in_files_of_their_own_the_problems_that_they_have_in_one(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = re.compile(r"line \d+( of g.yaml| of f.yaml)?")
    refused = 0
    for seed in _SEEDS:
        groups = _drawn(random.Random(seed))
        for name, group in groups.items():
            Path(f"{name}.yaml").write_text(_file({name: group}))
        problems: tuple[Problem, ...] = ()
        try:
            load(*(f"{name}.yaml" for name in groups), environ={})
        except ConfigError as error:
            problems = error.problems
            refused += 1
        found, expected = (
            sorted((each.path, line.sub("line", each.text)) for each in those if each.code != "not_checked")
            for those in (problems, _problems(_file(groups)))
        )
        assert found == expected, seed
    assert len(_SEEDS) / 10 < refused < len(_SEEDS) * 0.9


class _Remaps:
    """What rcl makes of names: expanded in the node's namespace, then replaced where a rule names them."""

    def __init__(self, chance: random.Random) -> None:
        self._namespace = chance.choice(["", "", "/robot"])
        names = [self._expanded(name) for name in _NAMES] + ["/f/b", "/g/b", "/f/c"]
        targets = [*names, "/rosout", "/diagnostics"]
        self._rules = {chance.choice(names): chance.choice(targets) for _ in range(chance.randint(1, 5))}

    def __call__(self, name: str) -> str:
        return self._rules.get(self._expanded(name), self._expanded(name))

    def _expanded(self, name: str) -> str:
        return expand(name, node="syncrelay", namespace=self._namespace)


def _under(config: Config, remaps: _Remaps) -> str:
    """The file that has of itself the names that remaps make of those of another."""
    return _file(
        {
            group.name: _group(
                *(
                    {"topic": remaps(topic.topic), "type": topic.type, "output": remaps(topic.output)}
                    | ({"qos": topic.qos.name} if isinstance(topic.qos, QosPreset) else {})
                    for topic in group.topics
                )
            )
            for group in config.groups
        }
    )


def _faults(problems: tuple[Problem, ...]) -> list[tuple[str, str]]:
    """The kinds of errors with their topics; which of a topic's keys a name comes from differs."""
    return sorted((problem.code, problem.path.rpartition(".")[0]) for problem in problems if problem.span)


def test_remaps_have_the_errors_of_a_file_that_has_their_names():
    taken = refused = 0
    for seed in _SEEDS:
        chance = random.Random(seed)
        groups = _drawn(chance)
        if _meet(groups, namespace=""):
            continue
        config, remaps = load_text(_file(groups), environ={}), _Remaps(chance)
        expected = _faults(_problems(_under(config, remaps)))
        assert _faults(config.names.problems(remaps, groups=list(groups))) == expected, seed
        taken, refused = taken + (not expected), refused + bool(expected)
    assert min(taken, refused) > len(_SEEDS) / 14


_AB_AND_CB = {
    name: _group({"topic": first}, {"topic": "/b"}, output_prefix=f"/{name}")
    for name, first in (("f", "/a"), ("g", "/c"))
}


_LOOP = "which makes a loop: choose another `output`"
_OWN = "is a topic that the node itself uses for"
_OF_MANIFEST = "remap it to another name, or set `manifest: false`"


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        ({"/f/a": "/a"}, f"the default output `/a`, remapped from `/f/a`, is also an input (line 10), {_LOOP}"),
        ({"/a": "/f/a"}, f"the default output `/f/a` is also an input (line 10, remapped from `/a`), {_LOOP}"),
        ({"/a": "/b"}, "`/b` is in this group twice, first on line 10, remapped from `/a`"),
        (
            {"/f/a": "/f/b"},
            "the default output `/f/b` is already used on line 10, remapped from `/f/a`: choose another `output`",
        ),
        (
            {"~/f/sets": "/diagnostics"},
            f"its manifest `/diagnostics`, remapped from `/syncrelay/f/sets`, {_OWN} its diagnostics: {_OF_MANIFEST}",
        ),
        (
            {"~/g/sets": "/n", "~/f/sets": "/n"},
            f"its manifest `/n`, remapped from `/syncrelay/g/sets`, {_OWN} the manifest of the group f: {_OF_MANIFEST}",
        ),
        ({"~/f/sets": "/f/b"}, f"the output `/f/b` {_OWN} the manifest of the group f: choose another `output`"),
    ],
)
def test_a_name_that_a_remap_made_is_said_beside_the_one_in_the_file(rules, sentence):
    config = load_text(_file(_AB_AND_CB), environ={})
    (problem,) = config.names.problems(lambda name: rules.get(name, config.node.absolute(name)), groups=["f", "g"])
    assert problem.text == sentence


def test_what_another_process_runs_has_names_of_its_own():
    names = load_text(_file(_AB_AND_CB), environ={}).names
    remaps = {"/f/a": "/g/c"}
    assert names.problems(lambda name: remaps.get(name, name), groups=["f", "g"])
    assert names.problems(lambda name: remaps.get(name, name), groups=["f"]) == ()


_FIGURE = {"topic": "/a", "output": "/syncrelay/f/span_ms"}
_LOG = {"topic": "/rosout", "type": "rcl_interfaces/msg/Log", "stamp": {"field": "stamp"}}
_SHOWN = {"scalars": True}


@pytest.mark.parametrize(
    ("topic", "refused", "other", "allowed"),
    [
        ({"topic": "/a", "output": "/diagnostics"}, {}, {}, {"diagnostics": None}),
        (_FIGURE, {"diagnostics": _SHOWN}, {}, {"diagnostics": {}}),
        (_FIGURE, {"diagnostics": _SHOWN}, {}, {"diagnostics": _SHOWN, "node": {"namespace": "/robot"}}),
        ({"topic": "/a", "output": "~/transition_event"}, {"node": {"lifecycle": True}}, {}, {}),
        ({"topic": "/rosout"}, {}, _LOG, {}),
        ({"topic": "/syncrelay/f/sets", "type": "diagnostic_msgs/msg/DiagnosticArray"}, {}, {"topic": "/sets"}, {}),
    ],
    ids=["diagnostics", "figures", "figures of another node", "transitions", "log of its type", "manifest"],
)
def test_a_topic_is_the_nodes_own_only_where_the_node_uses_it(topic, refused, other, allowed):
    def codes(topic: dict[str, Any], top: dict[str, Any]) -> set[str]:
        group = _group(topic, {"topic": "/b"})
        return {each.code for each in _problems(_file({"f": group}, **top))} - {"not_checked"}

    assert codes(topic, refused) in ({"own_topic"}, {"conflict"}, {"loop"})
    assert codes({**topic, **other}, allowed) == set()


def test_a_manifest_is_no_input_of_its_own_node_though_no_type_is_written():
    untyped = {"policy": "exact_time", "topics": [{"topic": "/syncrelay/f/sets"}, {"topic": "/b", "type": _IMAGE}]}
    assert "loop" in {each.code for each in _problems(_file({"f": untyped}))}
