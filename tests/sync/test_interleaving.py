"""Where no queue overflows, the sets depend on the stamps alone, and not on how the inputs interleave on their way.

Tests over DDS stand on it: how far one topic lags behind another there is the machine's affair.
"""

import random

import pytest

from syncrelay.sync import ApproximateTime, ExactTime, Match, Message, SyncGroup
from tests.faults.extent import chosen
from tests.sync.support.streams import MS, rising_stamps

_ENOUGH = 1000
_STREAMS = chosen(short=25, long=400)


def _in_turns(rng, streams):
    """(input, stamp): each input in order, and of any of them any number before the next of another."""
    left = [(index, list(stamps)) for index, stamps in enumerate(streams)]
    events = []
    while left := [(index, stamps) for index, stamps in left if stamps]:
        index, stamps = rng.choice(left)
        count = rng.choice((1, 1, 3, 50))
        events += [(index, stamp) for stamp in stamps[:count]]
        del stamps[:count]
    return events


def _sets(policy, events):
    group = SyncGroup(policy, required=(True,) * policy.n_inputs, max_wait_ns=None)
    outcomes = [outcome for index, stamp in events for outcome in group.add(Message(index, stamp, None), now=0)]
    assert not [each for each in outcomes if not isinstance(each, Match) and each.reason.value == "overflow"]
    return [outcome.stamps for outcome in outcomes if isinstance(outcome, Match)]


@pytest.mark.parametrize("name", ["approximate_time", "exact_time"])
def test_sets_do_not_depend_on_how_the_inputs_interleave(name):
    found = 0
    for seed in range(_STREAMS):
        rng = random.Random(seed)
        n_inputs, slop = rng.choice((2, 3, 4)), rng.choice((0, MS, 10 * MS, 1000 * MS))
        shared = rising_stamps(rng, 60)
        streams = [shared if rng.random() < 0.5 else rising_stamps(rng, 60) for _ in range(n_inputs)]
        # What comes last on all of them ends the wait for something closer.
        streams = [[*stamps, 10**12] for stamps in streams]

        def policy(n_inputs=n_inputs, slop=slop):
            if name == "exact_time":
                return ExactTime(n_inputs=n_inputs, queue_size=_ENOUGH)
            return ApproximateTime(n_inputs=n_inputs, queue_size=_ENOUGH, slop_ns=slop)

        by_stamp = sorted(
            ((index, stamp) for index, stamps in enumerate(streams) for stamp in stamps), key=lambda e: e[1]
        )
        expected = _sets(policy(), by_stamp)
        found += len(expected)
        for _ in range(3):
            assert _sets(policy(), _in_turns(rng, streams)) == expected, seed
    assert found > 3 * _STREAMS
