"""Of damaged recordings, what can be read is read and the rest is reported, in bounded time and memory."""

import tracemalloc
from contextlib import closing
from itertools import chain
from pathlib import Path

import pytest

from syncrelay.errors import BagError
from syncrelay.recordings.bag import open_recording
from tests.faults.extent import chosen
from tests.recordings.bag.damage import FRAMES, KINDS, damaged, with_lying_lengths

pytestmark = pytest.mark.faults

# Of each kind; of each format there are two kinds or more.
_PLACES = chosen(short=50, long=4000)
_LIES = chosen(short=15, long=500)
_YEAR_2116 = 2**62
# The recordings have 10 kB. A wrong length asks for a thousand times as much as this.
_MEMORY = 16_000_000


@pytest.mark.timeout(chosen(short=600, long=1200))
@pytest.mark.parametrize("kind", KINDS)
def test_no_flipped_bit_and_no_missing_end_stops_the_reading(kind: str, tmp_path: Path):
    path = KINDS[kind](tmp_path)
    whole = path.read_bytes()
    readable = 0
    for what, content in damaged(whole, places=_PLACES, seed=14):
        path.write_bytes(content)
        readable += _is_read(path, what, most=len(FRAMES), least=len(FRAMES) if what.startswith("cut") else 0)
    assert readable > _PLACES / 2


@pytest.mark.timeout(chosen(short=600, long=1200))
@pytest.mark.parametrize("kind", KINDS)
def test_a_length_that_lies_does_not_cost_its_memory(kind: str, tmp_path: Path):
    path = KINDS[kind](tmp_path)
    whole = path.read_bytes()
    tracemalloc.start()
    try:
        for what, content in with_lying_lengths(whole, places=_LIES, seed=14):
            path.write_bytes(content)
            tracemalloc.reset_peak()
            _is_read(path, what, most=len(whole))
            assert tracemalloc.get_traced_memory()[1] < _MEMORY, what
    finally:
        tracemalloc.stop()


def _is_read(path: Path, what: str, *, most: int, least: int = 0) -> bool:
    """Read a recording; False if it is refused with a BagError. Any other error is raised with a note on the damage.

    If fewer than `least` messages are read, a fault has to say so.
    """
    try:
        with closing(open_recording([str(path)])) as recording:
            messages = list(chain.from_iterable(recording.batches(recording.channels)))
            faults = list(recording.faults)
            assert recording.position == recording.size
            assert 0 <= recording.begin <= recording.end < _YEAR_2116
    except BagError:
        return False
    except Exception as error:
        error.add_note(what)
        raise
    assert all(isinstance(payload, bytes) and 0 <= received < _YEAR_2116 for _, received, payload in messages)
    assert all(str(path) in fault for fault in faults)
    assert len(messages) <= most, what
    assert faults or len(messages) >= least, what
    return True
