"""Sets of required inputs with tolerances, against their definition tried on all sets that there are."""

import random
from itertools import combinations, product

from syncrelay.sync import ApproximateTime, Drop, DropReason, Match, Message
from tests.faults.extent import chosen

STREAMS = chosen(short=300, long=5_000)
TICK = 10
END = 10**6


def drawn(rng):
    """Slop, tolerances and messages in stamp order; the last are so late that all sets are decided."""
    n_inputs = rng.randint(2, 4)
    slop = rng.choice((3, 6, 9)) * TICK
    tolerances = [rng.choice((None, 0, 1, 2, 3, 9)) for _ in range(n_inputs)]
    sent = []
    for index in range(n_inputs):
        stamps = rng.sample(range(1, 40), rng.randint(3, 9))
        sent += [Message(index, TICK * stamp, stamp) for stamp in stamps] + [Message(index, END, None)]
    tolerances = [each if each is None else each * TICK for each in tolerances]
    return slop, tolerances, sorted(sent, key=lambda message: (message.stamp, message.input))


def truth(slop, tolerances, sent):
    """Yield sets and drops: again and again the tightest set with the latest message of the first set that is left."""
    off = [slop / 2 if each is None else min(each, slop / 2) for each in tolerances]
    queues = [[message for message in sent if message.input == index] for index in range(len(off))]
    while allowed := [
        members
        for members in product(*queues)
        if all(abs(a.stamp - b.stamp) <= off[a.input] + off[b.input] for a, b in combinations(members, 2))
    ]:
        first = [min(each, key=lambda message: message.stamp) for each in zip(*allowed, strict=True)]
        assert tuple(first) in allowed
        latest = max(first, key=lambda message: message.stamp)
        stamps = [[message.stamp for message in members] for members in allowed if latest in members]
        _, best = min((max(each) - min(each), each) for each in stamps)
        for queue, begin, stamp in zip(queues, first, best, strict=True):
            yield from [(each, DropReason.TOO_FAR) for each in queue if each.stamp < begin.stamp]
            yield from [(each, DropReason.SUPERSEDED) for each in queue if begin.stamp <= each.stamp < stamp]
        yield tuple(best)
        queues = [[each for each in queue if each.stamp > stamp] for queue, stamp in zip(queues, best, strict=True)]


def test_approximate_time_gives_the_tightest_sets_that_keep_all_tolerances():
    seen = dict.fromkeys(("sets", DropReason.TOO_FAR, DropReason.SUPERSEDED), 0)
    for seed in range(STREAMS):
        slop, tolerances, sent = drawn(random.Random(seed))
        policy = ApproximateTime(
            n_inputs=len(tolerances), queue_size=99, slop_ns=slop, age_penalty=0, tolerances_ns=tolerances
        )
        left = [outcome for message in sent for outcome in policy.add(message)]
        matches = [each.messages for each in left if isinstance(each, Match)]
        sets = [tuple(message.stamp for message in messages if message) for messages in matches]
        drops = {(each.message, each.reason) for each in left if isinstance(each, Drop)}
        expected = list(truth(slop, tolerances, sent))
        assert sets == [each for each in expected if isinstance(each[0], int)], f"seed {seed}"
        assert drops == {each for each in expected if not isinstance(each[0], int)}, f"seed {seed}"
        seen["sets"] += len(sets)
        for _, reason in drops:
            seen[reason] += 1
    assert min(seen.values()) > STREAMS / 3, seen
