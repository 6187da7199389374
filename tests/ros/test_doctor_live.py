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
from tests.ros.cdr_messages import CLOCK, IMAGE, VECTOR, serialize, vector
from tests.ros.cdr_messages import time as ros_time
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


def now(topic, *, behind_s=0.0, stamped=True, once=False):
    """Vectors stamped as they are sent, or so much earlier."""
    begin = time.time_ns()
    sent = [begin + n * S // RATE_HZ for n in range(1 if once else SPAN_S * RATE_HZ)]
    return [Frame(topic, VECTOR, at, vector(at - round(behind_s * S) if stamped else 0)) for at in sent]


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


def test_topics_that_arrive_are_shown_with_rate_and_lag_and_nothing_is_wrong(stage: Stage):
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR})
    player.is_up()
    player.start(merged(now("/camera"), now("/lidar", behind_s=0.3)), speed=1)
    # The file leaves out a type, which the graph has.
    topics = [{"topic": "/camera"}, *inputs({"/lidar": VECTOR})]
    text = config({"front": {"policy": "approximate_time", "slop": "1s", "topics": topics}})
    _, problems, report, _ = examine(stage, text, until=all_arrives)
    assert problems == []
    assert "not_checked" in codes(report["diagnoses"])
    camera, lidar = topics_of(report)
    assert [(each["topic"], each["type"]) for each in (camera, lidar)] == [("/camera", VECTOR), ("/lidar", VECTOR)]
    assert camera["publishers"] == [{"node": "/player", "type": VECTOR, "mismatch": None}]
    assert camera["received"] > 0
    assert lidar["lag_ms"] - camera["lag_ms"] > 100
    assert (report["graph"]["nodes"], report["graph"]["n_topics"]) == (["/player"], 2)


def test_every_fault_of_a_graph_is_named_with_its_topic(stage: Stage):
    player = stage.player(
        {"/left": VECTOR, "/right": VECTOR, "/zero": VECTOR, "/quiet": VECTOR, "/camera/image": VECTOR}
    )
    stage.player({"/lossy": VECTOR}, reliability="best_effort")
    stage.player({"/strange": IMAGE, "/clocks/left": VECTOR}, node="stranger")
    player.is_up()
    player.start(
        merged(now("/left"), now("/right", behind_s=37.2), now("/zero", stamped=False), now("/camera/image")), speed=1
    )
    text = config(
        {
            "clocks": group("/left", "/right"),
            "zero": group("/left", "/zero"),
            "quiet": group("/left", "/quiet"),
            "misspelt": group("/left", "/camera/imag"),
            "typed": group("/left", "/strange"),
            "strict": {
                "policy": "exact_time",
                "topics": [*inputs({"/left": VECTOR}), *inputs({"/lossy": VECTOR}, qos={"reliability": "reliable"})],
            },
        }
    )
    faults = {
        "other_clock",
        "unstamped",
        "silent",
        "no_publisher",
        "other_type",
        "incompatible_qos",
        "output_taken",
    }
    code, problems, *_ = examine(stage, text, seconds=8, until=lambda seen: faults <= set(codes(seen.problems)))
    assert code == 1
    said = {each["code"]: each for each in problems}
    assert set(said) >= faults
    assert "37.2 s" in said["other_clock"]["what"]
    assert said["unstamped"]["what"].startswith("zero: ")
    assert "/quiet" in said["silent"]["what"]
    assert "doctor" not in said["silent"]["fix"]
    assert said["no_publisher"]["what"].startswith("misspelt: ")
    assert "`topic: /camera/image`" in said["no_publisher"]["fix"]
    assert all(name in said["other_type"]["what"] for name in ("/stranger", "/strange", IMAGE))
    assert all(name in said["output_taken"]["what"] for name in ("clocks: ", "/stranger", "/clocks/left"))
    assert "best_effort" in said["incompatible_qos"]["what"]
    assert said["incompatible_qos"]["impact"] == "no sets from strict"


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


