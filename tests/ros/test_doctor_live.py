"""The doctor's look at a graph with everything wrong that can be seen there, over real DDS."""

import json
import subprocess
import sys
import time

import pytest

from tests.doctor.environments import unshared
from tests.ros.cdr_messages import CLOCK, IMAGE, VECTOR, serialize, vector
from tests.ros.cdr_messages import time as ros_time
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage
from tests.ros.streams import merged

pytestmark = pytest.mark.ros

S = 1_000_000_000
RATE_HZ = 20
# Longer than a doctor takes to look, also on a busy machine.
SPAN_S = 120


def now(topic, *, behind_s=0.0, stamped=True):
    """Vectors stamped as they are sent, or so much earlier."""
    begin = time.time_ns()
    sent = [begin + n * S // RATE_HZ for n in range(SPAN_S * RATE_HZ)]
    return [Frame(topic, VECTOR, at, vector(at - round(behind_s * S) if stamped else 0)) for at in sent]


def group(*topics, policy="exact_time", **keys):
    return {"policy": policy, "topics": inputs(dict.fromkeys(topics, VECTOR), **keys)}


def examine(stage: Stage, text: str, *words: str):
    path = stage.folder / "doctor.yaml"
    path.write_text(text)
    argv = [sys.executable, "-m", "syncrelay", "doctor", "--json", "--config", str(path), "--live", *words]
    done = subprocess.run(argv, env=stage.environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout, done.stderr
    report = json.loads(done.stdout)
    return done.returncode, [each for each in report["diagnoses"] if each["severity"] == "mend"], report


def test_topics_that_arrive_are_shown_with_rate_and_delay_and_nothing_is_to_mend(stage: Stage):
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR})
    player.start(merged(now("/camera"), now("/lidar", behind_s=0.3)), speed=1)
    code, to_mend, report = examine(stage, config({"front": group("/camera", "/lidar")}), "--seconds", "4")
    assert (code, to_mend) == (0, [])
    camera, lidar = report["graph"]["topics"]
    assert (camera["name"], lidar["name"]) == ("/camera", "/lidar")
    assert camera["publishers"] == [
        {"node": "/player", "type": VECTOR, "offers": "reliable, volatile", "mismatch": None}
    ]
    assert camera["received"] > 0
    assert 0 < camera["rate_hz"] < 10 * RATE_HZ
    assert lidar["delay_ns"] - camera["delay_ns"] > S // 10
    assert report["graph"]["nodes"] == ["/player"]


def test_every_fault_of_a_graph_is_named_with_its_topic(stage: Stage):
    player = stage.player(
        {"/left": VECTOR, "/right": VECTOR, "/zero": VECTOR, "/quiet": VECTOR, "/camera/image": VECTOR}
    )
    stage.player({"/lossy": VECTOR}, reliability="best_effort")
    stage.player({"/strange": IMAGE, "/clocks/left": VECTOR}, node="stranger")
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
    code, to_mend, _ = examine(stage, text, "--seconds", "5")
    assert code == 1
    said = {each["code"]: each for each in to_mend}
    assert set(said) == {"clocks_apart", "unstamped", "silent", "no_publisher", "other_type", "qos", "output_taken"}
    assert len(to_mend) == len(said)
    assert "clocks: the stamps of /right are 37.2 s behind those of /left" in said["clocks_apart"]["what"]
    assert "at /right: offset: 37." in said["clocks_apart"]["do"]
    assert said["unstamped"]["what"].startswith("/zero: ")
    assert said["silent"]["what"].startswith("/quiet is published by /player, but no message came in 5 s")
    assert "did you mean /camera/image" in said["no_publisher"]["do"]
    assert said["other_type"]["what"].startswith(f"/strange is published as another type by /stranger ({IMAGE})")
    assert said["output_taken"]["what"] == "/clocks/left, an output of the file, is published by /stranger"
    assert said["qos"]["what"].endswith(
        "(offers best_effort, volatile):\nbest effort publisher and reliable subscription"
    )


