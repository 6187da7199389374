"""Simulated time: what of /clock is a jump, what a tick, and what no time at all."""

import logging
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

from syncrelay.relay.clock import WaitingClock
from syncrelay.runtime import SYSTEM
from tests.faults.extent import chosen
from tests.ros.in_process import own_node, port_of

_SECOND = 10**9


@contextmanager
def _simulated(domain: int) -> Iterator[tuple[Any, Callable[[int], None]]]:
    """A node by simulated time, and what gives it a message of /clock as its executor would."""
    with own_node(domain, parameter_overrides=[Parameter("use_sim_time", value=True)]) as own:
        (subscription,) = own.node.subscriptions
        port = port_of(own.node)

        def tick(now: int) -> None:
            sec, nanosec = divmod(now, _SECOND)
            subscription.callback(Clock(clock=Time(sec=sec, nanosec=nanosec)))

        yield port, tick


def test_the_clock_jumps_where_it_falls_by_a_second_or_more(ros_domain: int, caplog: pytest.LogCaptureFixture):
    """Drawn: steps of all sizes, many of them close to a second back, and times below 0, which are none."""
    chance = random.Random(28)
    told: list[str] = []
    with _simulated(ros_domain) as (node, tick), caplog.at_level(logging.WARNING, "syncrelay"):
        clock = WaitingClock(node, runtime=SYSTEM)
        clock.follow(jumped_back=lambda: told.append("jumped"), ticked=lambda: told.append("ticked"))
        tick(now := 1000 * _SECOND)
        for number in range(chosen(short=2000, long=100_000)):
            step = chance.choice((-_SECOND, 0, 1, -1, _SECOND, -5 * _SECOND)) + chance.randint(-2, 2)
            if chance.random() < 0.2:
                step = chance.randint(-3 * _SECOND, 3 * _SECOND)
            then = -chance.randint(1, 2**31 * _SECOND) if chance.random() < 0.05 else now + step
            told.clear()
            tick(then)
            expected = [] if then < 0 or -_SECOND < then - now <= 0 else ["ticked" if then > now else "jumped"]
            assert told == expected, f"step {number} of seed 28, {then - now} ns from {now}"
            now = then if then >= 0 else now
            assert clock.now() == now
        clock.close()
    (said,) = [record.getMessage() for record in caplog.records if record.name == "syncrelay"]
    assert said.startswith("/clock is at -")
    assert said.endswith(" s, and no time in ROS is below 0: ignored until it is 0 or more")
