"""QoS: matched to the publishers, or as the file says."""

from dataclasses import replace
from itertools import combinations_with_replacement

import pytest

from syncrelay.config import AUTO, QosOverrides, QosPreset
from tests.ros.streams import MS

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.config.profile import Profile, is_known, matched, mismatch, sent

_KINDS = [
    Profile(depth=1, reliability=reliability, durability=durability)
    for reliability in ("reliable", "best_effort")
    for durability in ("transient_local", "volatile")
]


def test_auto_takes_the_most_that_all_publishers_offer():
    for number in (1, 2, 3):
        for offered in combinations_with_replacement(_KINDS, number):
            profile = matched(AUTO, offered)
            assert not any(mismatch(each, profile) for each in offered)
            assert (profile.reliability == "reliable") is all(each.reliability == "reliable" for each in offered)
            latched = all(each.durability == "transient_local" for each in offered)
            assert (profile.durability == "transient_local") is latched
    assert not is_known(AUTO, [])
    assert matched(AUTO, []) == Profile(depth=100)


_BEST = QosPreset("best_available")


@pytest.mark.parametrize(
    ("policy", "offers", "best"),
    [
        ("reliability", ["reliable", "best_effort"], "best_effort"),
        ("durability", ["transient_local", "volatile"], "volatile"),
        ("liveliness", ["manual_by_topic", "manual_by_topic"], "manual_by_topic"),
        ("liveliness", ["manual_by_topic", "automatic"], "automatic"),
        ("liveliness", ["manual_by_topic", "unknown"], "automatic"),
        ("deadline", [5 * MS, 9 * MS], 9 * MS),
        ("deadline", [5 * MS, 0], 0),
        ("liveliness_lease_duration", [5 * MS, 9 * MS], 9 * MS),
    ],
)
def test_best_available_is_the_most_that_all_publishers_offer_and_waits_for_them(policy, offers, best):
    offered = [replace(Profile(), **{policy: offer}) for offer in offers]
    profile = matched(_BEST, offered)
    assert getattr(profile, policy) == best
    assert not any(mismatch(each, profile) for each in offered)
    assert not is_known(_BEST, [])
    assert not is_known(QosOverrides(reliability="reliable", durability="volatile", liveliness="best_available"), [])


def test_an_output_of_an_input_that_keeps_all_keeps_the_last_5000():
    received = matched(QosOverrides(history="keep_all", deadline=5 * MS), _KINDS[:1])
    output = sent(received)
    assert received.history == "keep_all"
    assert (output.history, output.depth) == ("keep_last", 5000)
    assert mismatch(output, received) is None
