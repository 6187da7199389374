"""The tests of configs/ pass, each example has a file of them, and they notice every value that is changed."""

import shutil
from collections.abc import Iterator
from copy import deepcopy
from functools import reduce
from itertools import islice
from operator import getitem
from pathlib import Path
from typing import Any

import pytest
import yaml

from syncrelay.config import ConfigError, load_text
from syncrelay.config.file import file_format
from syncrelay.config.units import parse_duration, parse_rate
from syncrelay.recordings.cases import check, load_suite
from tests.faults.extent import chosen

CONFIGS = Path(__file__).parents[3] / "configs"
FILES = sorted((CONFIGS / "tests").glob("*.yaml"))

# The engine does the same with any of them, unless messages come sooner than the file says. A set leaves at once when
# what is next of an input must be farther off than the set is wide: with slop 20 ms, any period above 38 ms says so,
# and with 60 ms any above 115 ms. Beside the period of the GNSS, that of the lidar tells nothing more up to 150 ms.
ALIKE = {
    (file, f"groups.{topic}.min_period: {ms}000000ns")
    for file, topic, periods in (
        ("camera_lidar.yaml", "front.topics.1", (45, 81, 99, 180)),
        ("camera_lidar_imu_gnss.yaml", "localization.topics.1", (45, 81, 99)),
        ("camera_lidar_imu_gnss.yaml", "localization.topics.3", (135, 165, 300)),
    )
    for ms in periods
}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_tests_of_an_example_pass(file):
    results = list(check(load_suite(str(file), environ={})))
    assert results
    assert [(result.case.name, result.mismatches, result.error) for result in results if not result.passed] == []


def test_every_example_has_tests():
    assert [file.name for file in FILES] == sorted(file.name for file in CONFIGS.glob("*.yaml"))


@pytest.mark.long
def test_every_changed_value_is_noticed_that_changes_anything(tmp_path):
    shutil.copytree(CONFIGS / "tests", tmp_path / "tests")
    tried, left = set(), set()
    for file in sorted(CONFIGS.glob("*.yaml")):
        for place, text in islice(mutants(file.read_text()), 0, None, chosen(short=4, long=1)):
            tried.add((file.name, place))
            (tmp_path / file.name).write_text(text)
            if not is_noticed(tmp_path / "tests" / file.name):
                left.add((file.name, place))
    assert left == ALIKE & tried
    assert len(tried) > chosen(short=5, long=20) * len(ALIKE)


def mutants(text: str) -> Iterator[tuple[str, str]]:
    """Yield texts of the file with one value changed, and where: what can still be used, and is not the same file."""
    document, groups = yaml.safe_load(text), load_text(text, environ={}).groups
    paths: list[tuple[Any, ...]] = [("defaults",)] if "defaults" in document else []
    for name, group in document["groups"].items():
        paths += [("groups", name), *(("groups", name, "topics", index) for index in range(len(group["topics"])))]
    for path in paths:
        keys = reduce(getitem, path, document)
        for key, value in [(each, value) for each in keys for value in others(each, keys)]:
            changed = deepcopy(document)
            mapping = reduce(getitem, path, changed)
            mapping[key] = value
            if value is None:
                del mapping[key]
            if key == "policy" and path != ("defaults",):
                fit(mapping)
            new = yaml.safe_dump(changed, sort_keys=False)
            try:
                if load_text(new, environ={}).groups != groups:
                    yield f"{'.'.join(map(str, path))}.{key}: {value}", new
            except ConfigError:
                continue


def fit(group: dict[str, Any]) -> None:
    """Take away what a group's new policy does not have, and add what it needs."""
    form, policy = file_format(), group["policy"]
    for keys, model in [(group, form.groups[policy]), *((topic, form.topics[policy]) for topic in group["topics"])]:
        for key in [key for key in keys if key not in model.model_fields]:
            del keys[key]
    for key, value in {"slop": "20ms", "trigger": group["topics"][0]["topic"], "key": "header.frame_id"}.items():
        if key in form.groups[policy].model_fields:
            group.setdefault(key, value)


def others(key: str, keys: dict[str, Any]) -> Iterator[Any]:
    """Yield other values of a key; None for the key left out."""
    match key, keys[key]:
        case "slop", "none":
            yield from ("1ms", "40ms")
        case (("slop" | "max_wait" | "max_age" | "offset" | "min_period"), value):
            yield from (f"{round(parse_duration(value) * share)}ns" for share in (-1, 0, 0.5, 0.9, 1.1, 2))
            yield None
        case "max_rate", value:
            yield from (f"{1e9 / parse_rate(value) * share} Hz" for share in (0.5, 0.8, 1.25, 2))
            yield None
        case (("queue_size" | "every" | "quorum"), value):
            yield from (each for each in (1, value // 2, value - 1, value + 1, value * 2) if each > 0)
            yield None
        case "policy", value:
            yield from file_format().groups
        case (("restamp" | "trigger"), _):
            yield from (*(each["topic"] for each in keys["topics"]), "earliest", "latest", None)
        case "required", value:
            yield not value
        case "stamp", _:
            yield from ("header", "receive")
        case "key", _:
            yield from ("header.stamp", None)


def is_noticed(suite: Path) -> bool:
    """Tell whether the tests of a file notice that it is another."""
    try:
        return not all(result.passed for result in check(load_suite(str(suite), environ={})))
    except ConfigError:
        # The tests name an input, or a key, that the file then lacks.
        return True
