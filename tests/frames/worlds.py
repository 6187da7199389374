"""Drawn worlds of transforms and sets in the order of their arrival: what a robot may send, and should not."""

import random
from dataclasses import dataclass, field

from syncrelay.frames import Edge

MS = 1_000_000
SECOND = 1_000 * MS
BEGIN = 1_000 * SECOND


@dataclass(frozen=True)
class Member:
    """A message of a set, by its frame and stamp."""

    frame: str
    stamp: int


@dataclass
class World:
    """What arrives: at each time a transform, a set whose last message came, or None, where the clock jumps back."""

    seed: int
    target: str
    wait: int
    frames: list[str]
    events: list[tuple[int, Edge | tuple[Member, ...] | None]] = field(default_factory=list)


def draw(seed, *, sets=30):
    rng = random.Random(seed)
    frames = [f"f{number}" for number in range(rng.randint(2, 12))]
    world = World(seed, rng.choice(frames), rng.choice((0, 20, 100, 300, 300, 1_000)) * MS, frames)
    period = rng.choice((33, 100, 100, 1_000)) * MS
    arrivals: list[tuple[int, float, Edge | tuple[Member, ...] | None]] = []
    for number, child in enumerate(frames[1:], 1):
        if rng.random() > 0.02:  # else a tree of its own
            parent = frames[rng.randrange(number)]
            arrivals += _edge(rng, frames, parent, child, sets * period)
    if rng.random() < 0.15:  # a loop
        arrivals += _moving(rng, [(BEGIN, frames[-1])], frames[0], sets * period)
    arrivals += _sets(rng, frames, sets, period)
    if rng.random() < 0.1:
        arrivals.append((BEGIN + rng.randrange(sets * period), 0.0, None))
    world.events = [(at, event) for at, _, event in sorted(arrivals, key=lambda each: each[:2])]
    return world


def _edge(rng, frames, parent, child, length):
    if rng.random() < 0.4:
        late = rng.choice((*[-SECOND] * 9, rng.randrange(length)))
        return [(BEGIN + late, rng.random(), Edge(_slashed(rng, parent), child, BEGIN, is_static=True))]
    parents = [(BEGIN - 2 * SECOND, parent)]
    if rng.random() < 0.15:
        parents += [(BEGIN + rng.randrange(length), rng.choice(frames)) for _ in range(rng.randint(1, 3))]
    return _moving(rng, sorted(parents), child, length)


def _moving(rng, parents, child, length):
    period = SECOND // rng.choice((10, 30, 50))
    latency = rng.choice((0, 0, 0, 2, 2, 10, 10, 50, 150, 400)) * MS
    jitter = rng.choice((0, MS, 10 * MS, 2 * period))  # the last has them out of order
    loss = rng.choice((0, 0, 0.1, 0.5))
    gap = rng.randrange(length) if rng.random() < 0.2 else None
    begun = BEGIN + rng.choice((*[-2 * SECOND] * 19, rng.randrange(length)))
    edges = []
    stamp = begun + rng.randrange(period)
    while stamp < BEGIN + length + SECOND:
        stamp += period + rng.randrange(-period // 4, period // 4)
        silent = gap is not None and BEGIN + gap < stamp < BEGIN + gap + 2 * SECOND
        if not silent and rng.random() >= loss:
            parent = [name for since, name in parents if since <= stamp or since == parents[0][0]][-1]
            at = stamp + latency + rng.randint(0, jitter)
            edges.append((at, rng.random(), Edge(_slashed(rng, parent), child, stamp, is_static=False)))
    return edges


def _slashed(rng, name):
    return f"/{name}" if rng.random() < 0.02 else name


def _sets(rng, frames, sets, period):
    of_inputs = [rng.choice(frames) for _ in range(rng.randint(1, 4))]
    odd = rng.choice((None,) * 40 + ("", "nowhere", "/f0"))
    if odd is not None:
        of_inputs[rng.randrange(len(of_inputs))] = odd
    wanders = rng.random() < 0.1  # the frames of its messages change
    arrivals = []
    stamp = BEGIN
    for _ in range(sets):
        stamp += rng.randrange(period // 2, period * 3 // 2)
        names = [rng.choice(frames) if wanders else name for name in of_inputs]
        members = tuple(Member(name, stamp + rng.randrange(-5 * MS, 5 * MS)) for name in names)
        at = max(each.stamp for each in members) + rng.randrange(30 * MS)
        arrivals.append((at, rng.random(), members))
    return arrivals
