"""`syncrelay diff` as a user starts it."""

import json

import pytest

from tests.cli.command import BAD, GOOD, run, run_here

_NEW = GOOD.replace("exact_time", "exact_time\n    queue_size: 5").replace("/b,", "/b, qos: sensor_data,")


@pytest.fixture
def folder(tmp_path):
    for name, text in {"good": GOOD, "new": _NEW, "bad": BAD, "node": f"{_NEW}node: {{name: other}}\n"}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path


def test_two_files_that_say_the_same_differ_in_nothing(folder):
    (folder / "conf").mkdir()
    (folder / "conf/front.yaml").write_text(f"# the same\n{GOOD}")
    done = run_here("diff", "good.yaml", "conf", folder=folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, "a reload changes nothing: 1 group unchanged\n", "")


def test_what_a_reload_would_do_is_told_in_lines(folder):
    done = run("diff", "-", "new.yaml", folder=folder, stdin=GOOD)
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout.splitlines() == [
        "a reload rebuilds 1 group",
        "~ front: rebuilt; what waits in its queues is dropped",
        "    queue_size: not set -> 5",
        "    /b qos: not set -> sensor_data",
    ]


def test_what_needs_a_restart_is_told_first(folder):
    done = run_here("diff", "good.yaml", "node.yaml", folder=folder)
    assert done.stdout.splitlines() == [
        "a reload would be refused: `node` cannot change while the relay runs; after a restart:",
        "  node.name: not set -> other",
        "~ front: changed",
        "    queue_size: not set -> 5",
        "    /b qos: not set -> sensor_data",
    ]


def test_programs_get_json(folder):
    done = run_here("diff", "good.yaml", "node.yaml", "--json", folder=folder)
    told = json.loads(done.stdout)
    assert (done.returncode, told["reload"], told["restart"]) == (1, "refused", ["node"])
    assert told["groups"]["rebuilt"][0]["keys"] == [
        {"topic": None, "key": "queue_size", "old": None, "new": "5"},
        {"topic": "/b", "key": "qos", "old": None, "new": "sensor_data"},
    ]


def test_a_faulty_file_is_an_error_and_not_a_difference(folder):
    done = run_here("diff", "good.yaml", "bad.yaml", folder=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("bad.yaml:4:13: groups.front.policy: unknown value `exact_tim`")
    both = run_here("diff", "bad.yaml", "missing.yaml", folder=folder)
    assert both.stderr == f"{done.stderr}missing.yaml: no such file\n"
