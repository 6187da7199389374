"""What `lend` and `lend_search` promise: while an engine lends, another gives what it would."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.sync import DropReason, ExactTime, Match, Message, SyncGroup
from syncrelay.sync.arrivals import JUMP_NS
from syncrelay.sync.lending import Fed
from tests.faults.extent import chosen
from tests.sync.support.rates import Rates
from tests.sync.support.rigs import POLICIES, make_group, options, plain_options, steps


class Borrower:
    """Forms sets as `lend` allows it, and has the engine do all else."""

    def __init__(self, group):
        self.sets = 0
        self._group = group
        # The newest stamp of each input in a set, while the engine lends.
        self._newest: Any = None
        self._held: list[Message] = []

    def add(self, message, *, now):
        if self._newest is None and (newest := self._group.lend()) is not None:
            self._newest, self.sets = [*newest], 0
        if self._newest is None or not self._fits(message):
            return [*self.end(now=now), *self._group.add(message, now=now)]
        self._held.append(message)
        if len(self._held) < len(self._newest):
            return []
        members, self._held = sorted(self._held, key=lambda each: each.input), []
        self._newest = [each.stamp for each in members]
        self.sets += 1
        return [Match(tuple(members))]

    def end(self, *, now):
        """Give all back; what leaves then."""
        if self._newest is None:
            return []
        self._group.take_back(self.sets, self._newest)
        held, self._held, self._newest = self._held, [], None
        return [outcome for message in held for outcome in self._group.add(message, now=now)]

    def _fits(self, message):
        stamps = [message.stamp, *[each.stamp for each in self._held]]
        return (
            message.stamp > self._newest[message.input]
            and all(each.input != message.input for each in self._held)
            and max(stamps) - min(stamps) <= self._group.at_once
        )


@st.composite
def rigs(draw):
    chosen = draw(plain_options() | options())
    return chosen, draw(steps(chosen.n_inputs))


@pytest.mark.parametrize("policy", POLICIES)
@given(rig=rigs(), looked_at=st.sets(st.integers(0, 40)))
def test_the_same_leaves_of_an_engine_that_lends(policy, rig, looked_at):
    chosen, taken = rig
    plain, lending = make_group(policy, chosen), make_group(policy, chosen)
    borrower = Borrower(lending)
    for number, step in enumerate(taken):
        if step.message is None:
            assert [*borrower.end(now=step.now), *lending.expire(now=step.now)] == [*plain.expire(now=step.now)]
        else:
            assert borrower.add(step.message, now=step.now) == [*plain.add(step.message, now=step.now)]
        if number in looked_at:
            assert borrower.end(now=step.now) == []
            assert lending.counts() == plain.counts()
    assert borrower.end(now=0) == []
    assert (lending.counts(), lending.sets) == (plain.counts(), plain.sets)
    assert lending.flush(DropReason.SHUTDOWN) == plain.flush(DropReason.SHUTDOWN)


@pytest.mark.parametrize("seed", range(chosen(short=60, long=20_000)))
def test_a_search_goes_on_in_another_engine_as_it_would_have(seed):
    rates = Rates(seed)
    plain, lending = SyncGroup(rates.policy()), SyncGroup(rates.policy())
    newest, given, lent_after = [0] * rates.n_inputs, [-(2**63)] * rates.n_inputs, rates.looks(60)
    for number, (index, stamp) in enumerate(rates.messages):
        left = [*plain.add(Message(index, stamp, number), now=0)]
        assert [*lending.add(Message(index, stamp, number), now=0)] == left
        # After a jump back, an engine remembers more than its search.
        lent_after = set() if stamp < newest[index] - JUMP_NS else lent_after
        newest[index] = max(newest[index], stamp)
        for each in left:
            if isinstance(each, Match):
                given = [max(stamp or 0, before) for stamp, before in zip(each.stamps, given, strict=True)]
        search = lending.lend_search() if number in lent_after else None
        if search is not None:
            counts, lending = lending.counts(), SyncGroup(rates.policy())
            fed = [Fed(each.fed, each.dropped, given[at]) for at, each in enumerate(counts)]
            lending.take_back_search(search, plain.sets, fed)
    counted = [replace(each, needed_queue=None) for each in plain.counts()]
    assert [replace(each, needed_queue=None) for each in lending.counts()] == counted
    assert lending.flush(DropReason.SHUTDOWN) == plain.flush(DropReason.SHUTDOWN)


def test_a_group_lends_while_nothing_is_buffered():
    group = SyncGroup(ExactTime(n_inputs=2, queue_size=3))
    assert group.lend() == [0, 0]
    group.add(Message(0, 5, None), now=0)
    assert group.lend() is None
    group.add(Message(1, 5, None), now=0)
    assert group.lend() == [5, 5]


@pytest.mark.parametrize("asked", [{"max_wait_ns": 5}, {"offsets_ns": (0, 1)}, {"restamp": 0}, {"every": 2}])
def test_a_group_that_asks_for_more_than_matching_never_lends(asked):
    assert SyncGroup(ExactTime(n_inputs=2, queue_size=3), **asked).lend() is None
