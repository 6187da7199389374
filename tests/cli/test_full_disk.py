"""Commands that write, on disks that are too small: each says so, leaves nothing broken, and succeeds later."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.cli.command import GOOD, ROOT, run_here
from tests.cli.test_export_lerobot import FILE
from tests.doctor.environments import namespaces
from tests.faults.extent import chosen
from tests.recordings.bag.making import rig, write_mcap
from tests.recordings.datasets.drives import drive
from tests.ros.cdr_messages import VECTOR

_SIZES = chosen(short=1, long=20)
_SEED = chosen(short="full disk", long=os.urandom(4).hex())
_MOUNTS = ("--mount", "--map-root-user")
# Slop is too small, so that there are values to suggest.
_FUSION = {
    "policy": "approximate_time",
    "slop": "1ms",
    "topics": [{"topic": "/camera", "type": VECTOR}, {"topic": "/lidar", "type": VECTOR}],
}


@pytest.mark.faults
def test_a_full_disk_is_said_and_the_command_succeeds_once_there_is_room(tmp_path):
    write_mcap(tmp_path / "rig.mcap", rig(400))
    drive(tmp_path / "drive.mcap")
    (tmp_path / "lerobot.yaml").write_text(FILE)
    (tmp_path / "fusion.yaml").write_text(yaml.safe_dump({"version": 1, "groups": {"front": _FUSION}}))
    argv = [*namespaces(*_MOUNTS), sys.executable, "-m", "tests.cli.full_disk", _SEED, str(_SIZES), str(tmp_path)]
    done = subprocess.run(argv, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name, one in json.loads(done.stdout).items():
        assert one["code"] == 0, (name, one["stderr"])
        for each in one["tries"]:
            case = f"seed {_SEED}: {name}: {json.dumps(each, indent=2)}"
            assert each["code"] in (0, 1), case
            assert "Traceback" not in each["stderr"], case
            if each["code"]:
                assert "No space left on device" in each["stderr"] or "no space left" in each["stderr"], case
                assert each["broken"] == [], case
            assert each["again"][0] == 0 or each["code"] == 0, case
            assert each["same"], case
        assert any(each["code"] for each in one["tries"]), (name, one)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_talk_that_finds_no_space_is_no_failure(tmp_path):
    (tmp_path / "good.yaml").write_text(GOOD)
    (tmp_path / "bad.yaml").write_text(GOOD.replace("exact_time", "nonsense"))
    for name, code in (("good.yaml", 0), ("bad.yaml", 1)):
        with Path("/dev/full").open("w") as full:
            argv = [sys.executable, "-m", "syncrelay", "validate", name]
            environ = {**os.environ, "PYTHONPATH": str(ROOT)}
            done = subprocess.run(argv, cwd=tmp_path, env=environ, stderr=full, stdout=subprocess.DEVNULL, check=False)
        assert done.returncode == code
    assert run_here("validate", "good.yaml", folder=tmp_path).returncode == 0


def test_a_relative_name_is_written_where_another_folder_was_mounted_over_the_working_one(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "over").mkdir()
    script = f'mount --bind ../over . && exec "{sys.executable}" -m syncrelay demo --seconds 1 --record rig.mcap'
    argv = [*namespaces(*_MOUNTS), "bash", "-c", script]
    done = subprocess.run(argv, cwd=tmp_path / "here", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "over" / "rig.mcap").exists()
