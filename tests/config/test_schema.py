"""The schemas that editors check by, of files of groups and of test files, say what the models say."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest
import yaml
from jsonschema import Draft7Validator

from syncrelay.config.file import file_format
from syncrelay.config.schema import ID, json_schema
from syncrelay.recordings.cases import models
from tests.cli.command import ROOT, run_here
from tests.drawn_files import models_of

HERE = Path(__file__).parent
FORMAT = file_format()
SCHEMA = json_schema()
VALIDATOR = Draft7Validator(SCHEMA)
TESTS_SCHEMA = models.cases_schema()


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


def _files() -> Iterator[Any]:
    """Every file that there is, by which schema it is checked, and whether that finds nothing."""
    # No schema can tell how keys bear on each other, what names mean, what is installed, what the environment holds.
    for folder, of, is_good in (
        (HERE / "valid", SCHEMA, True),
        (ROOT / "configs", SCHEMA, True),
        (HERE / "invalid", SCHEMA, False),
        (HERE / "invalid/by_no_schema", SCHEMA, True),
        (ROOT / "configs/tests", TESTS_SCHEMA, True),
        (HERE.parent / "recordings/cases/invalid", TESTS_SCHEMA, False),
        (HERE.parent / "recordings/cases/invalid/by_no_schema", TESTS_SCHEMA, True),
    ):
        for file in sorted(folder.glob("*.yaml")):
            yield pytest.param(file, of, is_good, id=f"{folder.relative_to(ROOT)}/{file.stem}")


@pytest.mark.parametrize(
    ("printed", "named", "kept", "words"),
    [
        (SCHEMA, ID, "schema/syncrelay-1.json", ["schema"]),
        (TESTS_SCHEMA, models.SCHEMA_ID, "schema/syncrelay-test-1.json", ["schema", "--test"]),
    ],
    ids=["groups", "tests"],
)
def test_the_schema_is_draft_7_and_the_one_in_the_repository_is_that_which_is_printed(
    printed, named, kept, words, tmp_path
):
    Draft7Validator.check_schema(printed)
    assert (printed["$schema"], printed["$id"]) == ("http://json-schema.org/draft-07/schema#", named)
    assert not re.search("discriminator|[$]defs", str(printed))
    done = run_here(*words, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (ROOT / kept).read_text(), "renew it with `make schema`"


def test_the_schema_is_named_by_the_version_of_the_files_that_it_describes():
    (version,) = [each["const"] for each in SCHEMA["properties"]["version"]["anyOf"] if "const" in each]
    assert SCHEMA["$id"] == f"urn:syncrelay:schema:{version}"


@pytest.mark.parametrize(("file", "of", "is_good"), [*_files()])
def test_what_is_wrong_in_itself_is_wrong_by_the_schema_and_nothing_else_is(file, of, is_good):
    try:
        keys = parsed(file)
    except yaml.YAMLError:
        assert not is_good
        return  # a schema is asked about what can be parsed
    found = [each.message for each in Draft7Validator(of).iter_errors(keys)]
    assert (not found) == is_good, found or "is the file in the right folder?"
    if file.parent == ROOT / "configs/tests":
        assert file.read_text().startswith("# yaml-language-server: $schema=../../schema/syncrelay-test-1.json\n")


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


def test_every_key_of_a_test_file_is_described_and_says_its_default():
    described = {**TESTS_SCHEMA["definitions"], "CasesFile": TESTS_SCHEMA}
    for model in (models.CasesFile, models.Case, models.InputSource, models.Expectation, models.InputExpectation):
        for key, info in model.model_fields.items():
            text = described[model.__name__]["properties"][key]["description"]
            assert info.is_required() or "Default: " in text, (model, key)


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
