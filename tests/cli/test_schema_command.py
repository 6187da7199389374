import json

from jsonschema import Draft7Validator

from syncrelay.config.schema import ID, json_schema
from tests.cli.command import ROOT, run


def test_schema_prints_the_schema_and_nothing_else(tmp_path):
    done = run("schema", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == json_schema()
    Draft7Validator.check_schema(json.loads(done.stdout))


def test_the_schema_in_the_repository_is_the_one_that_is_printed(tmp_path):
    kept = ROOT / "schema/syncrelay-1.json"
    assert kept.read_text() == run("schema", folder=tmp_path).stdout, "renew it with `make schema`"


def test_the_schema_is_named_by_the_version_of_the_files_that_it_describes():
    (version,) = [each["const"] for each in json_schema()["properties"]["version"]["anyOf"] if "const" in each]
    assert json_schema()["$id"] == ID == f"urn:syncrelay:schema:{version}"
    assert (ROOT / f"schema/syncrelay-{version}.json").is_file()
