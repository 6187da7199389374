"""Groups to which anything comes: whatever is stamped and received, and whenever, as it is observed and judged."""

import random
from collections.abc import Iterator

from syncrelay.config import load_text
from syncrelay.explain import (
    Arrivals,
    Endpoint,
    Finding,
    FindingLog,
    GroupFacts,
    GroupWatch,
    InputGraph,
    Judge,
    with_ok,
)
from syncrelay.sync import Match, Message
from tests.explain.support.groups import S
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

_TOPICS = inputs({"/a": VECTOR, "/b": VECTOR})
_SLOP = {"policy": "approximate_time", "slop": "20ms"}
_HELD = {"policy": "latest_time", "trigger": "/a", "max_age": "1s", "topics": _TOPICS}
_OPTIONAL = {**_SLOP, "max_wait": "100ms", "topics": [_TOPICS[0], {**_TOPICS[1], "required": False}]}
_PAIR, _TICKS = {**_SLOP, "topics": _TOPICS}, {**_HELD, "trigger": "20 Hz"}
_GROUPS = load_text(config({"held": _HELD, "optional": _OPTIONAL, "pair": _PAIR, "ticks": _TICKS})).groups


def judged(seed: int) -> Iterator[tuple[GroupFacts, tuple[Finding, ...]]]:
    """Yield what is known of a group, and all that is found, look by look."""
    group, chance = _GROUPS[seed % len(_GROUPS)], random.Random(f"graph {seed}")
    publishers = (Endpoint("/x", VECTOR),) * chance.randint(0, 4)
    graph = [InputGraph(topic.topic, topic.output, publishers) for topic in group.topics]
    by_clock = chance.choice([None, lambda at: at // 2])
    looks = [*_looks(random.Random(seed))]
    watch, judge, log, engine = GroupWatch(group, began=looks[0][0]), Judge(), FindingLog(), group.engine()
    for now, arrivals in looks:
        came = sorted((at, index, stamp) for index, new in enumerate(arrivals) for stamp, at in new)
        outcomes = [each for at, index, stamp in came for each in engine.add(Message(index, stamp, at), now=at)]
        sent = [(each.stamps, 0) for each in outcomes if isinstance(each, Match)]
        watch.add(arrivals, sent, engine.counts(), engine.sets, by_clock=by_clock, now=now)
        facts = watch.facts(graph, now=now)
        found = judge.judge(facts)
        list(log.remarks(facts, found, judge.explained(facts)))
        yield facts, with_ok(facts, found)


def _looks(chance: random.Random) -> Iterator[tuple[int, list[Arrivals]]]:
    now = chance.choice([0, 1_700_000_000 * S])
    for _ in range(chance.randint(1, 60)):
        now = max(0, now + chance.choice([S, S, S, 0, 10 * S, -5 * S, 3600 * S]))
        yield now, [_arrivals(chance, now) for _ in _TOPICS]


def _arrivals(chance: random.Random, now: int) -> Arrivals:
    came = []
    for _ in range(chance.choice([0, 1, 3, 20])):
        at = max(0, now - chance.randint(0, S))
        stamps = at, at, at + chance.randint(-(10**6), 10**6), 0, chance.randint(-(2**63), 2**63 - 1), at // 1000
        came.append((chance.choice([*stamps, at % S, at // 10**7 * 10**7, 2**63 - 1]), at))
    return sorted(came, key=lambda each: each[1])
