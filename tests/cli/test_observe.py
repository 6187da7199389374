"""What `observe` ends with, by the reports of its groups."""

from syncrelay.explain import GroupReport, judge
from syncrelay.top.observed import unhealthy
from tests.cli.command import GOOD, run
from tests.explain.support.groups import NOW, S, a_group, an_input


def _report(facts) -> GroupReport:
    return GroupReport(facts, judge(facts))


def test_healthy_groups_are_no_fault():
    assert unhealthy([_report(a_group())], 10) == []


def test_what_decides_against_a_group_is_said_and_counted():
    too_short = _report(a_group(figures={"last_set": None, "sets": 0, "began": NOW - S}))
    lonely = _report(a_group(an_input(publishers=()), an_input("/lidar", publishers=())))
    assert unhealthy([_report(a_group()), lonely, too_short], 1.2, unjudged=["rear"]) == [
        "front has 1 warning",
        "front produced no set in 1 s, which is too short to tell why: observe it for longer",
        "rear could not be evaluated: see the log",
    ]


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
