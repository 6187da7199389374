"""Whatever a file holds, reading it gives a configuration or says what is wrong with it, and does nothing else."""

import json
import random
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, load
from tests.faults.extent import chosen
from tests.faults.mutations import made_up, mutated

pytestmark = pytest.mark.faults

_EXAMPLES = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
_FILES = chosen(short=400, long=10_000)
_PARTS = 4
_MADE_UP = chosen(short=40, long=5000)
_PAIRS = chosen(short=20, long=2000)


def _mutated(number: int) -> list[bytes]:
    return [mutated(_EXAMPLES[number % len(_EXAMPLES)].read_bytes(), random.Random(number))]


def _made_up(number: int) -> list[bytes]:
    return [made_up(random.Random(number))]


def _pair(number: int) -> list[bytes]:
    """Two files that are read together, each as it should be, mutated or made up."""
    chance = random.Random(number)
    contents = [chance.choice(_EXAMPLES).read_bytes() for _ in range(2)]
    return [chance.choice((each, mutated(each, chance), made_up(chance))) for each in contents]


_KINDS = {
    **{f"fuzzed files, part {part + 1} of {_PARTS}": (_mutated, range(part, _FILES, _PARTS)) for part in range(_PARTS)},
    "documents made up of the file's own words": (_made_up, range(_MADE_UP)),
    "pairs of fuzzed files": (_pair, range(_PAIRS)),
}


@pytest.mark.timeout(chosen(short=600, long=1200))
@pytest.mark.parametrize("kind", _KINDS)
def test_files_of_any_content_are_in_order_or_an_error_that_says_where(kind: str, tmp_path: Path, figures):
    contents_of, numbers = _KINDS[kind]
    became: Counter[str] = Counter()
    for number in numbers:
        contents = contents_of(number)
        paths = [tmp_path / f"{place}.yaml" for place in range(len(contents))]
        for path, content in zip(paths, contents, strict=True):
            path.write_bytes(content)
        became[_loaded(*paths)] += 1
    assert became.keys() <= {"in order", "refused"}
    # Of documents made up, none need be in order.
    assert len(became) == 2 or contents_of is _made_up
    figures(f"{sum(became.values())} {kind}: {dict(became)}, nothing else")


def _loaded(*paths: Path) -> str:
    """What became of files; anything but a configuration or an error with words flies on, with their content."""
    try:
        config = load(*map(str, paths))
    except ConfigError as error:
        return "refused" if _says_where(error, paths) else "refused without a word"
    except Exception as error:
        error.add_note(repr([path.read_bytes() for path in paths]))
        raise
    # What is in order can be run: no number is too large for the engine.
    return "in order" if all(group.engine() for group in config.groups) else "without an engine"


def _says_where(error: ConfigError, paths: Sequence[Path]) -> bool:
    lines = {str(path): path.read_bytes().decode("utf-8", "replace") for path in paths}
    return bool(str(error)) and all(
        problem.text and problem.source in lines[problem.file] for problem in error.problems
    )


# What would run or read something, if whoever reads the file obeyed it.
_ORDERS = (
    "!!python/object/apply:os.system ['touch written']",
    "!!python/object/new:os.system ['touch written']",
    "!!python/name:os.system",
    "!!python/module:os",
    "!include /etc/hostname",
    "!ENV ${HOME}",
    "{$ref: /etc/hostname}",
    "/etc/hostname",
    "$(touch written)",
    "`touch written`",
    "${HOME:-$(touch written)}",
    "{{ lipsum.__globals__ }}",
    "__import__('os').system('touch written')",
)

# A process of its own says what Python audits while it reads files: what is opened, run, compiled or connected to.
_AUDITED = """
import json, sys
from syncrelay.config import ConfigError, load
def read(path):
    try:
        load(path)
    except ConfigError:
        pass
read(sys.argv[1])
seen = []
sys.addaudithook(lambda event, arguments: seen.append([event, str(arguments[0]) if arguments else ""]))
for path in sys.argv[2:]:
    read(path)
print(json.dumps(list(seen)))
"""
_HARMLESS = re.compile(r"object\.__\w+__|os\.(listdir|scandir)|sys\._getframe|builtins\.id|re\..*|marshal\..*")


def test_no_value_has_anything_run_or_read(tmp_path: Path):
    paths = [tmp_path / f"{number}.yaml" for number in range(len(_ORDERS) + 1)]
    for path, value in zip(paths, ("10ms", *_ORDERS), strict=True):
        keys = [f"{key}: {value}" for key in ("slop", "output_prefix", "restamp")]
        path.write_text(_FILE.format(value=value, keys="\n    ".join(keys)))
    done = subprocess.run(
        [sys.executable, "-c", _AUDITED, *map(str, paths)], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    seen = [(event, what) for event, what in json.loads(done.stdout) if not _HARMLESS.fullmatch(event)]
    opened = {what for event, what in seen if event == "open"}
    assert {event for event, _ in seen} == {"open"}
    assert {str(path) for path in paths[1:]} <= opened
    assert {what for what in opened - set(map(str, paths)) if "/share/" not in what} == set()
    assert sorted(tmp_path.iterdir()) == sorted(paths)


_FILE = """\
version: 1
groups:
  front:
    policy: approximate_time
    {keys}
    topics:
      - topic: {value}
        type: sensor_msgs/msg/Image
      - topic: /lidar
        type: {value}
        qos: {value}
        stamp: {{field: {value}}}
"""
