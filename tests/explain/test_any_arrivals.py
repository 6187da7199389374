"""Whatever is stamped and received, and whenever, is observed, judged and tried without an error."""

import random
from collections.abc import Iterator

import pytest

from syncrelay.config import load_text
from syncrelay.explain import Arrivals, Endpoint, FindingLog, GroupWatch, InputGraph, Judge
from syncrelay.sync.counts import InputCounts
from tests.explain.support.groups import S
from tests.faults.extent import chosen

_TYPE = "geometry_msgs/msg/Vector3Stamped"
_TOPICS = "".join(f"    - {{topic: /{name}, type: {_TYPE}}}\n" for name in "ab")
_GROUP = load_text(
    f"version: 1\ngroups:\n  g:\n    policy: approximate_time\n    slop: 20ms\n    topics:\n{_TOPICS}"
).groups[0]
_GRAPH = [InputGraph(f"/{name}", f"/g/{name}", publishers=(Endpoint("/x", _TYPE),)) for name in "ab"]
# The last has failed: its last input lost its clock, and then had no stamp.
_SEEDS = (*(chosen(short=1, long=random.randrange(10**9)) + n for n in range(chosen(short=20, long=3000))), 61086329)


def _looks(chance: random.Random) -> Iterator[tuple[int, list[Arrivals]]]:
    now = chance.choice([0, 1_700_000_000 * S])
    for _ in range(chance.randint(1, 60)):
        now = max(0, now + chance.choice([S, S, S, 0, 10 * S, -5 * S, 3600 * S]))
        yield now, [_arrivals(chance, now) for _ in _GRAPH]


def _arrivals(chance: random.Random, now: int) -> Arrivals:
    came = []
    for _ in range(chance.choice([0, 1, 3, 20])):
        at = max(0, now - chance.randint(0, S))
        stamps = at, at, at + chance.randint(-(10**6), 10**6), 0, chance.randint(-(2**63), 2**63 - 1), at // 1000
        came.append((chance.choice([*stamps, at % S, at // 10**7 * 10**7, 2**63 - 1]), at))
    return sorted(came, key=lambda each: each[1])


@pytest.mark.parametrize("seed", _SEEDS)
def test_any_messages_are_judged(seed: int):
    watch, judge, log, fed = GroupWatch(_GROUP, began=0), Judge(), FindingLog(), [0, 0]
    for now, arrivals in _looks(random.Random(seed)):
        fed = [before + len(new) for before, new in zip(fed, arrivals, strict=True)]
        watch.add(arrivals, [], [InputCounts(each, min(fed), {}, 0) for each in fed], 0, now=now)
        facts = watch.facts(_GRAPH, now=now)
        found = judge.judge(facts)
        assert all(each.text for each in found)
        list(log.remarks(facts, found, judge.explained(facts)))
