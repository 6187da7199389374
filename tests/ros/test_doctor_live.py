"""The doctor's look at a graph with everything wrong that can be seen there, over real DDS."""

import json
import shlex
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests import preloaded
from tests.doctor.environments import unshared
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import ours_of
from tests.ros.sensors import OF_A_BUSY_MACHINE
from tests.ros.stage import Stage
from tests.ros.streams import merged

pytestmark = pytest.mark.ros

S = 1_000_000_000
RATE_HZ = 20
# Longer than a doctor takes to look, also on a busy machine.
SPAN_S = 240
REPORTS = ("--json", "--live", "--config")


def now(topic, *, behind_s=0.0):
    """Vectors stamped as they are sent, or so much earlier."""
    begin = time.time_ns()
    sent = [begin + n * S // RATE_HZ for n in range(SPAN_S * RATE_HZ)]
    return [Frame(topic, VECTOR, at, vector(at - round(behind_s * S))) for at in sent]


def group(*topics, policy="exact_time", **keys):
    return {"policy": policy, "topics": inputs(dict.fromkeys(topics, VECTOR), **keys)}


class Examined(NamedTuple):
    """The exit code, what is no mere information, and all that was told."""

    code: int
    problems: list[dict[str, Any]]
    report: dict[str, Any]
    talk: str


def examine(
    stage: Stage, text: str, *words: str, seconds: int = 3, until: Callable[[Examined], bool] = lambda _: True
) -> Examined:
    """What the doctor says; it looks for longer where a busy machine showed it too little of what there is."""
    path = stage.folder / "doctor.yaml"
    path.write_text(text)
    for look_s in longer(seconds):
        argv = [*REPORTS, str(path), "--seconds", f"{look_s}", *words]
        examined = run([sys.executable, "-m", "syncrelay", "doctor", *argv], stage.environment)
        assert ours_of(examined.talk) == []
        # A publisher is found before the name of its node.
        if until(examined) and "whose node is not known yet" not in str(examined.report):
            break
    return examined


def longer(seconds: int) -> list[int]:
    return [seconds, 2 * seconds, max(15, 3 * seconds), max(40, 8 * seconds)]


def run(argv: Sequence[str], environment: Mapping[str, str]) -> Examined:
    done = preloaded.run(argv, environ=environment, folder=Path.cwd())
    assert done.stdout, done.stderr
    report = json.loads(done.stdout)
    problems = [each for each in report["diagnoses"] if each["severity"] != "info"]
    told = [each for each in problems if each["code"] not in OF_A_BUSY_MACHINE - {"silent"}]
    return Examined(done.returncode, told, report, done.stderr)


def all_arrives(examined: Examined) -> bool:
    # A lag is of the last seconds: where the machine held everything up until the look's end, there is none.
    return not examined.problems and all(
        topic["received"] and topic["lag_ms"] is not None for topic in topics_of(examined.report)
    )


def codes(found):
    return [each["code"] for each in found]


def topics_of(report):
    return [topic for group in report["groups"] for topic in group["inputs"]]


def test_topics_that_arrive_are_shown_by_their_names_after_remaps_with_rate_and_lag_and_nothing_is_wrong(stage: Stage):
    player = stage.player({"/robot1/camera": VECTOR, "/points": VECTOR})
    player.is_up()
    player.start(merged(now("/robot1/camera"), now("/points", behind_s=0.3)), speed=1)
    # The file leaves out a type, which the graph has.
    topics = [{"topic": "camera"}, *inputs({"/lidar": VECTOR})]
    text = config({"front": {"policy": "approximate_time", "slop": "1s", "topics": topics}})
    remaps = ["--ros-args", "-r", "__ns:=/robot1", "-r", "__node:=fusion", "-r", "fusion:/lidar:=/points"]
    _, problems, report, _ = examine(stage, text, *remaps, until=all_arrives)
    assert problems == []
    assert "not_checked" in codes(report["diagnoses"])
    camera, lidar = topics_of(report)
    assert [(each["topic"], each["type"]) for each in (camera, lidar)] == [
        ("/robot1/camera", VECTOR),
        ("/points", VECTOR),
    ]
    assert camera["publishers"] == [{"node": "/player", "type": VECTOR, "mismatch": None}]
    assert camera["received"] > 0
    assert lidar["lag_ms"] - camera["lag_ms"] > 100
    assert (report["graph"]["nodes"], report["graph"]["n_topics"]) == (["/player"], 2)


# Root's player ends with the doctor, who is another user: he may look where root may, and write nowhere.
OTHER_USER = """
mount -t tmpfs -o mode=1777 shm /dev/shm
(tail --pid=$$ -f /dev/null | {player}) >/dev/null 2>&1 &
set -- setpriv --reuid 65534 --regid 65534 --clear-groups {caps} "$@"
"""
MAY_READ = " ".join(f"--{kind}=-all,+dac_read_search" for kind in ("inh-caps", "ambient-caps", "bounding-set"))


def test_nodes_of_another_user_are_told_from_nodes_that_are_not_there(stage: Stage):
    (stage.folder / "doctor.yaml").write_text(config({"front": group("/camera", "/lidar")}))
    player = f"{shlex.quote(sys.executable)} -m tests.ros.player --topic /camera {VECTOR} --topic /lidar {VECTOR}"
    environment = {**stage.environment, "HOME": str(stage.folder)}
    said: dict[str, dict[str, Any]] = {}
    for look_s in longer(8):
        words = ["doctor", "--seconds", f"{look_s}", *REPORTS, str(stage.folder / "doctor.yaml")]
        examined = run(unshared(["mount"], OTHER_USER.format(player=player, caps=MAY_READ), *words), environment)
        said = {each["code"]: each for each in examined.report["diagnoses"]}
        if "shm_foreign" in said and said.get("unreachable", {"what": ""})["what"].startswith("2 topics on domain"):
            break
    assert "shm_foreign" in said
    assert said["unreachable"]["what"].startswith("2 topics on domain")
    assert {"alone", "silent", "no_publisher"}.isdisjoint(said)
    nodes = {each["node"] for topic in topics_of(examined.report) for each in topic["publishers"]}
    assert nodes == {"a publisher whose node is not known yet"}
