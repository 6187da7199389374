import pytest

from tests.bag.making import rig, write_mcap
from tests.cli.command import run
from tests.ros.summary import read_summary


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("init")
    write_mcap(made / "rig.mcap", rig(100))
    return made


def test_what_it_writes_is_in_order_and_gives_sets(folder):
    printed = run("init", "--from-bag", "rig.mcap", folder=folder)
    assert (printed.returncode, printed.stderr) == (0, "")
    written = run("init", "--from-bag", "rig.mcap", "-o", "new.yaml", folder=folder)
    assert (written.returncode, written.stdout) == (0, "")
    assert written.stderr == "syncrelay: new.yaml is written\n"
    assert (folder / "new.yaml").read_text() == printed.stdout
    assert run("validate", "new.yaml", folder=folder).returncode == 0
    replayed = run("replay", "rig.mcap", "--config", "new.yaml", folder=folder)
    assert [group.sets for group in read_summary(replayed.stdout).values()] == [100]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ([], 2, "one of the arguments --from-bag --from-graph is required"),
        (["--from-bag", "rig.mcap", "--from-graph"], 2, "argument --from-graph: not allowed with argument --from-bag"),
        (["--from-bag", "rig.mcap", "--seconds", "3"], 2, "--seconds N is for how long --from-graph listens"),
        (["--from-graph", "--seconds", "0"], 2, "argument --seconds: expected a number above 0, found 0"),
        (["--from-bag", "none.mcap"], 1, "none.mcap: no such file or folder"),
        (["--from-bag", "rig.mcap", "-o", "rig.mcap"], 1, "rig.mcap: exists already, and is not overwritten"),
    ],
)
def test_what_is_wrong_is_said(words, code, said, folder):
    done = run("init", *words, folder=folder)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(f"syncrelay: {said}")
