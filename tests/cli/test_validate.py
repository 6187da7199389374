import json
import os
import shlex
import subprocess
import sys

import pytest

from tests.cli.command import BAD, GOOD, ROOT, run, run_here
from tests.cli.terminals import shown_on_terminal
from tests.config.ament import make_index

ERROR = """\
f.yaml:4:13: groups.front.policy: unknown value `exact_tim`, did you mean `exact_time`?
    4 |     policy: exact_tim
      |             ^^^^^^^^^
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "good.yaml").write_text(GOOD)
    (tmp_path / "f.yaml").write_text(BAD)
    return tmp_path


@pytest.fixture
def environ(tmp_path_factory):
    return {"AMENT_PREFIX_PATH": str(make_index(tmp_path_factory.mktemp("ament")))}


def test_several_files_are_all_checked(folder, environ):
    done = run_here("validate", "f.yaml", "good.yaml", "missing.yaml", folder=folder, environ=environ)
    assert done.returncode == 1
    assert done.stdout == "good.yaml: ok, 1 group, 2 topics\n"
    assert done.stderr == ERROR + "missing.yaml: no such file\n"


def test_a_directory_is_checked_as_what_runs_together(folder, environ):
    (folder / "conf").mkdir()
    (folder / "empty").mkdir()
    (folder / "conf/b.yaml").write_text(GOOD.replace("front", "rear"))
    (folder / "conf/a.yaml").write_text(GOOD)
    done = run_here("validate", "conf", "empty", "good.yaml", folder=folder, environ=environ)
    assert done.returncode == 1
    assert (
        done.stdout == "conf/a.yaml, conf/b.yaml: ok together, 2 groups, 2 topics\ngood.yaml: ok, 1 group, 2 topics\n"
    )
    assert done.stderr == "empty: no *.yaml or *.yml file in this directory\n"
    done = run_here("validate", "conf", "empty", "--format", "json", folder=folder, environ=environ)
    assert [(each["file"], each["ok"]) for each in json.loads(done.stdout)] == [
        ("conf/a.yaml", True),
        ("conf/b.yaml", True),
        ("empty", False),
    ]
    done = run_here("validate", "--together", "conf", "conf/../conf/a.yaml", folder=folder, environ=environ)
    assert (done.returncode, done.stdout) == (2, "")
    assert "conf/a.yaml and conf/../conf/a.yaml are the same file: name each file once" in done.stderr


def test_a_dash_is_standard_input(folder, environ):
    done = run("validate", "-", folder=folder, environ=environ, stdin=GOOD)
    assert (done.returncode, done.stdout, done.stderr) == (0, "<stdin>: ok, 1 group, 2 topics\n", "")
    done = run("validate", "-", folder=folder, environ=environ, stdin=BAD)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", ERROR.replace("f.yaml", "<stdin>"))


@pytest.mark.parametrize(
    "command", ["{validate} <(cat good.yaml)", "cat good.yaml | {validate} -", "cat good.yaml | {validate} /dev/stdin"]
)
def test_what_another_program_writes_is_read_to_its_end(command, folder, environ):
    validate = f"{shlex.quote(sys.executable)} -m syncrelay validate"
    done = subprocess.run(
        ["/bin/bash", "-c", command.format(validate=validate)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environ},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith(": ok, 1 group, 2 topics\n")


def test_json_tells_of_files_together_in_which_the_problem_is(folder, environ):
    words = ["validate", "--together", "--format=json", "good.yaml", "f.yaml"]
    good, front = json.loads(run_here(*words, folder=folder, environ=environ).stdout)
    assert (good["file"], good["ok"], good["problems"]) == ("good.yaml", True, [])
    assert (front["file"], front["ok"]) == ("f.yaml", False)
    assert [problem["code"] for problem in front["problems"]] == ["duplicate_key", "bad_value"]


def test_json_holds_every_file_and_every_problem(folder, environ):
    done = run_here("validate", "--format", "json", "good.yaml", "f.yaml", "none.yaml", folder=folder, environ=environ)
    assert (done.returncode, done.stderr) == (1, "")
    *two, none = json.loads(done.stdout)
    assert [none["problems"][0][key] for key in ("code", "line", "column")] == ["unreadable", None, None]
    assert two == [
        {"file": "good.yaml", "ok": True, "problems": []},
        {
            "file": "f.yaml",
            "ok": False,
            "problems": [
                {
                    "severity": "error",
                    "code": "bad_value",
                    "path": "groups.front.policy",
                    "message": "unknown value `exact_tim`, did you mean `exact_time`?",
                    "line": 4,
                    "column": 13,
                    "end_column": 22,
                }
            ],
        },
    ]


def test_github_gets_workflow_commands(folder, environ):
    done = run_here(
        "validate", "--format", "github", "f.yaml", "good.yaml", "missing.yaml", folder=folder, environ=environ
    )
    assert (done.returncode, done.stderr) == (1, "")
    error, good, missing = done.stdout.splitlines()
    assert error.startswith("::error file=f.yaml,line=4,col=13,endColumn=22::groups.front.policy: unknown value ")
    assert good == "good.yaml: ok, 1 group, 2 topics"
    assert missing == "::error file=missing.yaml::no such file"


@pytest.mark.parametrize(
    ("variables", "coloured"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"NO_COLOR": ""}, True), ({"TERM": "dumb"}, False)],
)
def test_colour_is_for_terminals_that_want_it(variables, coloured, folder, environ):
    code, shown = shown_on_terminal("validate", "f.yaml", folder=folder, **environ, **variables)
    assert (code, "unknown value" in shown) == (1, True)
    assert ("\033[" in shown) == coloured
