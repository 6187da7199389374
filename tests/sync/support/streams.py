"""Seeded random streams: what a rig may send, with jitter, latency, bursts, gaps, loss and ties."""

MS = 1_000_000
START_NS = 10**9
AGE_PENALTIES = (0.0, 0.1, 0.5, 1.0, 2.0)
"""Those for which ROS 1 and ROS 2 round alike (shared/vectors/README.md)."""


def rising_stamps(rng, count):
    """Stamps of one input, strictly rising: jittered at 5 to 100 Hz, with bursts, gaps and loss; some on a grid."""
    period = 10**9 // rng.randint(5, 100)
    jitter = rng.choice((0.0, 0.05, 0.3, 0.9))
    grid = rng.choice((1, 1, MS, 10 * MS))
    loss = rng.choice((0.0, 0.0, 0.1, 0.5))
    at = START_NS + rng.randrange(period)
    stamps: list[int] = []
    while len(stamps) < count:
        shape = rng.random()
        at += period // 10 if shape < 0.03 else period * rng.randint(5, 40) if shape > 0.98 else period
        stamp = int(at + jitter * period * (rng.random() - 0.5)) // grid * grid
        if rng.random() >= loss and (not stamps or stamp > stamps[-1]):
            stamps.append(stamp)
    return stamps


def in_order(rng, n_inputs, count):
    """(input, stamp) in order of arrival: each input in stamp order, the inputs against each other by latency."""
    merged = []
    shared = rng.random() < 0.3  # inputs of one trigger: equal stamps
    first = rising_stamps(rng, count)
    for index in range(n_inputs):
        stamps = [stamp for stamp in first if rng.random() < 0.9] if shared else rising_stamps(rng, count)
        latency = rng.choice((0, 0, 5 * MS, 50 * MS, 300 * MS))
        spread = rng.choice((0, MS, 20 * MS))
        arrival = 0
        for stamp in stamps:
            arrival = max(arrival + 1, stamp + latency + rng.randint(0, spread))
            merged.append((arrival, rng.random(), index, stamp))
    merged.sort()
    return [(index, stamp) for _, _, index, stamp in merged[:count]]


def disordered(rng, n_inputs, count):
    """(input, stamp) in order of arrival, with duplicates, inversions and stamps of few values."""
    events = in_order(rng, n_inputs, count)
    grid = rng.choice((1, MS, 10 * MS, 50 * MS))
    events = [(index, max(stamp // grid * grid, 1)) for index, stamp in events]
    for _ in range(rng.choice((0, count // 50, count // 5))):
        at = rng.randrange(len(events))
        if rng.random() < 0.5:
            events.insert(rng.randrange(at, min(at + 20, len(events))), events[at])
        else:
            events.insert(min(at + rng.randrange(20), len(events) - 1), events.pop(at))
    return events


def gappy(rng, n_inputs, count):
    """(input, stamp) in order of arrival: long silences, one input seconds late, so that searches are long."""
    merged = []
    for index in range(n_inputs):
        period = 10**9 // rng.randint(5, 100)
        latency = rng.choice((0, 0, 500 * MS, 2_000 * MS))
        stamp = START_NS + rng.randrange(period)
        for _ in range(count // n_inputs):
            stamp += period * (rng.randint(10, 100) if rng.random() < 0.02 else 1) + rng.randrange(period // 2)
            merged.append((stamp // MS * MS + latency, index, stamp // MS * MS))
    merged.sort()
    return [(index, stamp) for _, index, stamp in merged]
