"""`syncrelay test`: what people and programs read of it, its exit codes, and --update."""

import io
import json
import os
import random
import sys
import threading
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from syncrelay.cli.test import command, parser
from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.recordings.cases.running import replace_text
from tests.hostile_names import assert_shown_safely, hostile_name
from tests.recordings.cases.suites import write

SUITE = """\
version: 1
config: fusion.yaml
cases:
  # The lidar is 10 ms later.
  they meet:
    drawing: |
      camera |a..b
      lidar  |.A..
      -> A: aA
  they never do:
    drawing: |
      camera |a..b
      lidar  |.A..
      -> A: a too_far
      -> b: bA
  figures:
    inputs: {camera: {rate: 10 Hz}, lidar: {rate: 10 Hz}}   # both at once
    lasts: 5s
    expect: {sets: ">= 60", match_rate: 1, drops: {late: 3}, findings: [silent]}
"""
SHOWN = """\
tests.yaml
  ok    they meet
  FAIL  they never do
        camera |a..b
        lidar  |.A..
        - -> A: a too_far
        - -> b: bA
        + -> A: aA
  FAIL  figures
        sets: expected >= 60, found 50
        drops.late: expected 3, found 0
        findings: expected silent, found healthy
1 passed, 2 failed
"""
UPDATED = (
    SUITE.replace("      -> A: a too_far\n      -> b: bA\n", "      -> A: aA\n")
    .replace(">= 60", ">= 50")
    .replace("late: 3", "late: 0")
    .replace("[silent]", "[healthy]")
    .replace("   # both", " # both")
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write(tmp_path, {})
    (tmp_path / "tests.yaml").write_text(SUITE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*words):
    taken = parser()
    return command(taken, taken.read(words), None)  # type: ignore[arg-type]  # nobody ends it


@pytest.mark.usefixtures("folder")
def test_people_read_a_line_a_case_and_what_differs(capsys):
    assert run("tests.yaml") == 1
    assert capsys.readouterr() == (SHOWN, "")


def test_what_is_can_be_what_shall_be_and_comments_stay(folder, capsys):
    (folder / "tests.yaml").chmod(0o640)
    assert run("tests.yaml", "--update") == 0
    shown = SHOWN.replace("FAIL", "updated").replace("1 passed, 2 failed", "1 passed, 2 updated, 0 failed")
    assert capsys.readouterr() == (shown, "syncrelay: tests.yaml: 4 expectations updated\n")
    assert [line.split() for line in (folder / "tests.yaml").read_text().splitlines()] == [
        line.split() for line in UPDATED.splitlines()
    ]
    assert (folder / "tests.yaml").stat().st_mode & 0o777 == 0o640
    assert run("tests.yaml") == 0
    assert sorted(each.name for each in folder.iterdir()) == ["fusion.yaml", "tests.yaml"]


def test_an_update_of_what_passes_leaves_the_file_alone(folder):
    (folder / "tests.yaml").write_text(UPDATED)
    before = (folder / "tests.yaml").stat()
    assert run("tests.yaml", "--update") == 0
    assert (folder / "tests.yaml").stat() == before


def test_what_no_file_can_expect_still_fails_after_an_update(folder, capsys):
    case = {"inputs": {"camera": {"rate": "9 Hz"}}, "lasts": "1s", "expect": {"span_p95": "< 1ms", "sets": 1}}
    write(folder, case)
    assert run("tests.yaml", "--update") == 1
    told = capsys.readouterr()
    assert told.out == (
        "tests.yaml\n  FAIL  it\n        span_p95: expected < 1ms, found no set left\n0 passed, 1 failed\n"
    )
    assert told.err == "syncrelay: tests.yaml: 1 expectation updated\n"


def test_a_read_only_file_is_not_updated(folder, capsys):
    (folder / "tests.yaml").chmod(0o444)
    assert run("tests.yaml", "--update") == 1
    assert capsys.readouterr().err == "syncrelay: tests.yaml: cannot be written: it is read-only\n"
    assert (folder / "tests.yaml").read_text() == SUITE


def test_a_file_that_is_changed_while_its_cases_run_is_not_updated(folder):
    before, changed = SUITE, SUITE.replace(">= 60", ">= 70")
    (folder / "tests.yaml").write_text(changed)
    with pytest.raises(SyncRelayError, match="was changed while its cases ran"):
        replace_text("tests.yaml", UPDATED, before=before)
    assert (folder / "tests.yaml").read_text() == changed


def test_a_pipe_is_not_replaced_by_a_file(folder, capsys):
    os.mkfifo(folder / "pipe.yaml")
    writer = threading.Thread(target=(folder / "pipe.yaml").write_text, args=(SUITE,))
    writer.start()
    assert run("pipe.yaml", "--update") == 1
    writer.join()
    assert capsys.readouterr().err == "syncrelay: pipe.yaml: cannot be written: it is not a regular file\n"
    assert (folder / "pipe.yaml").is_fifo()


def test_where_one_file_cannot_be_updated_the_others_are(folder, capsys):
    (folder / "shared.yaml").write_text(
        "version: 1\nconfig: fusion.yaml\nx-both: &both {received: 9}\ncases:\n"
        "  one: {drawing: 'lidar |a', expect: *both}\n  two: {drawing: 'lidar |ab', expect: *both}\n"
    )
    assert run("shared.yaml", "tests.yaml", "--update") == 1
    told = capsys.readouterr()
    assert told.out.endswith("\n1 passed, 2 updated, 2 failed\n")
    assert "syncrelay: shared.yaml: cannot be updated without changing more than was found" in told.err
    assert run("tests.yaml") == 0


@pytest.mark.usefixtures("folder")
def test_programs_are_told_what_was_updated(capsys):
    assert run("tests.yaml", "--update", "--format", "json") == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["passed"], report["updated"], report["failed"]) == (1, 2, 0)
    states = [(case["passed"], case["updated"]) for case in report["files"][0]["cases"]]
    assert states == [(True, False), (False, True), (False, True)]
    Path("tests.yaml").write_text(SUITE)
    for output_format, failure in (("junit", "<failure"), ("github", "::error")):
        assert run("tests.yaml", "--update", "--format", output_format) == 0
        assert failure not in capsys.readouterr().out
        Path("tests.yaml").write_text(SUITE)


