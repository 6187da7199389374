"""Every file in invalid/ begins with a comment that holds the errors it gives, in full."""

from pathlib import Path

import pytest

from syncrelay.config import ConfigError
from syncrelay.recordings.cases import load_suite
from tests.config.test_invalid import expected_errors

FOLDER = Path(__file__).parent / "invalid"


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.yaml")), ids=lambda file: file.stem)
def test_a_faulty_test_file_gives_the_errors_that_it_begins_with(file, monkeypatch):
    monkeypatch.chdir(FOLDER)
    with pytest.raises(ConfigError) as raised:
        load_suite(file.name, environ={})
    assert str(raised.value) == expected_errors(file)
