"""A file of one policy is tried with the model of that policy alone: its result is that of the model of all."""

import pytest

from syncrelay.config.file import file_format, valid_keys
from tests.cli.command import GOOD, run_python

_TOPICS = [{"topic": "/a"}, {"topic": "/b"}]
_FILES = {
    "one policy": {"a": {"policy": "exact_time"}, "b": {"policy": "exact_time", "queue_size": 5}},
    "two policies": {"a": {"policy": "exact_time"}, "b": {"policy": "latest_time", "trigger": "/a"}},
}


@pytest.mark.parametrize("groups", _FILES.values(), ids=_FILES)
def test_the_keys_are_those_that_the_model_of_all_policies_gives(groups):
    keys = {"version": 1, "groups": {name: {**group, "topics": tuple(_TOPICS)} for name, group in groups.items()}}
    found, expected = valid_keys(keys), file_format().file.model_validate(keys)
    assert dict(found) == dict(expected)


def test_no_model_of_other_policies_is_made(tmp_path):
    script = (
        "import sys; from syncrelay.config import file, load; load(sys.argv[1]);"
        "print(file._format_of.cache_info().currsize)"
    )
    for text, models in ((GOOD, 0), (f"{GOOD}defaults: {{queue_size: 5}}\n", 1)):
        (tmp_path / "f.yaml").write_text(text)
        assert run_python("-c", script, "f.yaml", folder=tmp_path).stdout == f"{models}\n"
