"""Columns that are fed give what the engine gives of the same messages, one by one."""

from importlib.util import find_spec

import numpy as np
import pytest

from syncrelay.explain import UNREADABLE, EngineDriver
from syncrelay.explain.feeding import REASONS, Left, feed
from syncrelay.explain.received import Messages
from syncrelay.sync import SyncGroup
from tests.explain.scenario import BEGAN, MS, Source, group_of
from tests.faults.extent import chosen
from tests.sync.support.rates import Rates

_POLICIES = ("approximate_time", "approximate_time", "approximate_time_eager", "exact_time")
_is_built = pytest.mark.skipif(find_spec("syncrelay.sync.compiled.columns") is None, reason="it was not built")


class Fed:
    """A driver, and what left its engine so far."""

    def __init__(self, config) -> None:
        self.left = Left(len(config.topics))
        self.driver = EngineDriver(config, self.left.add)

    def told(self):
        """What left since this was last asked, those that left together in one order, and the counts."""
        sets, drops = self.left.taken()
        counts = self.driver.engine.counts()
        return sets.tolist(), sorted(drops.tolist()), counts, [[*each.dropped] for each in counts]


def _drawn(seed):
    """A group, its messages, and after which of them somebody looks."""
    rates = Rates(seed)
    chance = rates.chance
    policy = chance.choice(_POLICIES)
    options = {"policy": policy, "queue_size": chance.choice([1, 2, 5, 10, 10, 50])}
    if policy != "exact_time":
        options["slop"] = chance.choice(["1ns", "5ms", "20ms", "50ms"])
    if policy == "approximate_time":
        options["age_penalty"] = chance.choice([0, 0.1, 0.1, 3.7])
    # Stamps of one trigger are equal.
    grain = 1 if policy == "approximate_time" else 40 * MS
    messages = [
        (index, stamp // grain * grain if _fits(stamp) and chance.random() > 0.005 else UNREADABLE, BEGAN + number * MS)
        for number, (index, stamp) in enumerate(rates.messages)
    ]
    config = group_of([Source(f"/t{index}", hz=1) for index in range(rates.n_inputs)], options)
    return config, Messages(*np.array(messages, dtype=np.int64).reshape(-1, 3).T.copy()), sorted(rates.looks(5))


def _fits(stamp):
    return abs(stamp) < 2**63 - 1000 * MS


@pytest.mark.parametrize("seed", range(chosen(short=300, long=30_000)))
def test_the_same_leaves_of_columns_as_of_messages_one_by_one(seed):
    config, messages, looks = _drawn(seed)
    columns, one_by_one = Fed(config), Fed(config)
    for begin, end in zip([0, *looks], [*looks, len(messages.inputs)], strict=True):
        some = messages.part(begin, end)
        assert feed(columns.driver, some, columns.left) == (some.received[-1] if len(some.inputs) else 0)
        one_by_one.driver.feed(some.one_by_one())
        assert columns.told() == one_by_one.told()
    for each in (columns, one_by_one):
        each.driver.finish(BEGAN)
    assert columns.told() == one_by_one.told()


@_is_built
def test_an_engine_that_lends_is_fed_nothing(monkeypatch):
    config = group_of([Source("/camera", hz=10), Source("/lidar", hz=10)], {"slop": "20ms"})
    stamps = BEGAN + np.arange(1000) // 2 * 100 * MS
    inputs = np.arange(1000) % 2
    fed = Fed(config)
    monkeypatch.setattr(SyncGroup, "add", None)
    feed(fed.driver, Messages(inputs, stamps + inputs, stamps + MS), fed.left)
    sets, drops = fed.left.taken()
    assert len(sets) == 499
    first, second, tick, left, latency = sets[0].tolist()
    assert (first, second, tick) == (BEGAN, BEGAN + 1, UNREADABLE)
    # It leaves with the next message.
    assert (left, latency) == (BEGAN + 101 * MS, 100 * MS)
    assert not len(drops)


@_is_built
def test_what_is_dropped_while_an_engine_lends_has_its_reason():
    config = group_of([Source("/camera", hz=10), Source("/lidar", hz=10)], {"slop": "20ms"})
    stamps = BEGAN + np.array([0, 1, 500, 501, 900, 901, 902]) * MS
    fed = Fed(config)
    feed(fed.driver, Messages(np.array([0, 1, 0, 0, 0, 1, 1]), stamps, stamps + MS), fed.left)
    drops = [(index, stamp, received, REASONS[number].value) for index, stamp, received, number in fed.left.taken()[1]]
    assert drops == [(0, stamp, stamp + MS, "too_far") for stamp in stamps[2:4].tolist()]