def test_a_directory_stands_for_its_test_files(folder, capsys):
    (folder / "tests").mkdir()
    for name in ("b.yaml", "a.yml", "notes.txt"):
        (folder / "tests" / name).write_text(UPDATED.replace("fusion.yaml", "../fusion.yaml"))
    assert run("tests") == 0
    shown = capsys.readouterr().out.splitlines()
    assert (shown[0], shown[4], shown[-1]) == ("tests/a.yml", "tests/b.yaml", "6 passed, 0 failed")
    (folder / "empty").mkdir()
    assert run("empty", "tests") == 1
    told = capsys.readouterr()
    assert told.err == "empty: no *.yaml or *.yml file in this directory\n"
    assert told.out.endswith("6 passed, 0 failed, 1 file with errors\n")


@pytest.mark.usefixtures("folder")
def test_a_remark_says_of_which_case_it_is(capsys):
    text = SUITE.partition("  they never")[0] + "    what_if: ['dead: lidar from 9s']\n"
    Path("tests.yaml").write_text(text)
    assert run("tests.yaml") == 0
    assert capsys.readouterr().err == (
        "syncrelay: tests.yaml: they meet: `dead: lidar from 9s` changed nothing: the first message of /lidar came"
        " after 0.01 s, the last after 0.01 s\n"
    )
    assert run("tests.yaml", "--format", "junit") == 0
    (told,) = ET.fromstring(capsys.readouterr().out).iter("system-err")  # noqa: S314  our own
    assert (told.text or "").startswith("`dead: lidar from 9s` changed nothing: ")


def test_a_case_with_the_name_of_a_number_is_updated_too(folder):
    (folder / "tests.yaml").write_text(
        "version: 1\nconfig: fusion.yaml\ncases:\n  2:\n    drawing: camera |a\n"
        "  1: {drawing: 'lidar |a', expect: {received: 4}}\n"
    )
    assert run("tests.yaml", "--update") == 0
    assert "expect: {received: 1}" in (folder / "tests.yaml").read_text()