def test_without_a_file_it_says_who_is_there(stage: Stage):
    stage.player({"/camera": VECTOR}, node="usb_cam").is_up()
    for look_s in longer(3):
        argv = [sys.executable, "-m", "syncrelay", "doctor", "--json", "--live", "--seconds", f"{look_s}"]
        report = run(argv, stage.environment).report
        # A publisher is found before the name of its node.
        if report["graph"]["nodes"] and report["graph"]["n_topics"]:
            break
    assert (report["graph"]["nodes"], report["graph"]["n_topics"]) == (["/usb_cam"], 1)
    assert report["groups"] == []


def test_simulated_time_is_no_fault_and_one_that_is_not_used_is_told(stage: Stage):
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR, "/clock": CLOCK})
    player.is_up()
    frames = merged(now("/camera", behind_s=500_000), now("/lidar", behind_s=500_000))
    ticks = [
        Frame("/clock", CLOCK, frame.time, serialize(CLOCK, ros_time(frame.time - 500_000 * S))) for frame in frames
    ]
    player.start(merged(frames, ticks), speed=1)
    groups = {"front": {**group("/camera", "/lidar", policy="approximate_time"), "slop": "1s"}}
    _, problems, *_ = examine(stage, config(groups, node={"use_sim_time": True}), until=all_arrives)
    _, wall_problems, off_clock, _ = examine(
        stage,
        config(groups),
        until=lambda seen: all_arrives(seen) and "clock_unused" in codes(seen.report["diagnoses"]),
    )
    assert (problems, wall_problems) == ([], [])
    assert "clock_unused" in codes(off_clock["diagnoses"])


def test_a_relay_of_the_same_name_is_seen_and_is_told_nothing_of_the_look(stage: Stage):
    text = config({"front": group("/camera", "/lidar")})
    relay = stage.relay(text)
    relay.wait_for_log("waiting for")
    _, problems, report, _ = examine(
        stage, text, until=lambda seen: {"node_name", "no_publisher"} <= set(codes(seen.report["diagnoses"]))
    )
    assert "no_publisher" in codes(problems)
    assert not {"alone", "output_taken"} & set(codes(problems))
    assert "node_name" in codes(report["diagnoses"])
    assert report["graph"]["nodes"] == ["/syncrelay"]


def test_names_are_those_after_remaps_also_of_remaps_for_the_relays_node(stage: Stage):
    player = stage.player({"/robot1/camera": VECTOR, "/points": VECTOR})
    player.is_up()
    player.start(merged(now("/robot1/camera"), now("/points")), speed=1)
    remaps = ["--ros-args", "-r", "__ns:=/robot1", "-r", "__node:=fusion", "-r", "fusion:/lidar:=/points"]
    text = config({"front": {**group("camera", "/lidar", policy="approximate_time"), "slop": "1s"}})
    _, problems, report, _ = examine(stage, text, *remaps, until=all_arrives)
    assert problems == []
    assert [topic["topic"] for topic in topics_of(report)] == ["/robot1/camera", "/points"]


def test_several_topics_in_another_namespace_are_named_with_it_and_not_the_outputs_of_a_relay(stage: Stage):
    player = stage.player({"/robot1/camera": VECTOR, "/robot1/imu": VECTOR})
    player.is_up()
    player.start(merged(now("/robot1/camera"), now("/robot1/imu")), speed=1)
    stage.relay(config({"front": group("/robot1/camera", "/robot1/imu")}, diagnostics=None))
    _, problems, *_ = examine(
        stage,
        config({"front": group("/camera", "/imu")}),
        # Those of the player, the relay's outputs and its manifest.
        until=lambda seen: seen.report["graph"]["n_topics"] == 5 and len(seen.problems) == 1,
    )
    (found,) = problems
    assert found["code"] == "no_publisher"
    assert all(name in found["what"] for name in ("front: ", "/camera", "/imu"))
    assert all(name in found["fix"] for name in ("/robot1/camera", "/robot1/imu"))
