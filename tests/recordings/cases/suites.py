"""Test files made in a test: a file of one group with a camera and a lidar, and cases of it."""

from collections.abc import Mapping
from pathlib import Path

import yaml

from syncrelay.recordings.cases import check, load_suite

GROUP = {
    "policy": "approximate_time_eager",
    "slop": "20ms",
    "topics": [
        {"topic": "/camera", "type": "sensor_msgs/msg/Image"},
        {"topic": "/lidar", "type": "sensor_msgs/msg/Imu"},
    ],
}


def write(folder: Path, case: object, **group: object) -> Path:
    """Write a file with a group, and a test file with one case of it; the test file's path."""
    keys = {key: value for key, value in {**GROUP, **group}.items() if value is not None}
    config = {"version": 1, "groups": {"front": keys}}
    (folder / "fusion.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    suite = folder / "tests.yaml"
    suite.write_text(yaml.safe_dump({"version": 1, "config": "fusion.yaml", "cases": {"it": case}}, sort_keys=False))
    return suite


def run(folder: Path, case: object, **group: object):
    """Run one case of a group; its result."""
    (result,) = check(load_suite(str(write(folder, case, **group)), environ={}))
    return result


def left(folder: Path, drawing: str, *, case: Mapping[str, object] | None = None, **group: object) -> tuple[str, ...]:
    """Return what leaves of a drawing that expects nothing."""
    result = run(folder, {"drawing": drawing, **(case or {})}, **group)
    assert result.error is None
    return result.mismatches[0].found if result.mismatches else ()


def found(folder: Path, expect: Mapping[str, object], case: Mapping[str, object], **group: object) -> dict[str, str]:
    """Return what was found, by the last keys of what was expected otherwise."""
    result = run(folder, {**case, "expect": expect}, **group)
    assert result.error is None
    return {str(each.path[-1]): each.found[0] for each in result.mismatches}
