"""The example that joins sets by their manifests: whatever comes late, or not at all, no set is joined wrong."""

import random
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

from syncrelay.config import load_text
from syncrelay.dataflow.manifest import ManifestWriter
from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR
from tests.ros.configs import config, inputs
from tests.ros.manifests import Member, note
from tests.ros.streams import BEGIN, MS

serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
DiagnosticArray = pytest.importorskip("diagnostic_msgs.msg").DiagnosticArray

_JOINER = runpy.run_path(str(Path(__file__).parents[2] / "examples/join_sets.py"))["SetJoiner"]
_TOPICS = ("/a", "/b", "/c")
_GROUP = load_text(config({"front": {"policy": "exact_time", "topics": inputs(dict.fromkeys(_TOPICS, VECTOR))}}))
_WRITER = ManifestWriter(_GROUP.groups[0], node="/syncrelay", topics=[(topic, topic) for topic in _TOPICS], bundle=None)


def _message(stamp: int, *, has_header: bool) -> SimpleNamespace:
    seconds, nanoseconds = divmod(stamp, NS_PER_SECOND)
    time = SimpleNamespace(sec=seconds, nanosec=nanoseconds)
    return SimpleNamespace(header=SimpleNamespace(stamp=time)) if has_header else SimpleNamespace(data="")


class _Run:
    """One run of a relay: sets with random gaps, and all that it publishes, topic by topic."""

    def __init__(self, chance: random.Random, began: int) -> None:
        self.sets: list[dict[str, SimpleNamespace | None]] = []
        self.published: dict[str, list[tuple]] = {topic: [] for topic in (*_TOPICS, "")}
        for number in range(1, chance.randint(1, 40)):
            there = [True, chance.random() < 0.9, chance.random() < 0.6]
            stamps = [began + number * MS + index for index in range(3)]
            self._add(number, [stamp if is_there else None for stamp, is_there in zip(stamps, there, strict=True)])

    def _add(self, number: int, stamps: list[int | None]) -> None:
        members: list[Member | None] = []
        joined: dict[str, SimpleNamespace | None] = {}
        for topic, stamp in zip(_TOPICS, stamps, strict=True):
            joined[topic] = None if stamp is None else _message(stamp, has_header=topic != "/b")
            sequence = len(self.published[topic]) + 1
            members.append(None if stamp is None else Member(stamp, stamp, stamp, sequence))
            if stamp is not None:
                self.published[topic].append((joined[topic], {"publication_sequence_number": sequence}))
        (payload,) = _WRITER.write([note(number, members)])
        self.published[""].append((serialization.deserialize_message(payload, DiagnosticArray),))
        self.sets.append(joined)


def _feed(joiner, run: _Run, chance: random.Random, *, losing: float) -> int:
    """Deliver each topic in its order, the topics in any; how many messages were lost."""
    left, lost = {topic: list(published) for topic, published in run.published.items()}, 0
    while topics := [topic for topic, pending in left.items() if pending]:
        topic = chance.choice(topics)
        content = left[topic].pop(0)
        if chance.random() < losing:
            lost += 1
        elif topic:
            joiner.add_message(topic, *content)
        else:
            joiner.add_manifest(*content)
    return lost


def _joiner(taken: list[tuple]):
    return _JOINER(_TOPICS, lambda number, messages: taken.append((number, messages)))


@pytest.mark.parametrize("seed", range(20))
def test_all_sets_are_joined_in_order_whatever_order_the_topics_come_in(seed: int):
    chance = random.Random(seed)
    taken: list[tuple] = []
    run = _Run(chance, BEGIN)
    _feed(_joiner(taken), run, chance, losing=0)
    assert taken == list(enumerate(run.sets, 1))


@pytest.mark.parametrize("seed", range(40))
def test_what_is_lost_costs_sets_and_makes_none_wrong(seed: int):
    chance = random.Random(seed)
    taken: list[tuple] = []
    joiner = _joiner(taken)
    # Each run begins where the relay was started again; what was on its way then is lost.
    runs = [_Run(chance, BEGIN + n * 1000 * MS) for n in range(3)]
    due = 0
    for run in runs:
        before = len(taken)
        due += len(run.sets) - _feed(joiner, run, chance, losing=chance.choice([0.02, 0.2]))
        numbers = [number for number, _ in taken[before:]]
        assert numbers == sorted(set(numbers))
        assert taken[before:] == [(number, run.sets[number - 1]) for number in numbers]
    assert len(taken) <= sum(len(run.sets) for run in runs)
    assert taken or due <= 0
