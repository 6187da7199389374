import pytest

from tests.cli.command import run, run_here
from tests.config.ament import make_index
from tests.recordings.bag.making import CUSTOM, CUSTOM_STORE, blip, rig, write_mcap
from tests.ros.cdr_messages import STRING, VECTOR, serialize
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, merged
from tests.ros.summary import read_summary


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("init")
    write_mcap(made / "rig.mcap", rig(100))
    (made / "mine.yaml").touch()
    return made


def test_what_it_writes_is_in_order_and_gives_sets(folder):
    printed = run("init", "--from-bag", "rig.mcap", folder=folder)
    assert (printed.returncode, printed.stderr) == (0, "")
    written = run_here("init", "--from-bag", "rig.mcap", "-o", "new.yaml", folder=folder)
    assert (written.returncode, written.stdout) == (0, "")
    assert written.stderr == "syncrelay: wrote new.yaml\n"
    assert (folder / "new.yaml").read_text() == printed.stdout
    assert run("validate", "new.yaml", folder=folder).returncode == 0
    replayed = run_here("replay", "rig.mcap", "--config", "new.yaml", folder=folder)
    assert [group.sets for group in read_summary(replayed.stdout).values()] == [100]


def test_what_it_leaves_out_is_named_with_the_reason(folder):
    text = [Frame("/text", STRING, BEGIN + n * 50 * MS, serialize(STRING, "x")) for n in range(50)]
    write_mcap(folder / "more.mcap", merged(rig(100), text, at("/rare", 1)))
    done = run_here("init", "--from-bag", "more.mcap", folder=folder)
    assert done.returncode == 0
    assert done.stderr.splitlines() == [
        f"syncrelay: left out: /rare ({VECTOR}): 1 message, at least 10 are needed",
        f"syncrelay: left out: /text ({STRING}): its type has no header, so no stamp to match by",
    ]


def test_what_it_writes_for_packages_that_are_not_installed_is_in_order_too(folder, tmp_path):
    frames = [frame._replace(type_name=CUSTOM, payload=blip(frame.time, seen=0)) for frame in rig(100)]
    write_mcap(folder / "custom.mcap", frames, store=CUSTOM_STORE)
    assert run_here("init", "--from-bag", "custom.mcap", "-o", "custom.yaml", folder=folder).returncode == 0
    installed = {"AMENT_PREFIX_PATH": str(make_index(tmp_path))}
    done = run("validate", "custom.yaml", folder=folder, environ=installed)
    assert (done.returncode, done.stderr) == (0, "")
    assert "note: groups.epoch_1.topics[0].type: the package `rig_msgs` is not installed here" in done.stdout
    assert run_here("replay", "custom.mcap", "--config", "custom.yaml", folder=folder).returncode == 0
