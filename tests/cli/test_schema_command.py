import json

from jsonschema import Draft7Validator

from syncrelay.config.schema import json_schema
from tests.cli.command import run


def test_schema_prints_the_schema_and_nothing_else(tmp_path):
    done = run("schema", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == json_schema()
    Draft7Validator.check_schema(json.loads(done.stdout))
