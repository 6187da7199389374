"""The schema that editors check test files by says what the models say."""

import json
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

from syncrelay.recordings.cases.models import (
    SCHEMA_ID,
    Case,
    CasesFile,
    Expectation,
    InputExpectation,
    InputSource,
    cases_schema,
)
from tests.cli.command import ROOT
from tests.config.test_schema import parsed
from tests.recordings.cases.test_examples import CONFIGS

SCHEMA = cases_schema()
VALIDATOR = Draft7Validator(SCHEMA)
INVALID = Path(__file__).parent / "invalid"
# What no schema can tell: what names mean, what is drawn, how keys bear on each other.
BEYOND_A_SCHEMA = {
    "meanings",
    "no_config",
    "several_groups",
    "said_of_letters",
    "no_moment",
    "nothing_changed",
    "tests_itself",
}


def test_the_schema_is_draft_7():
    Draft7Validator.check_schema(SCHEMA)
    assert SCHEMA["$id"] == SCHEMA_ID
    assert "$defs" not in str(SCHEMA)


@pytest.mark.parametrize("file", sorted((CONFIGS / "tests").glob("*.yaml")), ids=lambda file: file.stem)
def test_a_good_file_is_good_by_the_schema(file):
    assert list(VALIDATOR.iter_errors(parsed(file))) == []
    assert file.read_text().startswith("# yaml-language-server: $schema=../../schema/syncrelay-test-1.json\n")


@pytest.mark.parametrize("file", sorted(INVALID.glob("*.yaml")), ids=lambda file: file.stem)
def test_what_is_wrong_in_itself_is_wrong_by_the_schema(file):
    assert VALIDATOR.is_valid(parsed(file)) == (file.stem in BEYOND_A_SCHEMA)


def test_every_key_is_described_and_says_its_default():
    described = {**SCHEMA["definitions"], "CasesFile": SCHEMA}
    for model in (CasesFile, Case, InputSource, Expectation, InputExpectation):
        for key, info in model.model_fields.items():
            text = described[model.__name__]["properties"][key]["description"]
            assert info.is_required() or "Default: " in text, (model, key)


def test_the_schema_in_the_repository_is_the_one_that_is_printed():
    kept = (ROOT / "schema/syncrelay-test-1.json").read_text()
    assert kept == json.dumps(SCHEMA, indent=2, ensure_ascii=False) + "\n", "renew it with `make schema`"
