"""Sets with a name: what is told of each set is what left, and who joins by it joins right."""

import json
import sys
from itertools import count, islice
from pathlib import Path
from typing import Any

import pytest

from tests.faults.extent import chosen
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Player, Stage, both_backends
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
@both_backends
def test_sets_are_joined_by_their_manifests_and_none_wrong(stage: Stage, figures):
    due = chosen(short=500, long=10_000)
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
