from tests.cli.command import run, run_here
from tests.config.ament import make_index
from tests.recordings.bag.making import CUSTOM, CUSTOM_STORE, blip, rig, write_mcap
from tests.ros.cdr_messages import STRING, VECTOR, serialize
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, merged
from tests.ros.summary import read_summary


def test_what_it_leaves_out_is_named_with_the_reason(tmp_path):
    text = [Frame("/text", STRING, BEGIN + n * 50 * MS, serialize(STRING, "x")) for n in range(50)]
    write_mcap(tmp_path / "more.mcap", merged(rig(100), text, at("/rare", 1)))
    done = run_here("init", "--from-bag", "more.mcap", folder=tmp_path)
    assert done.returncode == 0
    assert done.stderr.splitlines() == [
        f"syncrelay: left out: /rare ({VECTOR}): 1 message, at least 10 are needed",
        f"syncrelay: left out: /text ({STRING}): its type has no header, so no stamp to match by",
    ]


def test_what_it_writes_is_in_order_and_gives_sets_though_packages_are_not_installed(tmp_path):
    frames = [frame._replace(type_name=CUSTOM, payload=blip(frame.time, seen=0)) for frame in rig(100)]
    write_mcap(tmp_path / "custom.mcap", frames, store=CUSTOM_STORE)
    printed = run("init", "--from-bag", "custom.mcap", folder=tmp_path)
    assert (printed.returncode, printed.stderr) == (0, "")
    written = run_here("init", "--from-bag", "custom.mcap", "-o", "custom.yaml", folder=tmp_path)
    assert (written.returncode, written.stdout, written.stderr) == (0, "", "syncrelay: wrote custom.yaml\n")
    assert (tmp_path / "custom.yaml").read_text() == printed.stdout
    installed = {"AMENT_PREFIX_PATH": str(make_index(tmp_path / "ament"))}
    done = run_here("validate", "custom.yaml", folder=tmp_path, environ=installed)
    assert (done.returncode, done.stderr) == (0, "")
    assert "note: groups.epoch_1.topics[0].type: the package `rig_msgs` is not installed here" in done.stdout
    replayed = run_here("replay", "custom.mcap", "--config", "custom.yaml", folder=tmp_path)
    assert [group.sets for group in read_summary(replayed.stdout).values()] == [100]
