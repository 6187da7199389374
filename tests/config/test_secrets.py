"""What variables are filled in with is in no problem, note or difference: what the file has stands there instead.

Any value of any file there is takes a variable here, whose value fits or does not.
"""

import json
import random
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from syncrelay.config import Config, ConfigError, load_text, render
from syncrelay.config.annotations import problem_as_json, problem_command
from syncrelay.config.difference import difference
from syncrelay.recordings.cases.load import load_suite_text
from tests.config.test_schema import Yaml12Loader
from tests.faults.extent import chosen

_HERE = Path(__file__).parent
_FILES = [*sorted((_HERE / "valid").glob("*.yaml")), *sorted((_HERE.parents[1] / "configs").glob("*.yaml"))]
_TESTS = sorted((_HERE.parents[1] / "configs/tests").glob("*.yaml"))
_LETTERS = "bcdfghjklmnpqrstvwxz"
# What a variable holds, and what the file has round it. `#` is the secret.
_VALUES = (
    *("#", "/#", "~/#", "#/msg/Image", "sensor_msgs/msg/#", "my_#/msg/#", "/a/#:header", "/a:#", "header.#", "#.stamp"),
    *("1#", "p@ss #!", "#ms", "x: [#]", "#\x1b[31m\n#", "a" * 50 + "#" * 9, "#:9464", "#.example", "-#-", "`#`", "#…"),
)
_ROUND = ("{}", "{}", "{}", "/{}", "x_{}", "{}/b", "{}:data", "sensor_msgs/msg/{}", "{} Hz", "{}{}")
_DRAWN = chosen(short=100, long=30_000)
_SHOWN = 6
"""So many letters of a secret in a row are no accident."""


class _Case:
    """A file with variables in some of its values, and an environment."""

    def __init__(self, chance: random.Random, files: Sequence[Path] = _FILES) -> None:
        self.chance = chance
        self.secrets: list[str] = []
        self.environ: dict[str, str] = {}
        self.path = chance.choice(files)
        keys = yaml.load(self.path.read_text(), Loader=Yaml12Loader)  # noqa: S506  a SafeLoader
        self.whole = json.dumps(keys)
        places = list(_scalars(keys))
        for holder, key in chance.sample(places, min(len(places), chance.randint(1, 4))):
            holder[key] = self._variable(holder[key])
        self.text = json.dumps(keys, indent=1)

    def _variable(self, value: Any) -> str:
        name = f"V{len(self.environ)}"
        if self.chance.random() < 0.2:
            secret = "".join(self.chance.choices("123456789", k=self.chance.choice((9, 12, 30))))
            self.environ[name] = secret
        elif self.chance.random() < 0.2:
            # It fits, and is no secret: others then say what is wrong.
            self.environ[name] = str(value)
            return f"${{{name}}}"
        else:
            secret = "".join(self.chance.choices(_LETTERS, k=12))
            self.environ[name] = self.chance.choice(_VALUES).replace("#", secret)
        self.secrets.append(secret)
        return self.chance.choice(_ROUND).format(*[f"${{{name}}}"] * 2)

    def shown(self, text: str) -> str | None:
        """What of a secret is in a text."""
        text = text.lower()
        parts = (each[at : at + _SHOWN] for each in self.secrets for at in range(len(each) - _SHOWN + 1))
        return next((part for part in parts if part in text), None)


def _scalars(node: Any) -> Iterator[tuple[Any, Any]]:
    """Every value of a tree that is neither mapping nor list, as what holds it and the key."""
    for key, value in list(node.items()) if isinstance(node, dict) else list(enumerate(node)):
        if isinstance(value, dict | list):
            yield from _scalars(value)
        else:
            yield node, key


def _told_of(error: ConfigError) -> str:
    """All that commands, the log and HTTP make of problems."""
    made = [json.dumps(problem_as_json(each)) + problem_command(each) + each.subject for each in error.problems]
    return "\n".join([str(error), error.outline, render(error.problems, colour=True), *made])


def _loaded(text: str, environ: dict[str, str]) -> Config | ConfigError:
    try:
        return load_text(text, environ=environ)
    except ConfigError as error:
        return error


@pytest.mark.faults
def test_no_problem_note_or_difference_shows_what_a_variable_holds(environ):
    refused = taken = 0
    for seed in range(_DRAWN):
        case = _Case(random.Random(seed))
        config = _loaded(case.text, {**environ, **case.environ})
        if isinstance(config, ConfigError):
            refused += 1
            assert case.shown(_told_of(config)) is None, (seed, case.shown(_told_of(config)), str(config))
            continue
        taken += 1
        assert case.shown(render(config.notes)) is None, (seed, render(config.notes))
        # Remaps that make all names meet have all of them quoted.
        meeting = config.names.problems(lambda _: "/same", groups=[group.name for group in config.groups])
        assert case.shown(render(meeting)) is None, (seed, render(meeting))
        whole = _loaded(case.whole, environ)
        if isinstance(whole, ConfigError):
            # It names a type that only another value could mend.
            continue
        changes = difference(whole, config)
        written = [each.new for each in changes.sections]
        written += [each.new for group in changes.groups for each in group.keys if each.key not in ("output", "type")]
        assert case.shown(" ".join(filter(None, written))) is None, (seed, written)
    assert refused > _DRAWN / 3
    assert taken > _DRAWN / 15


@pytest.mark.faults
def test_no_problem_of_a_test_file_shows_what_a_variable_holds(environ):
    refused = 0
    for seed in range(_DRAWN // 4):
        case = _Case(random.Random(seed), _TESTS)
        told = ""
        try:
            load_suite_text(case.text, name=str(case.path), environ={**environ, **case.environ})
        except ConfigError as error:
            told = _told_of(error)
        refused += bool(told)
        assert case.shown(told) is None, (seed, case.shown(told), told)
    assert refused > _DRAWN / 8
