"""What `observe` ends with, by the reports of its groups."""

import pytest

from syncrelay.cli.boundary import AT_FAULT, DONE
from syncrelay.cli.observe import conclude
from syncrelay.explain import GroupReport, judge
from tests.cli.command import GOOD, run
from tests.explain.support.groups import NOW, S, a_group, an_input


def _report(facts) -> GroupReport:
    return GroupReport(facts, judge(facts))


def test_where_all_groups_are_healthy_the_code_is_0_and_nothing_decided_it(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group())], 10) == DONE
    assert capsys.readouterr().out == ""


def test_a_look_that_is_too_short_says_what_decided(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group(figures={"last_set": None, "sets": 0, "began": NOW - S}))], 1.2) == AT_FAULT
    assert capsys.readouterr().out.splitlines()[-1] == (
        "exit code 1: front produced no set in 1 s, which is too short to tell why: observe it for longer"
    )


def test_findings_of_a_group_decide_and_are_counted(capsys: pytest.CaptureFixture[str]):
    lonely = _report(a_group(an_input(publishers=()), an_input("/lidar", publishers=())))
    assert conclude([_report(a_group()), lonely], 10) == AT_FAULT
    assert capsys.readouterr().out.splitlines()[-1] == "exit code 1: front has 1 warning"


def test_a_group_of_which_there_is_no_report_is_not_healthy(capsys: pytest.CaptureFixture[str]):
    assert conclude([_report(a_group())], 10, unjudged=["rear"]) == AT_FAULT
    assert capsys.readouterr().out.splitlines()[-1] == "exit code 1: rear could not be evaluated: see the log"


def test_a_file_that_is_there_is_not_written_again_and_nobody_waits_to_hear_it(tmp_path):
    (tmp_path / "new.yaml").write_text("mine")
    done = run("observe", "--config", "fusion.yaml", "--write", "new.yaml", folder=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "syncrelay: new.yaml: already exists and is not overwritten\n"
    assert (tmp_path / "new.yaml").read_text() == "mine"


def test_of_two_files_none_is_written(tmp_path):
    done = run("observe", "--config", "a.yaml", "--config", "b.yaml", "--write", "new.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("syncrelay: --write goes with one --config FILE\n")


def test_of_a_directory_of_two_files_none_is_written(tmp_path):
    (tmp_path / "conf").mkdir()
    (tmp_path / "conf" / "front.yaml").write_text(GOOD)
    (tmp_path / "conf" / "node.yaml").write_text("version: 1\nnode: {name: rig}\n")
    done = run("observe", "--config", "conf", "--write", "new.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("syncrelay: --write goes with one --config FILE: conf has 2\n")


def test_a_file_that_has_no_folder_is_said_at_once(tmp_path):
    done = run("observe", "--config", "fusion.yaml", "--write", "there/new.yaml", folder=tmp_path)
    assert (done.returncode, done.stderr) == (
        1,
        "syncrelay: there/new.yaml: cannot be written: there is not a folder\n",
    )
