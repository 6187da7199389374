"""Sets with a name: what is told of each set is what left, and who joins by it joins right."""

import json
import sys
from itertools import count, islice
from pathlib import Path
from time import time_ns
from typing import Any

import pytest

from tests.faults.extent import chosen
from tests.ros.cdr_messages import CLOCK, VECTOR, serialize, time, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.manifests import MANIFEST_TYPE, OK, STALE, WARN, Told, ToldInput, read
from tests.ros.processes import Process, wait_until
from tests.ros.relaying import play_until_out
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Collector, Player, Stage, both_backends
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.ros

_JOINER = Path(__file__).parents[2] / "examples/join_sets.py"
_MANIFEST = "/syncrelay/front/sets"
_AFTER_A = {"/a": 0, "/b": 3 * MS, "/c": 6 * MS}
_OUTPUTS = {f"/front{topic}": VECTOR for topic in _AFTER_A}
_PERIOD = 100 * MS
# Less than DDS keeps of manifests, so that none is replaced before the joiner has it.
_BATCH = 250
_THREE = {
    "policy": "approximate_time",
    "slop": "20ms",
    # Sets leave by what comes, never by the clock.
    "max_wait": "10min",
    "queue_size": ROOMY,
    "topics": [
        *inputs({"/a": VECTOR, "/b": VECTOR}, qos=LOSSLESS),
        *inputs({"/c": VECTOR}, qos=LOSSLESS, required=False),
    ],
}


def _stamps(number: int) -> dict[str, int | None]:
    """The stamps of a set by its outputs; a third has no message of the optional input."""
    began = BEGIN + number * _PERIOD
    return {
        f"/front{topic}": None if topic == "/c" and number % 3 == 1 else began + after
        for topic, after in _AFTER_A.items()
    }


def _frames(number: int) -> list[Frame]:
    stamps = _stamps(number).items()
    return [
        Frame(output.removeprefix("/front"), VECTOR, 0, vector(stamp)) for output, stamp in stamps if stamp is not None
    ]


def _joiner(stage: Stage) -> Process:
    words = [word for pair in _OUTPUTS.items() for word in pair]
    return stage.start("joiner", [sys.executable, str(_JOINER), _MANIFEST, *words])


def _joined(joiner: Process) -> list[dict[str, Any]]:
    return [json.loads(line) for line in joiner.stdout.splitlines()]


def _first_joined(player: Player, joiner: Process, numbers: count) -> int:
    """Play sets until a whole one is joined: from then on all of them reach the joiner. Returns its index."""
    player.match()

    def come() -> bool:
        if any(None not in each.values() for each in _joined(joiner)):
            return True
        player.play(_frames(next(numbers)))
        return False

    wait_until(come, "a first set")
    return next(index for index, each in enumerate(_joined(joiner)) if None not in each.values())


def _play_batch(player: Player, numbers: count) -> int:
    """Play the next sets at once; the number of the last."""
    batch = list(islice(numbers, _BATCH))
    player.play([frame for number in batch for frame in _frames(number)], speed=1e9)
    return batch[-1]


def _wait_for_lines(process: Process, lines: int) -> None:
    process.wait_until(lambda: process.stdout.count("\n") >= lines, f"line {lines}")


@pytest.mark.faults
def test_sets_are_joined_by_their_manifests_and_none_wrong(stage: Stage, figures):
    due = chosen(short=2_000, long=10_000)
    stage.relay(config({"front": _THREE}))
    player, joiner, numbers = stage.player(dict.fromkeys(_AFTER_A, VECTOR)), _joiner(stage), count()
    first = _first_joined(player, joiner, numbers)
    begin = (_joined(joiner)[first]["/front/a"] - BEGIN) // _PERIOD
    last = begin
    while last - begin < due:
        last = _play_batch(player, numbers)
        # The last waits for what may be closer still.
        _wait_for_lines(joiner, first + last - begin)
    joined = _joined(joiner)[first:]
    assert joined == [{"set": joined[0]["set"] + nth, **_stamps(begin + nth)} for nth in range(last - begin)]
    missing = sum(each["/front/c"] is None for each in joined)
    figures(f"{len(joined)} sets joined by their manifests, {missing} of them without the optional input: none wrong")


_MIXED = {
    "policy": "exact_time",
    "restamp": "/a",
    "max_wait": "10min",
    "topics": [
        *inputs({"/a": VECTOR}, qos=LOSSLESS, offset="-3ms"),
        *inputs({"/b": VECTOR}, qos=LOSSLESS),
        {"topic": "/field", "type": CLOCK, "qos": LOSSLESS, "required": False, "stamp": {"field": "clock"}},
    ],
}
_MIXED_TYPES = {"/a": VECTOR, "/b": VECTOR, "/field": CLOCK}
_MIXED_OUTPUTS = {f"/front{topic}": type_name for topic, type_name in _MIXED_TYPES.items()}


