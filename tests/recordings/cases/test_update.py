"""An update writes what was found in place of what was expected, and changes nothing else that a file says."""

import random

import pytest

from syncrelay.errors import SyncRelayError
from syncrelay.recordings.cases import check, load_suite_text, updated
from tests.recordings.cases.suites import write

DRAWINGS = (
    "|\n      lidar |a.b\n      camera |.A.\n",
    "|-\n      lidar |a.b  \n      camera |.A.\n      -> b: a late\n\n      arrive: a A b\n",
    "|2\n      lidar |a.b\n      camera |.A.\n",
    ">\n      lidar |ab\n\n      camera |A\n\n",
    '"  lidar |a.b\\ncamera |.A.\\n\\n"\n',
    "lidar |a\n",
)
EXPECTED = (
    "sets: '3'",
    'received: "> 5"   # so many',
    "match_rate: 0.5",
    "findings: [silent]",
    "findings:\n        - silent  # why\n        - alone",
    "drops: {late: 3}",
    "drops:\n        late: 3 # of them",
    "inputs: {lidar: {received: 9}}",
)
NOTES = ("2020-01-01", "0o17", "1_000", "yes", "~", ".nan", '"\\x1b"', "${HOME}", "$$")
NAMES = ("a b", "1", "'x: y'", '"q\\n"', "2020-01-01", "0x10", "ü", "1.0", "on", "~")


def suite_of(chance: random.Random) -> str:
    """A test file as nobody writes one: with anchors, merge keys, notes, and keys that look like numbers."""
    anchors = ["base"]
    lines = ["version: 1", "config: fusion.yaml", "x-base: &base   # shared", "  sets: 3", "  received: 4", "cases:"]
    for number, name in enumerate(chance.sample(NAMES, 3)):
        lines += [f"  {name}:   # a case", f"    drawing: {chance.choice(DRAWINGS).rstrip()}"]
        keys = chance.sample(EXPECTED, 3)
        if len({key.partition(":")[0] for key in keys}) < len(keys) or chance.random() < 0.2:
            lines.append(f"    expect: *{chance.choice(anchors)}")
            continue
        keys.insert(chance.randrange(3), f"x-note: {chance.choice(NOTES)}")
        if chance.random() < 0.5:
            keys.insert(chance.randrange(3), f"<<: *{chance.choice(anchors)}")
        lines += [f"    expect: &e{number}", *(f"      {key}" for key in keys)]
        anchors.append(f"e{number}")
    return chance.choice(("\n", "\r\n")).join("\n".join([*lines, ""]).split("\n"))


@pytest.mark.parametrize("seed", range(40))
def test_an_updated_file_passes_or_is_left_alone(tmp_path, seed):
    write(tmp_path, {})
    text = suite_of(random.Random(seed))
    before = load_suite_text(text, name=str(tmp_path / "tests.yaml"), environ={"HOME": "/"})
    mismatches = [each for result in check(before) for each in result.mismatches]
    (source,) = before.document.sources.values()
    try:
        new = updated(before.document, source, mismatches, environ={"HOME": "/"})
    except SyncRelayError:
        assert "*" in text or "  ~:" in text
        return
    after = load_suite_text(new, name=str(tmp_path / "tests.yaml"), environ={"HOME": "/"})
    left = [each for result in check(after) for each in result.mismatches]
    assert [each for each in left if each.renewed is not None] == []
    assert [each.name for each in after.cases] == [each.name for each in before.cases]
    assert new.count("\r") == (new.count("\n") if "\r" in text else 0)
    assert new.count("# a case") == text.count("# a case")


def updated_text(folder, text):
    suite = load_suite_text(text, name=str(folder / "tests.yaml"), environ={})
    mismatches = [each for result in check(suite) for each in result.mismatches]
    (source,) = suite.document.sources.values()
    return updated(suite.document, source, mismatches, environ={})


SHARED = """\
version: 1
config: fusion.yaml
x-both: &both {received: 1, drops: {late: 0}}
cases:
  one: {drawing: 'lidar |a', expect: {<<: *both, sets: 3}}
  two: {drawing: 'lidar |ab', expect: {<<: *both, sets: 3}}
"""


def test_what_a_case_has_from_others_becomes_its_own(tmp_path):
    write(tmp_path, {})
    new = updated_text(tmp_path, SHARED)
    assert "  one: {drawing: 'lidar |a', expect: {<<: *both, sets: 0}}\n" in new
    assert "  two: {drawing: 'lidar |ab', expect: {<<: *both, sets: 0, received: 2}}\n" in new


def test_what_others_share_is_not_changed_for_one(tmp_path):
    write(tmp_path, {})
    text = SHARED.replace("expect: {<<: *both, sets: 3}", "expect: *both")
    with pytest.raises(SyncRelayError, match="cases share values by anchors or merge keys"):
        updated_text(tmp_path, text)


def test_a_share_that_no_digits_say_is_what_an_update_says(tmp_path):
    write(tmp_path, {})
    text = SHARED.replace("sets: 3", "match_rate: 0.5").replace("'lidar |ab'", '"lidar |abc\\ncamera |A..B..C"')
    new = updated_text(tmp_path, text)
    assert updated_text(tmp_path, new) == new


@pytest.mark.parametrize("expected", ['"== 1s"', '"= 1us"', "1s", '"< 1ns"', '"> 1min"'])
def test_a_duration_of_many_digits_holds_once_it_is_updated(tmp_path, expected):
    write(tmp_path, {})
    text = (
        "version: 1\nconfig: fusion.yaml\ncases:\n  it:\n    inputs:\n      camera: {rate: 10 Hz}\n"
        f"      lidar: {{rate: 10 Hz, phase: 1.23456789ms}}\n    lasts: 5s\n    expect: {{span_max: {expected}}}\n"
    )
    new = updated_text(tmp_path, text)
    assert new != text
    assert updated_text(tmp_path, new) == new