# Root's player ends with the doctor, who is another user: he may look where root may, and write nowhere.
OTHER_USER = """
mount -t tmpfs -o mode=1777 shm /dev/shm
(tail --pid=$$ -f /dev/null | {player}) >/dev/null 2>&1 &
set -- setpriv --reuid 65534 --regid 65534 --clear-groups {caps} "$@"
"""
MAY_READ = " ".join(f"--{kind}=-all,+dac_read_search" for kind in ("inh-caps", "ambient-caps", "bounding-set"))


def test_nodes_of_another_user_are_told_from_nodes_that_are_not_there(stage: Stage):
    (stage.folder / "doctor.yaml").write_text(config({"front": group("/camera", "/lidar")}))
    player = f"{sys.executable} -m tests.ros.player --topic /camera {VECTOR} --topic /lidar {VECTOR}"
    words = ["doctor", "--json", "--live", "--seconds", "8", "--config", str(stage.folder / "doctor.yaml")]
    command = unshared(["mount"], OTHER_USER.format(player=player, caps=MAY_READ), *words)
    environment = {**stage.environment, "HOME": str(stage.folder)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout, done.stderr
    said = {each["code"]: each for each in json.loads(done.stdout)["diagnoses"]}
    assert {"shm_foreign", "unreachable"} <= set(said)
    assert said["unreachable"]["what"].startswith("2 topics on domain")
    assert {"alone", "silent", "no_publisher"}.isdisjoint(said)


def test_alone_on_a_domain_it_says_so_once(stage: Stage):
    code, to_mend, report = examine(stage, config({"front": group("/camera", "/lidar")}), "--seconds", "1")
    assert code == 1
    assert [each["code"] for each in to_mend] == ["alone"]
    assert f"on domain {stage.domain}" in to_mend[0]["what"]
    assert report["graph"]["n_topics"] == 0


def test_simulated_time_is_what_stamps_are_held_against(stage: Stage):
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR, "/clock": CLOCK})
    frames = merged(now("/camera", behind_s=500_000), now("/lidar", behind_s=500_000))
    ticks = [
        Frame("/clock", CLOCK, frame.time, serialize(CLOCK, ros_time(frame.time - 500_000 * S))) for frame in frames
    ]
    player.start(merged(frames, ticks), speed=1)
    groups = {"front": group("/camera", "/lidar")}
    code, to_mend, report = examine(stage, config(groups, node={"use_sim_time": True}), "--seconds", "4")
    wall, _, off_clock = examine(stage, config(groups), "--seconds", "4")
    assert (code, to_mend, wall) == (0, [], 0)
    assert all(abs(topic["delay_ns"]) < S for topic in report["graph"]["topics"])
    assert {"clock_unused", "stamps_off_clock"} <= {each["code"] for each in off_clock["diagnoses"]}


def test_a_clock_that_is_missing_and_a_relay_of_the_same_name_are_seen(stage: Stage):
    text = config({"front": group("/camera", "/lidar")})
    relay = stage.relay(text)
    relay.wait_for_log("waiting for")
    arguments = ["--seconds", "3", "--ros-args", "-p", "use_sim_time:=true"]
    _, to_mend, report = examine(stage, text, *arguments)
    assert [each["code"] for each in to_mend] == ["no_clock", "no_publisher", "no_publisher"]
    assert "node_name" in {each["code"] for each in report["diagnoses"]}
    assert report["graph"]["nodes"] == ["/syncrelay"]


def test_names_are_those_after_remaps(stage: Stage):
    player = stage.player({"/robot1/camera": VECTOR, "/points": VECTOR})
    player.start(merged(now("/robot1/camera"), now("/points")), speed=1)
    remaps = ["--ros-args", "-r", "__ns:=/robot1", "-r", "/lidar:=/points"]
    code, to_mend, report = examine(stage, config({"front": group("camera", "/lidar")}), "--seconds", "3", *remaps)
    assert (code, to_mend) == (0, [])
    assert [topic["name"] for topic in report["graph"]["topics"]] == ["/robot1/camera", "/points"]
