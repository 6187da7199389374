"""Messages that wait for the relay, on the simulated ROS: told of the groups that they are of, and of no other."""

import json

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.config import load_text
from syncrelay.config.profile import Profile
from syncrelay.explain import Code
from syncrelay.relay.relay import Relay
from tests.conformance.script import VECTOR, group
from tests.conformance.simulated import SimulatedWorld
from tests.ros.cdr_messages import vector

_GROUPS = {"front": group("/a", "/b"), "rear": group("/c", "/d")}


def test_only_groups_whose_messages_waited_are_told_that_the_relay_is_too_slow():
    config = load_text(json.dumps({"version": 1, "groups": _GROUPS}))
    with SimulatedWorld(1) as world:
        writers = {each: world.writer(f"/{each}", VECTOR, Profile(), by="rig", node="rig") for each in "abcd"}
        may_turn, held, runtime = [True], [], world.runtime

        def turn() -> None:
            while not may_turn[-1]:
                held.append(1)
                runtime.sleep(0.01)

        def play(topics: str) -> None:
            stamped = vector(runtime.time_ns())
            for each in topics:
                writers[each].write(stamped)

        with Relay(config, *world.join(config, {}), on_turn=turn, runtime=runtime) as relay:

            def are_found() -> bool:
                relay.step(0)
                return all(each.n_readers for each in writers.values())

            def reports():
                relay.step(0)
                return relay.evaluate()

            def told() -> list[bool]:
                return [any(each.code is Code.TOO_SLOW for each in report.findings) for report in reports()]

            def wait_for_sets(*counts: int) -> None:
                world.wait_until(lambda: [each.facts.figures.sets for each in reports()] == [*counts], "the sets")

            world.wait_until(are_found, "the relay")
            play("abcd")
            wait_for_sets(1, 1)
            assert told() == [False, False]
            may_turn.append(False)
            # A loop that still rests takes both messages before it comes to hold still.
            world.wait_until(lambda: held, "the loop to hold still")
            play("ab")
            world.scheduler.sleep(0.7)
            may_turn.append(True)
            wait_for_sets(2, 1)
            assert told() == [True, False]
