"""A working rig, broken where the graph shows it: the relay's log and its state say what is wrong."""

import re
import signal
from collections.abc import Iterator
from typing import Any

import pytest

from tests.ros.cdr_messages import CLOCK, IMAGE, VECTOR, serialize, time
from tests.ros.configs import config, inputs
from tests.ros.domain import claimed_domain
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import (
    APPROXIMATE,
    BY_RECEIPT,
    LASTED,
    ON_AND_ON_MS,
    assert_logged,
    front,
    play,
    stream,
    wait_for_sets,
)
from tests.ros.stage import Stage, running_stage
from tests.ros.status import ANY_PORT, findings, first_group, get, page, status, wait_for_finding
from tests.ros.streams import BEGIN, MS, merged

pytestmark = pytest.mark.ros


def _group(camera: str, lidar: str, *, type_name: str = VECTOR, **keys: Any) -> dict[str, Any]:
    """A group of a camera that has these keys beside its type, and a lidar."""
    return {**APPROXIMATE, "topics": [*inputs({camera: type_name}, **keys), *inputs({lidar: VECTOR})]}


GROUPS = {
    "misspelt": _group("/misspelt/camra", "/misspelt/lidar"),
    "other_type": _group("/other_type/camera", "/other_type/lidar"),
    "reliable": _group("/reliable/camera", "/reliable/lidar", qos={"reliability": "reliable"}),
    "held": _group("/held/camera", "/held/lidar", qos={"durability": "transient_local"}),
    "quiet": _group("/quiet/camera", "/quiet/lidar"),
    "unheard": _group("/unheard/camera", "/unheard/lidar"),
    "not_installed": _group("/not_installed/camera", "/not_installed/lidar", type_name="fancy_msgs/msg/Fancy"),
}
WITHOUT_MESSAGES = ("misspelt", "other_type", "reliable", "held", "not_installed")


@pytest.fixture(scope="module")
def relay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """A relay of all groups, each of whose graphs is broken in a way of its own from the beginning."""
    with claimed_domain() as domain, running_stage(tmp_path_factory.mktemp("graphs"), domain) as stage:
        started = stage.relay(config(GROUPS, metrics=ANY_PORT))
        cameras = {"/misspelt/camera": VECTOR, "/other_type/camera": IMAGE, "/quiet/camera": VECTOR}
        stage.player(cameras, node="usb_cam")
        stage.player({"/held/camera": VECTOR}, node="durability_cam")
        stage.player({"/reliable/camera": VECTOR}, node="reliability_cam", reliability="best_effort")
        stage.collector({"/unheard/unheard/camera": VECTOR}, node="fusion", durability="transient_local")
        stage.player({f"/{name}/lidar": VECTOR for name in WITHOUT_MESSAGES}, node="ouster").match()
        sent = ("/quiet/lidar", "/unheard/camera", "/unheard/lidar")
        play(stage, merged(*(stream(topic, hz=10) for topic in sent)))
        yield started


def test_a_topic_that_nobody_publishes_is_named_with_the_one_that_was_meant(relay: Process):
    assert_logged(
        relay,
        rf"\[WARN\] .* misspelt: no set for {LASTED}: nobody publishes /misspelt/camra"
        r" \(geometry_msgs/msg/Vector3Stamped\); did you mean `topic: /misspelt/camera`\? It is published as"
        r" geometry_msgs/msg/Vector3Stamped\n",
    )
    assert first_group(relay)["level"] == "stale"


def test_a_publisher_of_another_type_is_named_with_both_types(relay: Process):
    assert_logged(
        relay,
        rf"no set for {LASTED}: /usb_cam publishes /other_type/camera as sensor_msgs/msg/Image, the file says"
        r" geometry_msgs/msg/Vector3Stamped; write `type: sensor_msgs/msg/Image`\n",
    )


@pytest.mark.parametrize(
    ("name", "policy", "offered", "requested"),
    [
        ("reliable", "reliability", "best_effort", "reliable"),
        ("held", "durability", "volatile", "transient_local"),
    ],
)
def test_an_incompatible_qos_is_named_with_its_policy_and_its_node(
    relay: Process, name: str, policy: str, offered: str, requested: str
):
    topic, node = f"/{name}/camera", f"/{policy}_cam"
    assert_logged(
        relay,
        rf"no set for {LASTED}: {node} offers {topic} with {policy} {offered}, the group requests {requested};"
        rf" write `qos: auto` at {topic}, or have {node} offer {requested}\n",
    )
    relay.wait_for_log(f"{name}: waiting for a publisher of {topic} with compatible QoS")


