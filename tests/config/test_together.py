"""Several files as one: the same rules between them as within one, and what is wrong told by file and line."""

import json
import random
from pathlib import Path

import pytest

from syncrelay.config import Config, ConfigError, load
from tests.drawn_files import any_file, parts_of

_TOPIC = "      - {{topic: {topic}, type: sensor_msgs/msg/Image}}\n"


def group(name: str, *topics: str, keys: str = "") -> str:
    """A group of a file, with its keys in a line above its topics."""
    listed = "".join(_TOPIC.format(topic=topic) for topic in topics)
    return f"  {name}:\n    policy: exact_time\n{keys and f'    {keys}'}{keys and chr(10)}    topics:\n{listed}"


def file(*groups: str, top: str = "") -> str:
    return f"version: 1\n{top}groups:\n{''.join(groups)}"


FRONT = file(group("front", "/a", "/b"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def together(environ: dict[str, str], **texts: str) -> Config:
    """Load texts as the files one.yaml, two.yaml and so on."""
    for name, text in texts.items():
        Path(f"{name}.yaml").write_text(text)
    return load(*(f"{name}.yaml" for name in texts), environ=environ)


def errors(environ: dict[str, str], **texts: str) -> list[str]:
    """What is wrong with files together, a line each."""
    with pytest.raises(ConfigError) as raised:
        together(environ, **texts)
    places = [(each.file, each.span.line if each.span else 0) for each in raised.value.problems]
    assert places == sorted(places, key=lambda place: (list(texts).index(place[0].removesuffix(".yaml")), place[1]))
    return [line for line in str(raised.value).splitlines() if not line.startswith("  ")]


@pytest.mark.parametrize("seed", range(20))
def test_any_file_is_what_its_parts_are_together(seed: int):
    chance = random.Random(seed)
    keys, whole = any_file(chance)
    texts = parts_of(keys, chance)
    parts = together({}, **{f"part{number}": text for number, text in enumerate(texts)})
    assert [each.name for each in parts.groups] == [
        name for text in texts for name in json.loads(text).get("groups", {})
    ]
    assert {each.name: each for each in parts.groups} == {each.name: each for each in whole.groups}
    assert (parts.node, parts.listen, parts.diagnostics) == (whole.node, whole.listen, whole.diagnostics)


@pytest.mark.parametrize("key", ["node: {}", "metrics: null", "diagnostics: {}"])
def test_what_there_is_once_is_refused_twice_with_both_places(key, environ):
    name = key.partition(":")[0]
    assert errors(environ, one=f"{FRONT}{key}\n", two=file(group("rear", "/c", "/d"), top=f"{key}\n")) == [
        f"two.yaml:2:1: {name}: `{name}` is also on line 8 of one.yaml: files that run together may have it only once"
    ]


def test_one_name_of_two_groups_is_refused_with_both_places(environ):
    assert errors(environ, one=FRONT, two=file(group("rear", "/c", "/d"), group("front", "/c", "/d"))) == [
        "two.yaml:8:3: groups.front: the group `front` is also on line 3 of one.yaml: rename one of them"
    ]


def test_defaults_without_a_group_are_refused(environ):
    assert errors(environ, one="version: 1\ndefaults: {queue_size: 5}\n", two=FRONT) == [
        "one.yaml:2:1: defaults: `defaults` apply to groups of the same file, and this file has none"
    ]
