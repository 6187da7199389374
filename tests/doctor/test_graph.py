"""What was seen of the graph, by values."""

from dataclasses import replace

import pytest

from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.graph import (
    check_clock,
    check_company,
    check_outputs,
    check_own_name,
    check_sizes,
    check_topics,
)
from syncrelay.doctor.stamps import Matched, check_stamps
from syncrelay.ros.sighting import SeenOutput, SeenPublisher, SeenTopic, Sighting

IMAGE, IMU = "sensor_msgs/msg/Image", "sensor_msgs/msg/Imu"
MEND, KNOW = Severity.MEND, Severity.KNOW
S = 1_000_000_000
CAMERA = SeenPublisher("/camera_driver", IMAGE, "reliable, volatile")


def sighting(*topics, nodes=("/camera_driver",), clocks=0, ticks=0, nameless=0):
    return Sighting(5.0, nodes, 3, nameless, topics, clocks, ticks)


def brief(diagnoses):
    return [(each.code, each.severity) for each in diagnoses]


def image(**facts):
    return SeenTopic("/image", IMAGE, **{"publishers": (CAMERA,), "received": 50, "delays": (S // 100,) * 50, **facts})


@pytest.mark.parametrize(
    ("topic", "found"),
    [
        (image(), []),
        (image(publishers=(), received=0), ["no_publisher"]),
        (image(publishers=(SeenPublisher("/x", IMU, ""),), received=0), ["other_type"]),
        (image(publishers=(SeenPublisher("/x", IMAGE, "", "best effort publisher"),), received=0), ["qos"]),
        (image(received=0), ["silent"]),
    ],
)
def test_a_topic_that_brings_nothing_is_told_with_its_cause(topic, found):
    assert brief(check_topics(sighting(topic), optional=frozenset())) == [(code, MEND) for code in found]
    assert brief(check_topics(sighting(topic), optional=frozenset(["/image"]))) == [(code, KNOW) for code in found]


def test_a_stranger_beside_a_fitting_publisher_is_only_to_know():
    topic = image(publishers=(CAMERA, SeenPublisher("/x", IMU, "")))
    (found,) = check_topics(sighting(topic), optional=frozenset())
    assert found.severity is KNOW
    assert f"/x ({IMU})" in found.what


def test_two_publishers_of_one_topic_are_to_know():
    (found,) = check_topics(
        sighting(image(publishers=(CAMERA, SeenPublisher("/twin", IMAGE, "")))), optional=frozenset()
    )
    assert (found.code, found.severity) == ("several_publishers", KNOW)
    assert found.what == "/image is published by /camera_driver and /twin"


def test_an_output_that_others_publish_is_to_mend_but_not_the_relays_own():
    outputs = (SeenOutput("/front/image", ("/syncrelay", "/bag", "/bag")), SeenOutput("/front/imu", ("/syncrelay",)))
    (found,) = check_outputs(replace(sighting(image()), outputs=outputs), "/syncrelay")
    assert (found.code, found.severity) == ("output_taken", MEND)
    assert found.what == "/front/image, an output of the file, is published by /bag"


def test_messages_over_the_shared_memory_are_to_know_with_their_size():
    assert list(check_sizes(sighting(image(largest=524_288)))) == []
    (found,) = check_sizes(sighting(image(largest=6_220_856), image(largest=524_289)))
    assert (found.code, found.severity) == ("large_messages", KNOW)
    assert found.what.startswith("messages of /image (6.2 MB) and /image (0.5 MB) are larger than the 0.5 MB")


def test_alone_is_said_once():
    seen = sighting(image(publishers=(), received=0), nodes=())
    assert brief(check_company(seen, domain=3, discovery_range="SUBNET")) == [("alone", MEND)]
    assert list(check_topics(seen, optional=frozenset())) == []
    assert list(check_company(sighting(), domain=3, discovery_range="SUBNET")) == []


def test_nodes_that_are_found_but_do_not_get_through_are_not_taken_for_absent():
    nameless = SeenPublisher("", IMAGE, "reliable, volatile")
    seen = sighting(image(publishers=(nameless,), received=0), SeenTopic("/imu", IMU), nodes=(), nameless=1)
    (found,) = check_company(seen, domain=3, discovery_range="SUBNET")
    assert (found.code, found.severity) == ("unreachable", MEND)
    assert "let UDP ports 8150 to 8399 through" in found.do
    assert brief(check_topics(seen, optional=frozenset())) == [("no_publisher", MEND)]


@pytest.mark.parametrize(("count", "found"), [(0, []), (1, [("node_name", KNOW)]), (2, [("node_name", MEND)])])
def test_nodes_of_the_relays_name(count, found):
    assert brief(check_own_name(sighting(nodes=("/syncrelay",) * count), "/syncrelay")) == found


@pytest.mark.parametrize(
    ("clocks", "ticks", "use_sim_time", "found"),
    [
        (0, 0, False, []),
        (1, 9, True, []),
        (0, 0, True, [("no_clock", MEND)]),
        (1, 0, True, [("clock_silent", MEND)]),
        (1, 9, False, [("clock_unused", KNOW)]),
    ],
)
def test_the_clock(clocks, ticks, use_sim_time, found):
    assert brief(check_clock(sighting(clocks=clocks, ticks=ticks), use_sim_time=use_sim_time)) == found


def topics(**delays):
    return [SeenTopic(f"/{name}", IMAGE, received=3, delays=(delay,) * 3) for name, delay in delays.items()]


def group(*names, **offsets):
    return Matched("front", {f"/{name}": offsets.get(name, 0) for name in names})


def test_a_topic_whose_clock_is_off_is_named_with_the_offset_that_mends_it():
    seen = topics(camera=37_300_000_000, lidar=100_000_000, imu=2_000_000)
    (found,) = check_stamps(seen, [group("camera", "lidar", "imu", camera=-12_000_000)])
    assert (found.code, found.severity) == ("clocks_apart", MEND)
    assert found.what.startswith("front: the stamps of /camera are 37.2 s behind those of /lidar")
    assert "37.3 s behind this clock and 100 ms behind this clock" in found.what
    assert "at /camera: offset: 37.188s" in found.do


def test_of_two_topics_the_one_furthest_from_the_clock_is_meant():
    (found,) = check_stamps(topics(camera=1000, lidar=-2 * S), [group("camera", "lidar")])
    assert "the stamps of /lidar are 2 s ahead of those of /camera" in found.what
    assert "offset: -2.000s" in found.do


def test_a_second_is_near_enough():
    assert list(check_stamps(topics(camera=0, lidar=S), [group("camera", "lidar")])) == []


def test_every_topic_that_is_apart_is_named():
    found = check_stamps(topics(a=0, b=0, c=0, d=9 * S, e=-5 * S), [group("a", "b", "c", "d", "e")])
    assert [each.what.split()[4] for each in found] == ["/d", "/e"]


def test_old_stamps_that_agree_are_to_know():
    (found,) = check_stamps(topics(camera=7_200 * S, lidar=7_200 * S + 5), [group("camera", "lidar")])
    assert (found.code, found.severity) == ("stamps_off_clock", KNOW)
    assert "2 h behind this clock" in found.what


def test_topics_that_are_not_matched_by_stamp_are_passed_over():
    assert list(check_stamps([*topics(label=9 * S), image(unstamped=50)], [])) == []


def test_missing_stamps_are_counted():
    seen = [image(unstamped=50, unreadable=2, received=52, delays=())]
    unstamped, malformed = check_stamps(seen, [group("image")])
    assert unstamped.what == "/image: 50 of 52 messages have the stamp 0"
    assert malformed.what == "/image: 2 of 52 messages have no stamp that could be read"
