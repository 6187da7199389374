"""A file proposed for the topics of a graph, over real DDS: it is in order, and gives sets there."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from syncrelay.config import load
from tests import preloaded
from tests.ros.cdr_messages import STRING, VECTOR, serialize, vector
from tests.ros.frames import Frame
from tests.ros.processes import ours_of
from tests.ros.stage import Stage
from tests.ros.streams import merged

pytestmark = pytest.mark.ros

_MS = 1_000_000
# Longer than listening and a relay's start take, also on a busy machine.
_SPAN_MS = 180_000
# How long to listen: as long as ten messages take to come, and again for longer where a busy machine was in their way.
LOOKS_S = (3, 6, 15, 45)


def _sent(topic: str, *, period_ms: int, begin: int, after_ms: int = 0) -> list[Frame]:
    """Vectors sent from then on, each stamped as it is sent."""
    sent = [begin + (n + after_ms) * _MS for n in range(0, _SPAN_MS, period_ms)]
    return [Frame(topic, VECTOR, at, vector(at)) for at in sent]


def _init(stage: Stage, *words: str) -> subprocess.CompletedProcess[str]:
    argv = [sys.executable, "-m", "syncrelay", "init", "--from-graph", *words]
    return preloaded.run(argv, environ=stage.environment, folder=stage.folder)


def _init_of_all(stage: Stage, written: Path, *topics: str, said: str = "") -> subprocess.CompletedProcess[str]:
    """Have a file written; again for longer where a busy machine showed too little of the graph meanwhile."""
    for seconds in LOOKS_S:
        written.unlink(missing_ok=True)
        done = _init(stage, "--seconds", f"{seconds}", "-o", str(written))
        if done.returncode or said not in done.stderr:
            continue
        if {topic.topic for topic in load(str(written)).groups[0].topics} == set(topics):
            break
    return done


def test_what_it_writes_is_in_order_and_gives_sets_of_that_graph(stage: Stage):
    reliable = stage.player({"/camera": VECTOR, "/lidar": VECTOR})
    lossy = stage.player({"/imu": VECTOR, "/log": STRING}, reliability="best_effort")
    reliable.is_up()
    lossy.is_up()
    # Made first: on a busy machine, what is made between the two starts would set the second behind the first.
    begin = time.time_ns()
    lidar = _sent("/lidar", period_ms=100, after_ms=12, begin=begin)
    vectors = merged(_sent("/camera", period_ms=50, begin=begin), lidar)
    words = [Frame("/log", STRING, begin + n * 100 * _MS, serialize(STRING, "x")) for n in range(_SPAN_MS // 100)]
    others = merged(_sent("/imu", period_ms=20, begin=begin), words)
    reliable.start(vectors, speed=1)
    lossy.start(others, speed=1)
    written = stage.folder / "new.yaml"
    left_out = f"syncrelay: left out: /log ({STRING}): its type has no header, so no stamp to match by"
    done = _init_of_all(stage, written, "/camera", "/lidar", "/imu", said=left_out)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert ours_of(done.stderr) == [left_out, f"syncrelay: wrote {written}"]

    (group,) = load(str(written)).groups
    assert {topic.topic for topic in group.topics} == {"/camera", "/lidar", "/imu"}
    assert group.options.policy == "approximate_time"
    text = written.read_text()
    assert re.search(rf"possible sets of ({'|'.join(map(str, LOOKS_S))}) s of the graph", text)
    (imu,) = (line for line in text.splitlines() if "topic: /imu" in line)
    assert imu.endswith(", best_effort")

    collector = stage.collector({topic.output: VECTOR for topic in group.topics}, reliability="best_effort")
    stage.relay(text)
    for topic in group.topics:
        collector.wait_for(topic.output, 10)

    published = sorted([*(topic.output for topic in group.topics), f"/syncrelay/{group.name}/sets"])
    left_out = f"left out: published by a running relay: {', '.join(published)}\n"
    again = _init_of_all(stage, stage.folder / "again.yaml", "/camera", "/lidar", "/imu", said=left_out)
    assert left_out in again.stderr
    (group,) = load(str(stage.folder / "again.yaml")).groups
    assert {topic.topic for topic in group.topics} == {"/camera", "/lidar", "/imu"}


def test_an_empty_graph_is_named(stage: Stage):
    done = _init(stage, "--seconds", "1")
    assert (done.returncode, done.stdout) == (1, "")
    assert ours_of(done.stderr)[0].startswith(
        "syncrelay: no two topics of 1 s of the graph have stamps and at least 10 messages"
    )
    assert "nobody publishes anything that can be used here" in done.stderr


def test_it_can_be_stopped_while_it_listens(stage: Stage):
    player = stage.player({"/left": VECTOR})
    process = stage.start("init", [sys.executable, "-m", "syncrelay", "init", "--from-graph", "--seconds", "600"])
    player.match()
    process.send(signal.SIGINT)
    assert (process.wait(), process.stdout) == (130, "")
