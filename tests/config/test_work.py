"""Reading a file of any shape takes work in proportion to its size, counted in calls."""

from collections.abc import Callable, Sequence
from difflib import get_close_matches

import pytest

from syncrelay.config import ConfigError, Problem, load_text
from tests.calls import Calls
from tests.faults.extent import chosen

_SIZES = chosen(short=(150, 300), long=(300, 600))
_TOPICS = "{policy: exact_time, topics: ["
_TOPIC = "{topic: /a, type: sensor_msgs/msg/Image"

# Each names what there is n of. What is many is what a person, a script or an enemy may write.
_SHAPES: dict[str, Callable[[int], str]] = {
    "unknown keys of the file": lambda n: "".join(f"k{i}: 1\n" for i in range(n)),
    "keys of the file misspelt": lambda n: "".join(f"group{i}: 1\n" for i in range(n)),
    "unknown keys of a topic": lambda n: _file(f"{_TOPICS}{_TOPIC}{''.join(f', k{i}: 1' for i in range(n))}}}]}}"),
    "unknown keys of defaults": lambda n: f"defaults: {{{''.join(f'k{i}: 1, ' for i in range(n))}}}\n",
    "keys that are here twice": lambda n: f"{{{'a: 1, ' * n}}}",
    "keys of another level": lambda n: _file(f"{_TOPICS}{'{slop: 1}, ' * n}]}}"),
    "groups without a key": lambda n: _file(*["{}"] * n),
    "groups in order": lambda n: _file(*[f"{_TOPICS}{_TOPIC}}}, {_TOPIC.replace('/a', '/b')}}}]}}"] * n),
    "policies misspelt": lambda n: _file(*(f"{{policy: exact_tim{i}}}" for i in range(n))),
    "names that are refused": lambda n: f"groups: {{{''.join(f'g-{i}: 1, ' for i in range(n))}}}",
    "topics in order": lambda n: _file(_TOPICS + "".join(f"{_TOPIC}{i}}}, " for i in range(n)) + "]}"),
    "topics of one name": lambda n: _file(f"{_TOPICS}{f'{_TOPIC}}}, ' * n}]}}"),
    "messages misspelt": lambda n: _file(_TOPICS + "".join(f"{_TOPIC}{i}}}, " for i in range(n)) + "]}"),
    "packages misspelt": lambda n: _file(
        _TOPICS + "".join(f"{{topic: /t{i}, type: sensor_msg{i}/msg/Image}}, " for i in range(n)) + "]}"
    ),
    "aliases of a topic": lambda n: f"a: &a {{topc: /a, typ: x}}\n{_file(_TOPICS + '*a , ' * n + ']}')}",
    "aliases of a list": lambda n: f"a: &a [{'1, ' * 100}]\nb: [{'*a , ' * n}]\n",
    "aliases of a long text": lambda n: (
        f"a: &a {'x' * 5 * n}\n{_file(_TOPICS + '{topic: *a , type: *a }, ' * n + ']}')}"
    ),
    "merges of a topic": lambda n: f"x-a: &a {{topc: /a, typ: x}}\n{_file(_TOPICS + '{<<: *a }, ' * n + ']}')}",
    "merges of a list": lambda n: f"x-a: &a {{a: 1, b: 2}}\nb: {{<<: [{'*a , ' * n}]}}\n",
    "merges of many keys": lambda n: f"x-a: &a {{{''.join(f'k{i}: 1, ' for i in range(n))}}}\nb: {{<<: [*a , *a ]}}\n",
    "merges one twice": lambda n: f"x-a: &a {{a: 1}}\nb: {{{'<<: *a , ' * n}}}\n",
    "keys of the user's own": lambda n: "".join(f"x-{i}: 1\n" for i in range(n)),
    "groups with a long default": lambda n: f"defaults: {{restamp: {'x' * 5 * n}}}\n{_file(*['{}'] * n)}",
    "groups with a default of many": lambda n: f"defaults: {{restamp: [{'1, ' * n}]}}\n{_file(*['{}'] * n)}",
    "faults below a long key": lambda n: f"groups:\n  ? {'x' * 5 * n}\n  : {{{'a: 1, ' * n}}}\n",
    "faults at a deep place": lambda n: "{kkkkkkkkkkkk: " * 45 + f"{{{'a: 1, ' * n}}}" + "}" * 45,
    "variables that are not set": lambda n: "".join(f"k{i}: ${{NOT_SET_{i}}}\n" for i in range(n)),
    "dollars": lambda n: f"a: '{'${' * n}'\n",
    "brackets": lambda n: "[" * n,
    "items where a key belongs": lambda n: "- a\n" * n + "b: 1\n",
    "digits": lambda n: _file(f"{{policy: approximate_time, slop: {'9' * n}}}"),
}


def _file(*groups: str) -> str:
    return "version: 1\ngroups:\n" + "".join(f"  g{number}: {group}\n" for number, group in enumerate(groups))


def _read(text: str, environ: dict[str, str]) -> Sequence[Problem]:
    try:
        return load_text(text, environ=environ).notes
    except ConfigError as error:
        return error.problems


def _work(text: str, environ: dict[str, str]) -> int:
    """How many calls are made while a text is read, and how many characters of errors come of it."""
    with Calls() as calls:
        problems = _read(text, environ)
    return calls.count + sum(len(problem.path) + len(problem.text) for problem in problems)


@pytest.mark.parametrize("shape", _SHAPES.values(), ids=_SHAPES)
@pytest.mark.long
def test_twice_as_much_of_anything_takes_about_twice_the_work(shape: Callable[[int], str], environ):
    once, twice = (_work(shape(n), environ) for n in _SIZES)
    # What is quadratic comes to nearly 4.
    assert twice < 2.5 * once


@pytest.mark.long
def test_a_valid_word_is_looked_for_only_as_often_as_somebody_may_read_of_it(environ):
    with Calls(get_close_matches) as looked:
        problems = _read(_SHAPES["packages misspelt"](1100), environ)
    assert looked.count == 1000 < len(problems)


def test_of_the_first_thousand_misspelt_keys_each_is_told_what_was_meant(environ):
    problems = _read(_SHAPES["keys of the file misspelt"](1100), environ)
    texts = [problem.text for problem in problems if problem.code == "unknown_key"]
    assert [text.endswith("did you mean `groups`?") for text in texts] == [True] * 1000 + [False] * 100