def test_a_publisher_that_sends_nothing_is_named(relay: Process):
    # Not in the log: it says ever less often what is worst, and that may be how busy the machine is.
    wait_for_finding(
        relay,
        "silent",
        "quiet",
        text=r"/usb_cam publishes /quiet/camera, but no message has arrived",
        suggestion=r"check with `ros2 topic hz /quiet/camera`.*",
    )


def test_a_subscriber_that_gets_nothing_is_told(relay: Process):
    assert_logged(
        relay,
        r"\[WARN\] .* unheard: /fusion requests /unheard/unheard/camera with durability transient_local, the relay"
        r" offers volatile, so it gets nothing; have /fusion request volatile, or /unheard/camera's publisher offer"
        r" transient_local\n",
    )


def test_a_type_that_is_not_installed_is_told(relay: Process):
    assert_logged(
        relay,
        rf"no set for {LASTED}: /not_installed/camera: .*fancy_msgs.*; install the package where the relay runs",
    )


# A publisher is taken for dead after 6 s without a word of its own, which it says every second; 20 s is the default.
_SHORT_LEASE = """\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short_lease" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>6</sec></leaseDuration>
    <leaseAnnouncement><sec>1</sec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles>
"""


def test_a_node_that_dies_and_comes_back_is_told(stage: Stage):
    relay = stage.relay(front(BY_RECEIPT, slop="100ms"))
    play(stage, stream("/camera", hz=10))
    profile = stage.folder / "short-lease.xml"
    profile.write_text(_SHORT_LEASE)
    stage.environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profile)
    ouster = play(stage, stream("/lidar", hz=10), node="ouster")
    wait_for_sets(relay, 4)
    ouster.process.send(signal.SIGKILL)
    assert_logged(
        relay,
        rf"no more sets for {LASTED}: nobody publishes /lidar \(geometry_msgs/msg/Vector3Stamped\) any more; its"
        rf" last message arrived {LASTED} ago; restart the node that published /lidar\n",
    )
    play(stage, stream("/lidar", hz=10), node="ouster")
    assert_logged(relay, rf"front: recovered after {LASTED}\n")


def test_a_clock_that_stands_still_is_told(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    times = [BEGIN + n * MS for n in range(0, ON_AND_ON_MS, 50)]
    ticks = [Frame("/clock", CLOCK, each, serialize(CLOCK, time(each))) for each in times]
    player = play(stage, merged(ticks, stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_for_sets(relay, 10)
    player.stop()
    assert_logged(
        relay,
        rf"no more sets for {LASTED}: /clock has stood still for {LASTED}: nothing that waits expires; start or resume"
        r" what publishes /clock, or run without use_sim_time\n",
    )


def test_probes_tell_a_relay_that_waits_from_one_that_is_ready(stage: Stage):
    relay = stage.relay(front())
    wait_until(lambda: page(relay, "/livez") == (200, "receiving\n"), "a relay that receives")
    wait_until(lambda: bool(findings(relay)), "a first look")
    assert status(relay)["relay"]["ready"] is False
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_until(lambda: status(relay)["relay"]["ready"], "the relay to be ready")
    wait_until(lambda: page(relay, "/readyz") == (200, "ready\n"), "a probe that says so")
    assert 'syncrelay_messages_received_total{group="front",topic="/camera"}' in get(relay, "/metrics")


def test_nobody_is_missed_before_those_who_run_had_time_to_be_found(stage: Stage):
    """One that missed the first announcements is found at the next: up to 3 s after the start, and a little."""
    relay = stage.relay(front())
    said: dict[str, float] = {}

    def nobody_is_found() -> bool:
        now = status(relay)
        for each in (each for group in now["groups"] for each in group["findings"]):
            said.setdefault(each["code"], now["relay"]["uptime_s"])
        return "alone" in said or "no_publisher" in said

    wait_until(nobody_is_found, "a finding that nobody is there")
    assert said["starting"] < 3.5
    assert min(said.get("alone", 99), said.get("no_publisher", 99)) > 3.5


def test_a_recording_that_is_looped_is_no_warning_at_each_loop(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    once = merged(stream("/camera", hz=20, last_ms=3000), stream("/lidar", hz=10, last_ms=3000))
    ticks = [
        Frame("/clock", CLOCK, each, serialize(CLOCK, time(each))) for each in range(BEGIN, BEGIN + 3000 * MS, 20 * MS)
    ]
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR, "/clock": CLOCK})
    player.match()
    for _ in range(4):
        player.play(merged(once, ticks), speed=1)
    relay.wait_for_log("the clock jumped back")
    assert not re.findall(r"\[WARN\].*(?:jump|back).*", relay.stderr)
    said = findings(relay)
    assert {each["severity"] for each in said.values() if each["code"] == "time_jump"} <= {"ok"}
