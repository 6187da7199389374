"""Which key is said to cost a group most of its sets: of drawn groups whose key was drawn too short."""

import random
from collections import Counter
from pathlib import Path

import pytest

from syncrelay.recordings.analysis.few_sets import why_few_sets
from syncrelay.recordings.bag.replay import replay
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap
from tests.recordings.bag.reading import bound
from tests.ros.streams import MS, at

LENGTH_MS = 6_000
DRAWN = chosen(short=15, long=1_000)


class Drawn:
    """A group, what it receives, and what is to be said of it: None where enough sets are complete."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.keys: list[str] = []
        self.topics: list[str] = []
        self.stamps: dict[str, list[int]] = {}
        self.delays: Counter[str] = Counter()
        self.expected: str | None = None
        # In turn, so that each is there.
        self.kind = ("own", "common", "clock", "slop", "queue", "tolerance")[seed % 6]
        getattr(self, f"_{self.kind}")()

    @property
    def text(self) -> str:
        lines = ["version: 1", "groups:", "  front:", *(f"    {key}" for key in self.keys), "    topics:"]
        return "\n".join([*lines, *(f"      - {topic}" for topic in self.topics)])

    def write(self, path: Path) -> Path:
        frames = [
            frame._replace(time=frame.time + self.delays[topic] * MS)
            for topic, stamps in self.stamps.items()
            for frame in at(topic, *stamps)
        ]
        return write_mcap(path, sorted(frames, key=lambda frame: frame.time))

    def _every(self, topic: str, period: int, *, first: int = 0, own: str = "") -> list[int]:
        self.topics.append(f"{{topic: {topic}{own}}}")
        self.stamps[topic] = [*range(first, LENGTH_MS, period)]
        return self.stamps[topic]

    def _rarely(self, own: str = "") -> list[int]:
        later = self.random.sample(range(100, LENGTH_MS), self.random.randrange(4))
        self.topics.insert(self.random.randrange(len(self.topics) + 1), f"{{topic: /task{own}}}")
        self.stamps["/task"] = sorted({5, *later})
        return self.stamps["/task"]

    def _triggered(self, own: int | None, common: int | None) -> None:
        """A task that is said now and then, beside inputs that always have something."""
        period = self.random.choice((33, 50, 100))
        self.keys = ["policy: latest_time", "trigger: /a"]
        self.keys += [f"max_age: {common}ms"] if common else []
        triggers = self._every("/a", period, first=20)
        for number in range(self.random.randrange(3)):
            self._every(f"/dense{number}", 10)
        tasks = self._rarely(f", max_age: {own}ms" if own else "")
        limit = own or common or LENGTH_MS
        complete = sum(any(0 <= each - task <= limit for task in tasks) for each in triggers)
        if 2 * complete < len(triggers):
            self.expected = (
                f"front: only {complete} of {len(triggers)} possible sets are complete, because of max_age"
                f" {_said(limit)} for /task: without it, {len(triggers)} would be"
            )

    def _own(self) -> None:
        self._triggered(self.random.choice((100, 700, 3_000, 60_000)), self.random.choice((None, 100)))

    def _common(self) -> None:
        self._triggered(None, self.random.choice((100, 250)))

    def _clock(self) -> None:
        self.keys = ["policy: latest_time", f"trigger: {self.random.choice((10, 30))} Hz", "max_wait: 20ms"]
        self._every("/a", 10)
        age = self.random.choice((100, 60_000))
        self._rarely(f", max_age: {age}ms")
        if age == 100:
            self.expected = "because of max_age 100 ms for /task: without it,"

    def _slop(self) -> None:
        apart = self.random.randrange(10, 45)
        slop = self.random.choice((apart - 5, apart + 5))
        self.keys = [f"policy: {self.random.choice(('approximate_time', 'approximate_time_eager'))}", f"slop: {slop}ms"]
        sets = len(self._every("/a", 100))
        self._every("/b", 100, first=apart)
        if slop < apart:
            self.expected = f"only 0 of {sets} possible sets are complete, because of slop {_said(slop)}: without it,"

    def _tolerance(self) -> None:
        """Two inputs that a tolerance of one keeps apart, or does not, and one that is far from both."""
        self.keys = ["policy: approximate_time", "slop: 40ms", "quorum: 2", "max_wait: 50ms"]
        apart, tolerance = self.random.randrange(10, 40), self.random.randrange(20)
        sets = len(self._every("/a", 200, own=f", tolerance: {tolerance}ms"))
        self._every("/b", 200, first=apart)
        self._every("/c", 200, first=120)
        if tolerance + 20 < apart:
            self.expected = (
                f"only 0 of {sets} possible sets are complete, because of tolerance {_said(tolerance)} for /a"
            )

    def _queue(self) -> None:
        queue = self.random.choice((1, 3, 20))
        self.keys = ["policy: approximate_time", "slop: 20ms", f"queue_size: {queue}"]
        self._every("/a", 100)
        self._every("/b", 100, first=3)
        self.delays["/b"] = 1_000
        if queue < 10:
            self.expected = f"possible sets are complete, because of queue_size {queue}: without it,"


def _said(ms: int) -> str:
    return f"{ms} ms" if ms < 1_000 else f"{ms // 1_000} s"


def _said_of(path: Path, text: str) -> str | None:
    with bound(path, text=text) as (recording, (binding,)):
        (result,) = replay(recording, [binding])
        return why_few_sets(recording, binding, [each.counts for each in result.inputs], result.sets)


@pytest.mark.faults
def test_what_is_said_to_cost_the_sets_is_the_key_that_was_drawn_too_short(tmp_path):
    kinds: Counter[tuple[str, bool]] = Counter()
    for seed in range(DRAWN):
        drawn = Drawn(seed)
        path = drawn.write(tmp_path / f"{seed}.mcap")
        said = _said_of(path, drawn.text)
        where = f"seed {seed} of {DRAWN}, {drawn.text}: {said}"
        if drawn.expected is None:
            assert said is None, where
        else:
            assert said is not None, where
            assert drawn.expected in said, where
        kinds[drawn.kind, said is None] += 1
        path.unlink()
    # Each kind was seen, and where something may be said, also where nothing is.
    assert len(kinds) >= 8, kinds


def test_where_no_single_key_costs_the_sets_none_is_named(tmp_path):
    frames = at("/a", *range(0, 6_000, 100)) + at("/b", *range(50, 6_050, 100))
    late = [frame._replace(time=frame.time + 1_000 * MS) if frame.topic == "/b" else frame for frame in frames]
    path = write_mcap(tmp_path / "bag.mcap", sorted(late, key=lambda frame: frame.time))
    keys = "policy: approximate_time, slop: 20ms, queue_size: 2, topics: [{topic: /a}, {topic: /b}]"
    text = f"{{version: 1, groups: {{front: {{{keys}}}}}}}"
    assert _said_of(path, text) == "front: only 0 of 60 possible sets are complete: `syncrelay analyze` says more"
