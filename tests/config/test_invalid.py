"""Every file in invalid/, and in that of test files, begins with a comment that holds the errors it gives, in full.

Lists of policies and of keys come from the models, and stand there in braces. In the files in by_no_schema/ the JSON
Schema finds nothing.
"""

from itertools import takewhile
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, load
from syncrelay.config.installed import installed_policies, shared_keys
from syncrelay.config.wording import all_of, one_of
from syncrelay.recordings.cases import load_suite

FOLDER = Path(__file__).parent / "invalid"
OF_TESTS = Path(__file__).parents[1] / "recordings/cases/invalid"


def expected_errors(file: Path) -> str:
    comment = takewhile(lambda line: line.startswith("#"), file.read_text(encoding="utf-8").splitlines())
    text = "\n".join(line[2:] for line in comment)
    for name, names in _names().items():
        text = text.replace(f"{{{name}}}", names)
    return text


def _names() -> dict[str, str]:
    models = installed_policies().models
    return {
        "policies": one_of(models),
        "policies with slop": all_of(name for name, model in models.items() if "slop" in model.model_fields),
        "keys of a group": one_of(models["exact_time"].model_fields),
        "keys of defaults": one_of(key for key in shared_keys(models.values()) if key != "topics"),
    }


@pytest.mark.parametrize("file", sorted(FOLDER.rglob("*.yaml")), ids=lambda file: file.stem)
def test_a_faulty_file_gives_the_errors_that_it_begins_with(file, environ, monkeypatch):
    monkeypatch.chdir(file.parent)
    with pytest.raises(ConfigError) as raised:
        load(file.name, environ=environ)
    assert str(raised.value) == expected_errors(file)


@pytest.mark.parametrize("file", sorted(OF_TESTS.rglob("*.yaml")), ids=lambda file: file.stem)
def test_a_faulty_test_file_gives_the_errors_that_it_begins_with(file, monkeypatch):
    monkeypatch.chdir(file.parent)
    with pytest.raises(ConfigError) as raised:
        load_suite(file.name, environ={})
    assert str(raised.value) == expected_errors(file)
