"""Random histories of an optional input: what is said of why sets leave without it has really been so."""

import heapq
import random
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from syncrelay.config import load_text
from syncrelay.explain import Code, Endpoint, GroupWatch, InputGraph, judge
from syncrelay.sync import Match, Message
from tests.explain.support.cases import said_of_cases
from tests.explain.support.groups import BEGAN, MS, S

_SLOP = 20 * MS
_PERIOD = 100 * MS
_LASTS_S = 40
_SEEDS = range(40)
_FILE = """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    max_wait: {max_wait}ms
    topics:
      - {{topic: /a, type: sensor_msgs/msg/Imu}}
      - {{topic: /b, type: sensor_msgs/msg/Imu}}
      - {{topic: /c, type: sensor_msgs/msg/Imu, required: false}}
"""
_GRAPH = [
    InputGraph(topic, f"/front{topic}", (Endpoint("/driver", "sensor_msgs/msg/Imu"),)) for topic in ("/a", "/b", "/c")
]


@dataclass
class _History:
    """One run: how the optional input comes, and what became of it."""

    chance: random.Random
    sets: list[tuple[tuple[int | None, ...], int]] = field(default_factory=list)
    came: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.max_wait = self.chance.choice([50, 100, 300])
        self.delay = self.chance.choice([0, 0, 20, 80, 150, 600]) * MS
        self.shift = self.chance.choice([0, 0, 0, 0, 45, -3_000, 40_000]) * MS
        self.pauses = sorted(self.chance.randint(0, _LASTS_S) for _ in range(self.chance.choice([0, 2, 4])))

    def messages(self) -> list[tuple[int, int, int]]:
        """Times of receipt, inputs and stamps, in the order of receipt."""
        sent = range(BEGAN + S, BEGAN + _LASTS_S * S, _PERIOD)
        required = [(at + 5 * MS + self.chance.randint(0, 3 * MS), index, at) for at in sent for index in (0, 1)]
        optional = [(at + 6 * MS + self.delay, 2, at + self.shift) for at in sent if not self._is_paused(at)]
        return sorted(required + optional)

    def _is_paused(self, at: int) -> bool:
        return sum((at - BEGAN) // S >= pause for pause in self.pauses) % 2 == 1

    def came_too_late(self) -> bool:
        """Whether a message came that fits a set which had left without it."""
        return any(
            received > left and max(*required, stamp) - min(*required, stamp) <= _SLOP
            for (*members, optional), left in self.sets
            if optional is None
            for required in [[each for each in members if each is not None]]
            for stamp, received in self.came
        )


def _findings(history: _History):
    """The findings about the optional input, look by look, with the time; the history grows meanwhile."""
    (config,) = load_text(_FILE.format(max_wait=history.max_wait), environ={}).groups
    engine, watch = config.engine(), GroupWatch(config, began=BEGAN)
    looks = list(range(BEGAN + S, BEGAN + (_LASTS_S + 2) * S, history.chance.choice([1, 1, 4]) * S))
    events = list(heapq.merge(((at, -1, 0) for at in looks), history.messages()))
    arrivals: tuple[deque[tuple[int, int]], ...] = tuple(deque() for _ in range(3))
    sent: deque[tuple[tuple[int | None, ...], int]] = deque()

    def settle(outcomes, now):
        for outcome in outcomes:
            if isinstance(outcome, Match):
                newest = max(each.payload for each in outcome.messages if each is not None)
                history.sets.append((outcome.stamps, now))
                sent.append((outcome.stamps, now - newest))

    for at, index, stamp in events:
        while (due := engine.next_deadline()) is not None and due <= at:
            settle(engine.expire(now=due), due)
        if index >= 0:
            arrivals[index].append((stamp, at))
            if index == 2:
                history.came.append((stamp, at))
            settle(engine.add(Message(index, stamp, at), now=at), at)
            continue
        watch.add(arrivals, sent, engine.counts(), engine.sets, now=at)
        arrivals, sent = tuple(deque() for _ in range(3)), deque()
        facts = watch.facts(_GRAPH, now=at)
        yield at, next((each for each in judge(facts) if each.code is Code.WAITING_FOR_OPTIONAL), None)


def _template(text: str) -> str:
    """The cause in a sentence, without its figures."""
    return re.sub(r"[\d.]+ \w+", "N", text.partition(": ")[2]).replace("ahead of", "behind")


# When a cause that a case says is true.
_TRUE: dict[str, Callable[[_History, int], bool]] = {
    "an optional input that comes late": lambda history, _: history.came_too_late(),
    "an optional input whose stamps fit no set": lambda history, _: abs(history.shift) > _SLOP,
    "an optional input of another clock": lambda history, _: abs(history.shift) > S,
    "an optional input that went away": lambda history, at: at - history.came[-1][1] > S,
    "an optional input that never came": lambda history, _: not history.came,
    "an optional input that comes in time and is missing all the same": lambda *_: True,
}
_CAUSES = {_template(said_of_cases()[name][2]): name for name in _TRUE}


@pytest.mark.long
def test_no_cause_is_named_that_did_not_hold():
    named = set()
    for seed in _SEEDS:
        history = _History(random.Random(seed))
        for at, finding in _findings(history):
            if finding is not None:
                name = _CAUSES[_template(finding.text)]
                assert _TRUE[name](history, at), (seed, finding)
                named.add(name)
    assert named >= _TRUE.keys() - {"an optional input that never came"}


@pytest.mark.long
def test_an_input_that_has_been_in_every_set_for_long_is_not_told():
    for seed in _SEEDS:
        history = _History(random.Random(seed))
        for _, finding in _findings(history):
            latest = [stamps[2] for stamps, _ in history.sets[-60:]]
            if len(latest) == 60 and None not in latest:
                assert finding is None, seed
