"""What a relay finds where DDS shows or hides something, which virtual time cannot play; see tests/scenarios too."""

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
from tests.ros.sensors import APPROXIMATE, BY_RECEIPT, ON_AND_ON_MS, PAIR, front, play, stream, wait_for_sets
from tests.ros.stage import Stage, running_stage
from tests.ros.status import ANY_PORT, findings, first_group, get, page, status, wait_for_finding
from tests.ros.streams import BEGIN, MS, at, merged

pytestmark = pytest.mark.ros


def _group(camera: str, lidar: str, *, type_name: str = VECTOR, **keys: Any) -> dict[str, Any]:
    """A group of a camera that has these keys beside its type, and a lidar."""
    return {**APPROXIMATE, "topics": [*inputs({camera: type_name}, **keys), *inputs({lidar: VECTOR})]}


# A group, its level, the code of what explains it, and what that names.
BROKEN: dict[str, tuple[dict[str, Any], str, tuple[str, ...]]] = {
    "misspelt": (
        _group("/misspelt/camra", "/misspelt/lidar"),
        "no_publisher",
        ("/misspelt/camra", "`topic: /misspelt/camera`"),
    ),
    "other_type": (
        _group("/other_type/camera", "/other_type/lidar"),
        "other_type",
        ("/usb_cam", "/other_type/camera", IMAGE, f"`type: {IMAGE}`"),
    ),
    "reliable": (
        _group("/reliable/camera", "/reliable/lidar", qos={"reliability": "reliable"}),
        "incompatible_qos",
        ("/reliability_cam", "/reliable/camera", "best_effort", "`qos: auto`"),
    ),
    "held": (
        _group("/held/camera", "/held/lidar", qos={"durability": "transient_local"}),
        "incompatible_qos",
        ("/durability_cam", "/held/camera", "volatile", "transient_local", "`qos: auto`"),
    ),
    "quiet": (_group("/quiet/camera", "/quiet/lidar"), "silent", ("/usb_cam", "/quiet/camera")),
    "unheard": (
        _group("/unheard/camera", "/unheard/lidar"),
        "subscriber_qos",
        ("/fusion", "/unheard/unheard/camera", "transient_local"),
    ),
    "not_installed": (
        _group("/not_installed/camera", "/not_installed/lidar", type_name="fancy_msgs/msg/Fancy"),
        "type_not_importable",
        ("/not_installed/camera", "fancy_msgs"),
    ),
}


@pytest.fixture(scope="module")
def relay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """A relay of all groups, each of whose graphs is broken in a way of its own from the beginning."""
    with claimed_domain() as domain, running_stage(tmp_path_factory.mktemp("graphs"), domain) as stage:
        started = stage.relay(config({name: group for name, (group, *_) in BROKEN.items()}, metrics=ANY_PORT))
        cameras = {"/misspelt/camera": VECTOR, "/other_type/camera": IMAGE, "/quiet/camera": VECTOR}
        stage.player(cameras, node="usb_cam")
        stage.player({"/held/camera": VECTOR}, node="durability_cam")
        stage.player({"/reliable/camera": VECTOR}, node="reliability_cam", reliability="best_effort")
        stage.collector({"/unheard/unheard/camera": VECTOR}, node="fusion", durability="transient_local")
        without_messages = (f"/{name}/lidar" for name in BROKEN if name not in ("quiet", "unheard"))
        stage.player(dict.fromkeys(without_messages, VECTOR), node="ouster").match()
        sent = ("/quiet/lidar", "/unheard/camera", "/unheard/lidar")
        play(stage, merged(*(stream(topic, hz=10) for topic in sent)))
        yield started


@pytest.mark.parametrize("name", BROKEN)
def test_what_the_graph_shows_is_found_and_named(relay: Process, name: str):
    _, code, named = BROKEN[name]
    wait_for_finding(relay, code, name, naming=named)
    relay.wait_for_log(f"{name}: ")


def test_what_is_absent_is_named_once_and_the_group_runs_when_it_comes_beside_a_stranger(stage: Stage):
    relay = stage.relay(config({"front": {"policy": "exact_time", "topics": inputs(PAIR)}}))
    camera = stage.player({"/camera": VECTOR})
    stage.player({"/camera": IMAGE}, node="stranger")
    camera.match()
    relay.wait_for_log("front: waiting for a publisher of /lidar")
    # A message that comes and goes while another is missing is no reason to say it again.
    camera.play(at("/camera", *range(0, 3000, 100)), speed=1)
    stage.player({"/lidar": VECTOR}).match()
    relay.wait_for_log("front: running")
    relay.wait_for_log(f"/camera: /stranger publishes it as {IMAGE}, the file says {VECTOR}")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    assert relay.stderr.count("front: waiting for a publisher of /lidar") == 1


def test_a_type_that_is_not_installed_is_logged_once(relay: Process):
    wait_for_finding(relay, "type_not_importable", "not_installed")
    assert relay.stderr.count("[syncrelay]: /not_installed/camera: fancy_msgs/msg/Fancy cannot be imported") == 1