@pytest.mark.usefixtures("folder")
def test_programs_read_json(capsys):
    assert run("tests.yaml", "--format", "json") == 1
    report = json.loads(capsys.readouterr().out)
    assert (report["passed"], report["failed"]) == (1, 2)
    cases = report["files"][0]["cases"]
    assert [(case["name"], case["line"], case["passed"]) for case in cases] == [
        ("they meet", 5, True),
        ("they never do", 10, False),
        ("figures", 16, False),
    ]
    assert cases[1]["mismatches"] == [
        {"path": 'cases."they never do".drawing', "expected": ["A: a too_far", "b: bA"], "found": ["A: aA"]}
    ]


def test_ci_servers_read_junit(folder, capsys):
    (folder / "other.yaml").write_text("version: 1\n")
    assert run("tests.yaml", "other.yaml", "--format", "junit") == 1
    root = ET.fromstring(capsys.readouterr().out)  # noqa: S314  our own
    assert root.attrib == {"name": "syncrelay test", "tests": "4", "failures": "2", "errors": "1"}
    failures = [each.attrib["message"] for each in root.iter("failure")]
    assert failures == ["not what was drawn", "not as expected: sets, drops.late, findings"]
    assert "+ -> A: aA" in (next(root.iter("failure")).text or "")
    assert "other.yaml:1:1: config: missing" in (next(root.iter("error")).text or "")


def test_github_reads_annotations_at_the_case(folder, capsys):
    text = SUITE.replace("they meet", '"::error::they 100%"')
    (folder / "tests.yaml").write_text(text)
    assert run("tests.yaml", "--format", "github") == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "  ok    %3A%3Aerror%3A%3Athey 100%"
    assert lines[2].startswith("::error file=tests.yaml,line=10,col=3,endColumn=16::they never do%0Acamera |a..b%0A")


def test_a_faulty_file_is_told_as_any_other_and_the_rest_is_run(folder, capsys):
    (folder / "other.yaml").write_text("version: 1\nconfg: fusion.yaml\n")
    assert run("other.yaml", "tests.yaml") == 1
    told = capsys.readouterr()
    assert "other.yaml:2:1: confg: unknown key, did you mean `config`?\n    2 | confg: fusion.yaml\n" in told.err
    assert told.out.endswith("1 passed, 2 failed, 1 file with errors\n")


@pytest.mark.usefixtures("folder")
def test_a_file_may_come_from_standard_input_but_is_not_written_there(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(UPDATED.encode())))
    assert run("-") == 0
    assert capsys.readouterr().out.startswith("<stdin>\n  ok    they meet\n")
    with pytest.raises(UsageError, match="--update cannot write standard input"):
        run("-", "--update")


@pytest.mark.parametrize("output_format", ["text", "junit", "json", "github"])
@pytest.mark.parametrize("seed", range(5))
def test_names_are_text_alone_in_every_report(folder, output_format, seed, capsys):
    chance = random.Random(seed)

    def name():
        return json.dumps(hostile_name(chance))

    (folder / "::error::tests, 100%0A.yaml").write_text(
        f"version: 1\nconfig: fusion.yaml\ncases:\n"
        f"  {name()}: {{drawing: 'lidar |ab', expect: {{received: 3}}, x-note: {name()}}}\n"
        f"  {name()}: {{recording: {name()}, what_if: ['drop: /lidar 1%'], expect: {{sets: 3}}}}\n"
    )
    (folder / "faulty.yaml").write_text(f"version: 1\nconfig: fusion.yaml\ncases: {{{name()}: {{group: {name()}}}}}")
    assert run("::error::tests, 100%0A.yaml", "faulty.yaml", "--format", output_format) == 1
    told = capsys.readouterr()
    assert_shown_safely(told.out)
    assert_shown_safely(told.err)
    if output_format == "junit":
        assert len(list(ET.fromstring(told.out).iter("testcase"))) == 3  # noqa: S314  our own
    elif output_format == "json":
        assert json.loads(told.out)["failed"] == 2
    elif output_format == "github":
        commands = [line for line in (told.out + told.err).splitlines() if "::" in line or "##[" in line]
        assert [line.split(" ")[0] for line in commands] == ["::error"] * 3
