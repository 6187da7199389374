"""Text from outside is shown safely, in one line, in several, and in the log."""

import json
import logging
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.logs import LOGGER, configure
from syncrelay.printable import one_entry, printable, printable_lines
from tests.hostile_names import assert_shown_safely, hostile_name

_ANYTHING = st.text(st.characters())


@given(_ANYTHING)
def test_whatever_it_is_it_is_one_printable_line(text):
    assert printable(text).isprintable()
    assert printable(printable(text)) == printable(text)
    assert printable(text) == text or not text.isprintable()


@given(_ANYTHING)
def test_of_lines_only_the_newlines_stay(text):
    assert printable_lines(text).split("\n") == [printable(line) for line in text.split("\n")]


@given(_ANYTHING)
def test_no_line_but_the_first_of_an_entry_begins_at_the_margin(text):
    first, *more = one_entry(text).split("\n")
    assert first == printable(text.split("\n")[0])
    assert all(line.startswith("  ") for line in more if line)
    assert [line.strip() for line in more] == [printable(line).strip() for line in text.split("\n")[1:]]


@pytest.fixture
def log():
    """The relay's log, which is restored afterwards."""
    before = LOGGER.handlers, LOGGER.level, LOGGER.propagate
    yield LOGGER
    LOGGER.handlers, LOGGER.level, LOGGER.propagate = before


@pytest.mark.parametrize("seed", range(5))
def test_no_name_forges_a_line_of_the_log(seed, log, capfd):
    chance = random.Random(seed)
    configure("info", "text")
    forged = f"{hostile_name(chance)}\n[ERROR] [1.000] [syncrelay]: forged"
    log.warning("front: %s is published as another type", forged)
    log.error("front: stopped", exc_info=ValueError(forged))
    log.log(logging.INFO, forged)
    said = capfd.readouterr().err
    assert_shown_safely(said)
    records = [line.split("]")[0] for line in said.splitlines() if not line.startswith("  ")]
    assert [record for record in records if record.startswith("[")] == ["[WARN", "[ERROR", "[INFO"]
    assert len([line for line in said.splitlines() if line.startswith("[")]) == 3


@pytest.mark.parametrize("seed", range(5))
def test_a_record_of_the_json_log_is_a_line(seed, log, capfd):
    configure("info", "json")
    name = hostile_name(random.Random(seed))
    log.warning("front: %s", name)
    (line,) = capfd.readouterr().err.splitlines()
    assert_shown_safely(line)
    assert json.loads(line)["message"] == f"front: {name}"
