"""The schema that editors check by says what the models say."""

import re
from pathlib import Path
from typing import Any, ClassVar

import pytest
import yaml
from jsonschema import Draft7Validator

from syncrelay.config.file import file_format
from syncrelay.config.schema import json_schema
from tests.drawn_files import models_of

HERE = Path(__file__).parent
FORMAT = file_format()
SCHEMA = json_schema()
VALIDATOR = Draft7Validator(SCHEMA)
GOOD_FILES = [*sorted((HERE / "valid").glob("*.yaml")), *sorted((HERE.parents[1] / "configs").glob("*.yaml"))]


def parsed(file):
    """The file as an editor sees it: YAML 1.2, so that words stay words, and a key that is a number is a text."""
    read = yaml.load(file.read_text(encoding="utf-8"), Loader=Yaml12Loader)  # noqa: S506  a SafeLoader
    return {str(key): value for key, value in read.items()} if isinstance(read, dict) else read


class Yaml12Loader(yaml.SafeLoader):
    yaml_implicit_resolvers: ClassVar = {  # type: ignore[misc]  # yaml sets it on classes, too
        first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith((":bool", ":timestamp"))]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


Yaml12Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile("true|false"), ["t", "f"])


WRONG_FILES = sorted((HERE / "invalid").rglob("*.yaml"))


def test_the_schema_is_draft_7():
    Draft7Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert "discriminator" not in str(SCHEMA)
    assert "$defs" not in str(SCHEMA)


@pytest.mark.parametrize("file", GOOD_FILES, ids=lambda file: file.stem)
def test_a_good_file_is_good_by_the_schema(file):
    assert list(VALIDATOR.iter_errors(parsed(file))) == []


@pytest.mark.parametrize("file", WRONG_FILES, ids=lambda file: file.stem)
def test_what_is_wrong_in_itself_is_wrong_by_the_schema(file):
    try:
        keys = parsed(file)
    except yaml.YAMLError:
        return  # a schema is asked about what can be parsed
    # No schema can tell how keys bear on each other, what is installed, what the environment holds.
    assert VALIDATOR.is_valid(keys) == (file.parent.name == "by_no_schema"), "is the file in the right folder?"


def test_every_key_is_in_the_schema_with_a_description():
    described = {
        (name, key): schema.get("description")
        for name, definition in {**SCHEMA["definitions"], "File": SCHEMA}.items()
        for key, schema in definition.get("properties", {}).items()
    }
    keys = {(model.__name__, key) for model in models_of(FORMAT.file) for key in model.model_fields}
    assert keys <= described.keys()
    assert [key for key, description in described.items() if not description] == []


def test_every_optional_key_says_its_default():
    silent = [
        (model.__name__, key)
        for model in models_of(FORMAT.file)
        if model not in (FORMAT.file, FORMAT.defaults, FORMAT.any_group)
        for key, info in model.model_fields.items()
        if not info.is_required() and "Default: " not in (info.description or "")
    ]
    assert silent == []


def test_the_default_that_is_said_is_the_default():
    for name in ("NodeConfig", "ApproximateTimeGroup", "NearTopic"):
        for key, schema in SCHEMA["definitions"][name]["properties"].items():
            if schema.get("default"):
                assert f"Default: {str(schema['default']).lower()}" in schema["description"], (name, key)


def test_a_key_that_takes_a_duration_says_its_units():
    for name, definition in SCHEMA["definitions"].items():
        for key, schema in definition.get("properties", {}).items():
            if "(ns|us" in str(schema):
                assert "(ns, us, ms, s, min)" in schema["description"], (name, key)


def test_a_variable_may_stand_for_any_value():
    file = {
        "version": 1,
        "node": {"use_sim_time": "${SIM:-false}"},
        "groups": {
            "front": {
                "policy": "${POLICY:-exact_time}",
                "queue_size": "${QUEUE}",
                "topics": [{"topic": "/${ROBOT}/a", "type": "${TYPE}", "offset": "${OFFSET:-0}ms"}] * 2,
            }
        },
    }
    assert list(VALIDATOR.iter_errors(file)) == []


@pytest.mark.parametrize(("keys", "is_good"), [({"slop": "20ms"}, True), ({}, False)])
def test_what_a_policy_needs_is_needed_unless_there_are_defaults(keys, is_good):
    topics = [{"topic": "/a", "type": "a/msg/B"}, {"topic": "/b", "type": "a/msg/B"}]
    file: dict[str, Any] = {"version": 1, "groups": {"front": {"policy": "approximate_time", "topics": topics, **keys}}}
    assert VALIDATOR.is_valid(file) == is_good
    assert VALIDATOR.is_valid({**file, "defaults": {"slop": "20ms"}})
    del file["groups"]["front"]["policy"]
    assert not VALIDATOR.is_valid(file)
    assert VALIDATOR.is_valid({**file, "defaults": {"policy": "approximate_time", "slop": 1}})
