"""Groups of every policy, as the tests of what all of them share make them."""

from syncrelay.sync import (
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestTime,
    SyncGroup,
)
from tests.sync.support.timeline import TICK_NS


def grouped(policy, required=None, max_wait=None, **options):
    return SyncGroup(
        policy,
        required=required or (True,) * policy.n_inputs,
        max_wait_ns=None if max_wait is None else max_wait * TICK_NS,
        **options,
    )


def exact(inputs=2, queue=10, **options):
    return grouped(ExactTime(n_inputs=inputs, queue_size=queue), **options)


def approximate(inputs=2, queue=10, slop=20, **options):
    return grouped(ApproximateTime(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS), **options)


def paced(periods, *, slop, required):
    periods_ns = [period * TICK_NS for period in periods]
    policy = ApproximateTime(n_inputs=len(periods), queue_size=9, slop_ns=slop * TICK_NS, min_periods_ns=periods_ns)
    return grouped(policy, required=required, max_wait=9)


def eager(*, slop):
    policy = ApproximateTimeEager(n_inputs=3, queue_size=9, slop_ns=slop * TICK_NS)
    return grouped(policy, required=(True, True, False), max_wait=9)


def by_key(inputs=2, **options):
    return grouped(EqualKey(n_inputs=inputs, queue_size=3), **options)


def latest(max_wait=4):
    policy = LatestTime(n_inputs=2, queue_size=9, trigger=0, max_ages_ns=[3 * TICK_NS] * 2)
    return grouped(policy, max_wait=max_wait)


third_optional = {"inputs": 3, "required": (True, True, False)}

GAP = "." * 101
"""More than a second."""
