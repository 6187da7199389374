"""`syncrelay test`: what people and programs read of it, and its exit codes."""

import io
import json
import random
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from syncrelay.cli.test import command, parser
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
PASSING = (
    SUITE.replace("      -> A: a too_far\n      -> b: bA\n", "      -> A: aA\n")
    .replace(">= 60", ">= 50")
    .replace("late: 3", "late: 0")
    .replace("[silent]", "[healthy]")
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


def test_a_directory_stands_for_its_test_files(folder, capsys):
    (folder / "tests").mkdir()
    for name in ("b.yaml", "a.yml", "notes.txt"):
        (folder / "tests" / name).write_text(PASSING.replace("fusion.yaml", "../fusion.yaml"))
    assert run("tests") == 0
    shown = capsys.readouterr().out.splitlines()
    assert (shown[0], shown[4], shown[-1]) == ("tests/a.yml", "tests/b.yaml", "6 passed, 0 failed")
    (folder / "empty").mkdir()
    (folder / "tests" / "a.yml").write_text("{}")
    assert run("empty", "tests") == 1
    told = capsys.readouterr()
    assert told.err.startswith("empty: no *.yaml or *.yml file in this directory\n")
    assert told.out.endswith("3 passed, 0 failed, 2 files with errors\n")


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
def test_a_file_may_come_from_standard_input(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(PASSING.encode())))
    assert run("-") == 0
    assert capsys.readouterr().out.startswith("<stdin>\n  ok    they meet\n")


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
