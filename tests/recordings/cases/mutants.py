"""A file with one value changed, for every value that the engine goes by and several changes of each.

`python -m tests.recordings.cases.mutants` says how many of them the tests of configs/ notice, and which they don't.
"""

import shutil
import sys
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import yaml

from syncrelay.config import ConfigError, load_text
from syncrelay.config.file import file_format
from syncrelay.config.units import parse_duration, parse_rate
from syncrelay.recordings.cases import check, load_suite

CONFIGS = Path(__file__).parents[3] / "configs"
DURATIONS = ("slop", "max_wait", "max_age", "offset", "min_period")


# The engine does the same with any of them, unless messages come sooner than the file says. A set leaves at once when
# what is next of an input must be farther off than the set is wide: with slop 20 ms, any period above 38 ms says so,
# and with 60 ms any above 115 ms. Beside the period of the GNSS, that of the lidar tells nothing more up to 150 ms.
ALIKE = {
    *(("camera_lidar.yaml", f"front.topics[1].min_period: {ms}000000ns") for ms in (45, 81, 99, 180)),
    *(("camera_lidar_imu_gnss.yaml", f"localization.topics[1].min_period: {ms}000000ns") for ms in (45, 81, 99)),
    *(("camera_lidar_imu_gnss.yaml", f"localization.topics[3].min_period: {ms}000000ns") for ms in (135, 165, 300)),
}


class Mutant(NamedTuple):
    """A file of this name whose value at a place is another."""

    name: str
    place: str
    text: str


def mutants(file: Path) -> Iterator[Mutant]:
    """Yield what still is a file that can be used, and not the same one."""
    document = yaml.safe_load(file.read_text())
    resolved = _resolved(file.read_text())
    for place, changed in _changed(document):
        text = yaml.safe_dump(changed, sort_keys=False)
        try:
            if _resolved(text) != resolved:
                yield Mutant(file.name, place, text)
        except ConfigError:
            continue


def _resolved(text: str) -> Any:
    return load_text(text, environ={}).groups


def _changed(document: Any) -> Iterator[tuple[str, Any]]:
    for section in ("defaults", *document["groups"]):
        below = document["groups"].get(section, document.get(section))
        if below is None:
            continue
        for key in below:
            for value in _others(key, below):
                changed = deepcopy(document)
                group = changed["groups"].get(section, changed.get(section))
                _set(group, key, value)
                yield f"{section}.{key}: {value}", changed
        for index, topic in enumerate(below.get("topics", ())):
            for key in topic:
                for value in _others(key, topic):
                    changed = deepcopy(document)
                    _set(changed["groups"][section]["topics"][index], key, value)
                    yield f"{section}.topics[{index}].{key}: {value}", changed


def _set(mapping: dict[str, Any], key: str, value: Any) -> None:
    if value is None:
        del mapping[key]
        return
    mapping[key] = value
    if key == "policy" and "topics" in mapping:
        form = file_format()
        _fit(mapping, form.groups[value])
        for topic in mapping["topics"]:
            _fit(topic, form.topics[value])


def _fit(mapping: dict[str, Any], model: Any) -> None:
    for key in [key for key in mapping if key not in model.model_fields]:
        del mapping[key]
    if "slop" in model.model_fields:
        mapping.setdefault("slop", "20ms")
    if "trigger" in model.model_fields:
        mapping.setdefault("trigger", mapping["topics"][0]["topic"])
    if "key" in model.model_fields and "topics" in mapping:
        mapping.setdefault("key", "header.frame_id")


def _others(key: str, mapping: dict[str, Any]) -> Iterator[Any]:
    """Yield other values of a key; None for the key left out."""
    value = mapping[key]
    if key in DURATIONS:
        ns = parse_duration(value)
        yield from (f"{round(ns * share)}ns" for share in (-1, 0, 0.5, 0.9, 1.1, 2))
        yield None
    elif key == "max_rate":
        period = parse_rate(value)
        yield from (f"{1e9 / period * share} Hz" for share in (0.5, 0.8, 1.25, 2))
        yield None
    elif key in ("queue_size", "every"):
        yield from (each for each in (1, value // 2, value - 1, value + 1, value * 2) if each > 0)
        yield None
    elif key == "policy":
        yield from (each for each in file_format().groups if each != value)
    elif key in ("restamp", "trigger"):
        topics = [each["topic"] for each in mapping["topics"]]
        yield from (each for each in (*topics, "earliest", "latest", None) if each != value)
    elif key == "required":
        yield not value
    elif key == "stamp":
        yield from (each for each in ("header", "receive") if each != value)
    elif key == "key":
        yield from ("header.stamp", None)


def is_noticed(mutant: Mutant, folder: Path) -> bool:
    """Tell whether the tests of a file notice that it is another."""
    (folder / mutant.name).write_text(mutant.text)
    suite = folder / "tests" / mutant.name
    try:
        return not all(result.passed for result in check(load_suite(str(suite), environ={})))
    except ConfigError:
        # The tests name an input, or a key, that the file then lacks.
        return True


def survivors(folder: Path) -> tuple[list[Mutant], int]:
    """Return the mutants of all of configs/ that nothing notices, and how many there are of all."""
    shutil.copytree(CONFIGS / "tests", folder / "tests")
    tried = [mutant for file in sorted(CONFIGS.glob("*.yaml")) for mutant in mutants(file)]
    return [mutant for mutant in tried if not is_noticed(mutant, folder)], len(tried)


def main() -> int:
    with TemporaryDirectory() as folder:
        left, tried = survivors(Path(folder))
    for mutant in left:
        print(f"not noticed: {mutant.name}: {mutant.place}")  # noqa: T201  what it is for
    left_alike = sum((mutant.name, mutant.place) in ALIKE for mutant in left)
    print(f"{tried - len(left)} of {tried} changed values are noticed; {left_alike} of the others change nothing")  # noqa: T201
    return 1 if len(left) > left_alike else 0


if __name__ == "__main__":
    sys.exit(main())
