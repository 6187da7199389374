"""Transforms against the real tf2: what can be looked up, and when sets that wait for it leave."""

import random
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from syncrelay.frames import Edge, Frames
from syncrelay.sync import Lack, Match, Message, Transforms
from syncrelay.sync.transforms import TransformStage
from tests.cpp_peers import built
from tests.faults.extent import chosen
from tests.frames.worlds import BEGIN, SECOND, draw

DRIVER = Path(__file__).parent / "peer" / "tf2_driver.cpp"
HEADERS = tuple(Path("/usr/include/tf2", name) for name in ("buffer_core.h", "time_cache.h"))
SETS_OF_A_WORLD = 25
WORLDS = chosen(short=20, long=400)

# 10,000 sets take 4 min of a free core.
pytestmark = [pytest.mark.peer, pytest.mark.timeout(1800)]


@pytest.fixture
def driver(request):
    return built(request, DRIVER, package="libtf2-dev", headers=HEADERS, libraries=("tf2", "rostime"))


class Peer:
    """What tf2 is told and asked, in order; it answers all at once, when the worlds are over."""

    def __init__(self, driver):
        self.driver = driver
        self.lines = []

    def tell(self, edge):
        self.lines.append(f"transform {edge.parent} {edge.child} {edge.stamp} {int(edge.is_static)}")

    def ask(self, target, frame, stamp):
        self.lines.append(f"can {target} {frame or '-'} {stamp}")

    def answers(self):
        run = subprocess.run([self.driver], input="\n".join(self.lines), capture_output=True, text=True, check=True)
        return iter(run.stdout.splitlines())


@dataclass
class Fate:
    """When a set was matched, when it left or was given up, and what it lacked at each time in between."""

    members: tuple
    matched: int
    looked: list = field(default_factory=list)
    left: int | None = None
    given_up: int | None = None

    @property
    def ended(self):
        return self.left if self.given_up is None else self.given_up


class Play:
    """Our own run of a world: what became of its sets. The peer is asked about each that waits, at each event."""

    def __init__(self, world, peer):
        self.world, self.peer, self.frames = world, peer, Frames()
        transforms = Transforms(self.frames, world.target, world.wait)
        self.stage = TransformStage(transforms, n_inputs=4, repeats=False, most=10_000)
        self.fates: list[Fate] = []
        for now, event in [*world.events, (10**20, None)]:
            while (deadline := self.stage.next_deadline()) is not None and deadline <= now:
                self.note(self.stage.release(deadline), deadline)
            self.note(self.take(event, now), now)
        peer.lines.append("end")

    def take(self, event, now):
        if isinstance(event, Edge):
            self.peer.tell(event)
            self.frames.add(event)
        elif event is None:
            self.peer.lines.append("clear")
            self.frames.clear()
        else:
            self.fates.append(Fate(event, now))
        self.look(now)
        if not self.fates or self.fates[-1].members is not event:
            return self.stage.release(now)
        number = len(self.fates) - 1
        messages = [Message(place, each.stamp, number, frame=each.frame) for place, each in enumerate(event)]
        return self.stage.take([Match(tuple(messages))], now)

    def look(self, now):
        for fate in self.fates:
            if fate.ended is None:
                for member in fate.members:
                    self.peer.ask(self.world.target, member.frame, member.stamp)
                lacks = [self.frames.missing(self.world.target, each.frame, each.stamp) for each in fate.members]
                fate.looked.append((now, lacks))

    def note(self, outcomes: Any, now: int) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Match):
                self.fates[next(filter(None, outcome.messages)).payload].left = now
            else:
                self.fates[outcome.message.payload].given_up = now


def test_sets_leave_as_soon_as_tf2_can_transform_them(driver):
    peer, told = Peer(driver), {"left": 0, "given up": 0, "waited": 0, "waited for another": 0}
    worlds = [draw(seed, sets=SETS_OF_A_WORLD) for seed in range(WORLDS)]
    played = [(world, Play(world, peer).fates) for world in worlds]
    answers = peer.answers()
    for world, fates in played:
        tf2 = _answers_of(fates, answers)
        for number, fate in enumerate(fates):
            _check(world, fates, number, tf2[number], told)
            told["left"] += fate.left is not None
            told["given up"] += fate.given_up is not None
            told["waited"] += fate.left is not None and fate.left > fate.matched
    assert next(answers, None) is None
    assert min(told.values()) > WORLDS // 10, "too little happened to prove anything"


def _answers_of(fates, answers):
    """What tf2 said of each set at each time, in the order in which it was asked."""
    order = sorted((now, number) for number, fate in enumerate(fates) for now, _ in fate.looked)
    said: list[list[list[str]]] = [[] for _ in fates]
    for _, number in order:
        said[number].append([next(answers) for _ in fates[number].members])
    return said


def _check(world, fates, number, said, told):
    fate, where = fates[number], f"seed {world.seed}, set {number}"
    ready = None
    for (now, missing), words in zip(fate.looked, said, strict=True):
        assert [each is None for each in missing] == [each == "1" for each in words], f"{where}: {missing}, {words}"
        if all(each == "1" for each in words):
            ready = now if ready is None else ready
    before = max((each.ended for each in fates[:number]), default=0)
    if fate.left is not None:
        assert said[-1] == ["1"] * len(fate.members), f"{where} left, and tf2 says {said[-1]}"
        assert fate.left <= fate.matched + world.wait, where
        assert fate.left >= before, f"{where} left before the one before it"
        assert fate.left == max(ready or fate.matched, before), f"{where} was ready at {ready}"
        told["waited for another"] += ready is not None and fate.left > ready
    elif fate.given_up < fate.matched + world.wait:
        lacks = {each.lack for each in fate.looked[-1][1] if each is not None}
        overtaken = any(each.left == fate.given_up for each in fates[number + 1 :])
        assert Lack.NO_FRAME in lacks or (Lack.PAST in lacks and overtaken), f"{where} was given up: {lacks}"
        assert not any("into the future" in each for each in said[-1]) or lacks != {Lack.LATE}, where
    else:
        assert ready is None or said[-1] != ["1"] * len(fate.members), f"{where} was ready at {ready}, and given up"


def test_lookups_at_any_time_agree_with_tf2(driver):
    peer, ours, rng = Peer(driver), [], random.Random(7)
    for seed in range(WORLDS):
        world, frames = draw(seed, sets=40), Frames()
        for _, event in world.events:
            if event is None:
                peer.lines.append("clear")
                frames.clear()
            elif isinstance(event, Edge):
                peer.tell(event)
                frames.add(event)
                if rng.random() < 0.2:
                    names = [rng.choice([*world.frames, "", "nowhere", "/f0"]), rng.choice(world.frames)]
                    stamp = rng.choice((0, event.stamp, event.stamp - rng.randrange(15 * SECOND), BEGIN))
                    peer.ask(names[1], names[0], stamp)
                    ours.append((seed, names, stamp, frames.missing(names[1], names[0], stamp)))
        peer.lines.append("end")
    answers = list(peer.answers())
    assert len(answers) == len(ours)
    found = [(each, said) for each, said in zip(ours, answers, strict=True) if (each[3] is None) != (said == "1")]
    assert found == []
    assert 0.1 < sum(each[3] is None for each in ours) / len(ours) < 0.9
    lacks = {each[3].lack for each in ours if each[3] is not None}
    assert lacks == set(Lack), f"not drawn: {set(Lack) - lacks}"