def _mixed(number: int) -> list[Frame]:
    """A set whose inputs are stamped 3 ms apart; every second one has a message without a header too."""
    stamp = BEGIN + number * _PERIOD
    frames = [Frame("/a", VECTOR, 0, vector(stamp + 3 * MS)), Frame("/b", VECTOR, 0, vector(stamp))]
    return frames if number % 2 else [*frames, Frame("/field", CLOCK, 0, serialize(CLOCK, time(stamp)))]


def _told(collector: Collector) -> list[Told]:
    return [read(payload) for payload in collector.payloads(_MANIFEST)]


def _play_until_told(player: Player, collector: Collector, frames: list[Frame], number: int) -> list[Told]:
    """What has been told as soon as it ends with the set of that number."""
    player.play(frames, speed=1e9)
    last = BEGIN + number * _PERIOD + 3 * MS
    collector.process.wait_until(lambda: _told(collector)[-1].stamp == last, f"the manifest of set {number}")
    return _told(collector)


@both_backends
def test_what_is_told_of_each_set_is_what_left_and_goes_on_after_reloads(stage: Stage):
    collector = stage.collector({**_MIXED_OUTPUTS, _MANIFEST: MANIFEST_TYPE})
    file = ReloadedFile(stage, front=_MIXED)
    player, numbers = stage.player(_MIXED_TYPES), count()
    play_until_out(player, collector, map(_mixed, numbers), [*_MIXED_OUTPUTS, _MANIFEST])
    before = time_ns()
    chosen = list(islice(numbers, 6))
    # A whole set at the end, which waits for nothing.
    chosen += islice(numbers, 2 - chosen[-1] % 2)
    told = _play_until_told(player, collector, [frame for number in chosen for frame in _mixed(number)], chosen[-1])
    assert [each.number for each in told] == list(range(told[0].number, told[0].number + len(told)))
    for each, number in zip(told[-len(chosen) :], chosen, strict=True):
        assert _without_measures(each) == _expected(number, each.number)
        there = [(its.received, its.sequence or 0) for its in each.inputs if its.received is not None]
        assert all(before <= received <= time_ns() and sequence > 0 for received, sequence in there)
        assert 0 <= each.latency <= time_ns() - before
    (publisher,) = collector.endpoints(_MANIFEST, kind="publisher")
    assert (publisher["reliability"], publisher["durability"]) == ("reliable", "volatile")

    # A group that a reload keeps goes on counting; one that it changes begins again, for the same subscribers.
    file.reload(front=_MIXED, other={**_MIXED, "output_prefix": "/other"})
    (number,) = (each for each in islice(numbers, 2) if each % 2 == 0)
    assert _play_until_told(player, collector, _mixed(number), number)[-1].number == told[-1].number + 1
    file.reload(front={**_MIXED, "queue_size": 5})
    (number,) = (each for each in islice(numbers, 2) if each % 2 == 0)
    assert _play_until_told(player, collector, _mixed(number), number)[-1].number == 1
    # Without a manifest there is nothing to see of it.
    file.reload(front={**_MIXED, "manifest": False})
    wait_until(lambda: not collector.endpoints(_MANIFEST, kind="publisher"), "the end of the manifest")


def _without_measures(told: Told) -> Told:
    return told._replace(latency=0, inputs=tuple(each._replace(sequence=None, received=None) for each in told.inputs))


def _expected(number: int, told_as: int) -> Told:
    stamp, lacks = BEGIN + number * _PERIOD, bool(number % 2)
    common = stamp + 3 * MS
    return Told(
        stamp=common,
        level=WARN if lacks else OK,
        group="front",
        message="1 of 3 missing" if lacks else "complete",
        node="/syncrelay",
        number=told_as,
        missing=int(lacks),
        span=0,
        latency=0,
        common_stamp=common,
        policy="exact_time",
        inputs=(
            ToldInput(OK, "/front/a", "/a", "", stamp=common, original_stamp=common),
            ToldInput(OK, "/front/b", "/b", "", stamp=common, original_stamp=stamp),
            ToldInput(STALE, "/front/field", "/field", "missing")
            if lacks
            else ToldInput(OK, "/front/field", "/field", "", stamp=stamp, original_stamp=stamp),
        ),
    )
