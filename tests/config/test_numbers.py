"""Numbers that no key has a use for, at every key of the file: each is refused where it stands."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from syncrelay.config import ConfigError, load_text
from syncrelay.config.file import FileKeys, file_format
from syncrelay.config.models import StampField
from syncrelay.config.qos import QosOverrides
from syncrelay.config.sections import DiagnosticsConfig, MetricsConfig, NodeConfig
from tests.faults.extent import chosen

# As YAML reads them: larger than a double can be, longer than a duration, and what no text of digits can write.
_WITHOUT_END = {
    "309 digits": "9" * 309,
    "309 digits below 0": "-" + "9" * 309,
    "400 digits": "9" * 400,
    "401 digits": "9" * 401,
    "5000 digits": "9" * 5000,
    "hexadecimal": "0x" + "f" * 398,
    "octal": "0o" + "7" * 398,
    "1e400": "1e400",
    "-1e400": "-1e400",
    "1e99999": "1e99999",
    "infinity": ".inf",
    "not a number": ".nan",
    "ns": f"{'9' * 40}.{'9' * 40}e999 ns",
    "min": f"-{'9' * 40}e999 min",
    "kHz": f"{'9' * 40}e999 kHz",
    "Hz": "1e-999 Hz",
}
_NUMBER = '"number"'


def _file(group: dict[str, Any], topic: dict[str, Any] | None = None, **top: Any) -> dict[str, Any]:
    topics = [{"topic": name, "type": "sensor_msgs/msg/Image", **(topic or {})} for name in ("/a", "/b")]
    return {"version": 1, "groups": {"front": {"topics": topics, **group}}, **top}


def _group(of: str, **keys: Any) -> dict[str, Any]:
    needed = {"policy": of, "slop": "20ms", "trigger": "/a", "key": "header.stamp"}
    return {key: needed[key] for key in file_format().groups[of].model_fields if key in needed} | keys


def _places() -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key of the file, with a file that has a number there."""
    for key in FileKeys.model_fields:
        yield key, _file(_group("exact_time")) | {key: "number"}
    sections: dict[str, Any] = {"node": NodeConfig, "metrics": MetricsConfig, "diagnostics": DiagnosticsConfig}
    for name, model in sections.items():
        for key in model.model_fields:
            yield f"{name}.{key}", _file(_group("exact_time"), **{name: {key: "number"}})
    for key in file_format().defaults.model_fields:
        yield f"defaults.{key}", _file({"policy": "exact_time"}, defaults={key: "number"})
    for policy, group in file_format().groups.items():
        for key in group.model_fields:
            yield f"groups.front.{key}", _file(_group(policy, **{key: "number"}))
        for key in file_format().topics[policy].model_fields:
            yield f"groups.front.topics[0].{key}", _file(_group(policy), {key: "number"})
    for key in QosOverrides.model_fields:
        yield f"groups.front.topics[0].qos.{key}", _file(_group("exact_time"), {"qos": {key: "number"}})
    for key in StampField.model_fields:
        yield f"groups.front.topics[0].stamp.{key}", _file(_group("exact_time"), {"stamp": {key: "number"}})


@pytest.mark.parametrize("number", chosen(short=[*_WITHOUT_END.values()][::4], long=_WITHOUT_END.values()))
@pytest.mark.long
def test_at_every_key_a_number_without_end_is_refused_where_it_stands(number: str, environ):
    for place, file in _places():
        text = json.dumps(file).replace(_NUMBER, number)
        with pytest.raises(ConfigError) as raised:
            load_text(text, environ=environ)
        there = [each for each in raised.value.problems if text.startswith(number, each.span.column - 1)]
        assert there, str(raised.value)
        # A default may be refused for the group that it is used in.
        assert there[0].path in (place, place.replace("defaults", "groups.front")), str(raised.value)
        assert len(there[0].text) < 300
