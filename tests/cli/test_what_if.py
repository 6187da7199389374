"""`syncrelay replay --what-if`: a fault changes what comes of a recording, the same for a seed."""

import pytest

from syncrelay.cli.replay import command, parser
from tests.recordings.bag.making import rig, write_mcap
from tests.recordings.cases.suites import write
from tests.ros.cdr_messages import VECTOR

_TOPICS = [{"topic": "/camera", "type": VECTOR}, {"topic": "/lidar", "type": VECTOR}]


@pytest.fixture
def replayed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_mcap(tmp_path / "rig.mcap", rig())
    write(tmp_path, {}, topics=_TOPICS)

    def run(*words):
        taken = parser()
        arguments = taken.read(["rig.mcap", "--config", "fusion.yaml", *words])
        code = command(taken, arguments, None)  # type: ignore[arg-type]  # nobody ends it
        told = capsys.readouterr()
        return code, told.out.splitlines(), told.err

    return run


def test_a_fault_changes_what_comes_and_is_named(replayed):
    code, (sets, *_), said = replayed()
    assert (code, sets, said) == (0, "front: 40 sets", "")
    code, (sets, _, lidar), said = replayed("--what-if", "dead: /lidar from 2s", "--what-if", "offset: /lidar 5ms")
    assert (code, sets, lidar) == (0, "front: 20 sets", "front:   /lidar: 20 received, 20 in sets, 0 dropped")
    assert said.splitlines() == [
        "syncrelay: faults laid over the recording (seed 0): `dead: /lidar from 2s`, `offset: /lidar 5ms`",
        "syncrelay: front: 20 sets with the faults, 40 without",
    ]


def test_a_fault_that_changes_nothing_is_told(replayed):
    code, (sets, *_), said = replayed("--what-if", "dead: /lidar from 30s")
    assert (code, sets) == (0, "front: 40 sets")
    why = "the first message of /lidar came after 0 s, the last after 3.9 s"
    assert said.splitlines()[1] == f"syncrelay: `dead: /lidar from 30s` changed nothing: {why}"


def test_a_seed_decides_what_is_lost(replayed):
    lost = ("--what-if", "drop: /lidar 50%", "--json", "--seed")
    assert replayed(*lost, "1") == replayed(*lost, "1") != replayed(*lost, "2")