def test_a_group_that_gets_nothing_is_stale(relay: Process):
    wait_until(lambda: first_group(relay)["level"] == "stale", "a group without any message to be stale")


def test_sensors_of_one_node_that_fall_silent_are_one_line_over_all_groups(stage: Stage):
    hub = ("/imu", "/gps", "/odom")
    # Whoever starts 10 s after the other still finds its partners.
    options = {**APPROXIMATE, "queue_size": 100}
    groups = {
        f"with{topic.replace('/', '_')}": {**options, "topics": inputs(dict.fromkeys(("/lidar", topic), VECTOR))}
        for topic in hub
    }
    relay = stage.relay(config(groups, metrics=ANY_PORT))
    play(stage, stream("/lidar", hz=10), node="ouster")
    stopped = play(stage, merged(*(stream(topic, hz=10) for topic in hub)), node="hub")
    wait_until(lambda: sum(each["rate_hz"] > 5 for each in status(relay)["groups"]) == len(hub), "sets of all groups")
    stopped.process.send(signal.SIGSTOP)
    relay.wait_for_log(r"no more sets for ")
    lines = [line for line in relay.stderr.splitlines() if "no more sets for " in line]
    stopped.process.send(signal.SIGCONT)
    assert len(lines) == 1
    assert "3 groups (with_imu, with_gps and with_odom): " in lines[0]
    assert all(topic in lines[0] for topic in (*hub, "/hub")), lines
    relay.wait_for_log("3 groups (with_imu, with_gps and with_odom): recovered after ")


def test_messages_that_dds_lost_while_the_relay_stood_still_are_counted_and_the_relay_is_blamed(stage: Stage):
    # What a socket cannot hold is lost for certain, what shared memory cannot hold only sometimes.
    stage.environment["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    relay = stage.relay(front(slop="10s"))
    collector = stage.collector({"/camera": VECTOR}, reliability="best_effort")
    fast = stream("/camera", hz=50)

    def camera() -> dict[str, Any]:
        return next((group["inputs"][0] for group in status(relay)["groups"]), {"received": 0})

    big = serialize("std_msgs/msg/String", "x" * 10_000)
    play(stage, stream("/lidar", hz=10))
    play(stage, [frame._replace(payload=frame.payload + big) for frame in fast], reliability="best_effort")
    # What is lost in a publisher's first looks is what it sent before it was heard.
    wait_until(lambda: camera()["received"] > 200, "messages of four seconds")
    lost = camera()["lost"]
    relay.send(signal.SIGSTOP)
    sent = collector.count("/camera")
    collector.wait_for("/camera", sent + 100)
    relay.send(signal.SIGCONT)
    said: set[str] = set()

    def is_blamed() -> bool:
        nonlocal said
        (group,) = status(relay)["groups"]
        said = {each["code"] for each in group["findings"]}
        return "too_slow" in said and group["inputs"][0]["lost"] > lost

    wait_until(is_blamed, "a relay that is too slow, and losses that are counted")
    assert "messages_lost" not in said
    counted = re.search(r'syncrelay_messages_lost_total\{group="front",topic="/camera"\} (\S+)', get(relay, "/metrics"))
    assert counted
    assert float(counted[1]) > 0


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
    wait_for_finding(relay, "no_publisher", naming=["/lidar"])
    play(stage, stream("/lidar", hz=10), node="ouster")
    relay.wait_for_log("front: recovered after ")


def _ticks(last_ms: int, every_ms: int) -> list[Frame]:
    times = [BEGIN + n * MS for n in range(0, last_ms, every_ms)]
    return [Frame("/clock", CLOCK, each, serialize(CLOCK, time(each))) for each in times]


def test_a_clock_that_stands_still_is_told(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    player = play(stage, merged(_ticks(ON_AND_ON_MS, 50), stream("/camera", hz=10), stream("/lidar", hz=10)))
    wait_for_sets(relay, 10)
    player.stop()
    wait_for_finding(relay, "clock_stopped", naming=["/clock"])


def test_a_recording_that_is_looped_is_no_warning_at_each_loop(stage: Stage):
    relay = stage.relay(front(top={"node": {"use_sim_time": True}}))
    once = merged(stream("/camera", hz=20, last_ms=3000), stream("/lidar", hz=10, last_ms=3000), _ticks(3000, 20))
    player = stage.player({"/camera": VECTOR, "/lidar": VECTOR, "/clock": CLOCK})
    player.match()
    for _ in range(4):
        player.play(once, speed=1)
    relay.wait_for_log("the clock jumped back")
    assert not re.findall(r"\[WARN\].*(?:jump|back).*", relay.stderr)
    assert findings(relay).get("time_jump", {"severity": "ok"})["severity"] == "ok"


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
    seen: dict[str, Any] = {}

    def nobody_is_found() -> bool:
        seen.update(status(relay))
        codes = {each["code"] for group in seen["groups"] for each in group["findings"]}
        return not codes.isdisjoint({"alone", "no_publisher"})

    wait_until(nobody_is_found, "a finding that nobody is there")
    assert seen["relay"]["uptime_s"] > 3.5
