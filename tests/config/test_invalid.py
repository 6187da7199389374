"""Every file in invalid/ begins with a comment that holds the errors it gives, in full.

`{policies}` stands for the names of all policies. In those in by_no_schema/ the JSON Schema finds nothing.
"""

from itertools import takewhile
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, load
from syncrelay.config.installed import installed_policies
from syncrelay.config.wording import one_of

FOLDER = Path(__file__).parent / "invalid"


def expected_errors(file: Path) -> str:
    comment = takewhile(lambda line: line.startswith("#"), file.read_text(encoding="utf-8").splitlines())
    return "\n".join(line[2:] for line in comment).replace("{policies}", one_of(installed_policies().models))


@pytest.mark.parametrize("file", sorted(FOLDER.rglob("*.yaml")), ids=lambda file: file.stem)
def test_a_faulty_file_gives_the_errors_that_it_begins_with(file, environ, monkeypatch):
    monkeypatch.chdir(file.parent)
    with pytest.raises(ConfigError) as raised:
        load(file.name, environ=environ)
    assert str(raised.value) == expected_errors(file)
