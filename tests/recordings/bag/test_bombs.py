"""What no reading of a recording takes, whatever it holds: more bytes and more steps than there is in the file."""

import bz2
import re
import tracemalloc
from contextlib import closing
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.writer import CompressionType

from syncrelay.errors import BagError
from syncrelay.recordings.bag import effort, open_recording
from syncrelay.recordings.bag.effort import Effort
from syncrelay.recordings.bag.unpacking import unbz2, unlz4, unzstd
from tests.calls import Calls
from tests.faults.extent import chosen
from tests.recordings.bag.bombs import FRAMES, LONGEST_RECORD, Drawn, drawn, zstd_piecewise
from tests.recordings.bag.making import write_mcap
from tests.recordings.bag.reading import read
from tests.ros.cdr_messages import IMAGE
from tests.ros.frames import Frame

_SEED = 28
_COUNT = chosen(short=24, long=1000)
_LARGEST = chosen(short=1 << 25, long=1 << 28)
# Smaller than they are, so that small bombs are too large.
_FITS = 1 << 20
_RECORDS = 500
# What a piece of Zstandard may unpack to, and a file that is read as a whole.
_MEMORY = 40_000_000
# Of a healthy recording: 3,000.
_CALLS = 40_000


@pytest.mark.faults
@pytest.mark.timeout(chosen(short=600, long=3600))
def test_no_recording_takes_more_than_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(effort, "ALWAYS_FITS", _FITS)
    monkeypatch.setattr(effort, "MOST_RECORDS", _RECORDS)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    for number, each in enumerate(drawn(tmp_path, count=_COUNT, seed=_SEED, most=_LARGEST)):
        try:
            _check(each)
        except BaseException as error:
            error.add_note(f"recording {number} of seed {_SEED}: {each.what}")
            raise


def _check(each: Drawn) -> None:
    size = each.path.stat().st_size
    found: list[Frame] = []
    faults: list[str] = []
    unpacked = 0
    tracemalloc.start()
    calls = Calls()
    try:
        with calls, closing(open_recording([str(each.path)])) as recording:
            unpacked = recording.size
            for batch in recording.batches(recording.channels):
                found += [Frame(channel.topic, channel.type, time, payload) for channel, time, payload in batch]
            faults = list(recording.faults)
    except BagError as error:
        faults = [str(error)]
    finally:
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    most = _FITS + effort.MOST_TIMES * size
    assert unpacked <= most
    assert peak < 2 * most + _MEMORY
    # A sqlite3 file holds each message as it is, or in fewer bytes where it has been packed.
    assert sum(len(frame.payload) for frame in found) <= size or each.path.suffix != ".db3"
    assert calls.count < _CALLS
    received = {(frame.topic, frame.time) for frame in found}
    # Outside of chunks nothing tells that the record that was cut off was filled up with zeros.
    assert len(received - {(frame.topic, frame.time) for frame in FRAMES}) <= ("cut off" in each.what)
    assert received >= {(frame.topic, frame.time) for frame in each.readable} or each.path.suffix in _PACKED
    assert faults or len(found) == len(FRAMES)
    # Of a file of which nothing can be read, the error names the first fault alone.
    if each.end is not None and 0 < len(found) < len(FRAMES):
        (place,) = (re.search(r"cut off or damaged at byte (\d+) of", fault) for fault in faults if "cut off" in fault)
        assert place is not None
        assert abs(int(place[1]) - each.end) < LONGEST_RECORD


_PACKED = (".bz2", ".zst", ".gz")


def _mib(count: int) -> int:
    return count << 20


@pytest.mark.parametrize(
    ("pack", "unpack"),
    [(zstandard.compress, unzstd), (zstd_piecewise, unzstd), (bz2.compress, unbz2)],
    ids=["zstd", "zstd that tells no size", "bz2"],
)
def test_what_is_unpacked_without_a_message_is_bounded_by_what_is_packed(pack, unpack):
    packed, spent = pack(bytes(_mib(2))), Effort()
    fitting, refusal = 0, ""
    try:
        while fitting < 100:
            unpack(packed, spent)
            fitting += 1
    except ValueError as error:
        refusal = str(error)
    assert refusal == effort.TOO_MUCH
    most = effort.ALWAYS_FITS + effort.MOST_TIMES * len(packed) * (fitting + 1)
    assert _mib(2) * fitting <= most < _mib(2) * (fitting + 1)
    # What holds a message may be packed as well as it can be.
    for _ in range(100):
        spent.found_message()
        assert len(unpack(packed, spent)) == _mib(2)


def test_what_cannot_be_packed_well_is_unpacked_however_much_it_is():
    packed, spent = lz4.frame.compress(bytes(_mib(2))), Effort()
    for _ in range(50):
        assert len(unlz4(packed, spent)) == _mib(2)


def test_nothing_unpacks_to_more_than_a_gibibyte():
    spent = Effort()
    spent.begin(packed=2 << 30)
    spent.unpack(1 << 30)
    with pytest.raises(ValueError, match="more than 1 GiB"):
        spent.unpack(1)


def test_a_file_that_unpacks_to_more_than_fits_is_read_up_to_there(tmp_path, monkeypatch):
    monkeypatch.setattr(effort, "ALWAYS_FITS", _mib(1))
    packed = bz2.compress(write_mcap(tmp_path / "rig.mcap", FRAMES).read_bytes() + bytes(_mib(16)))
    (tmp_path / "rig.mcap.bz2").write_bytes(packed)
    frames, (fault,), _ = read(tmp_path / "rig.mcap.bz2")
    assert (frames, effort.TOO_MUCH in fault) == (FRAMES, True)


def test_many_images_of_one_color_are_read(tmp_path, monkeypatch):
    """Each chunk is packed 10,000 times, and holds messages."""
    monkeypatch.setattr(effort, "ALWAYS_FITS", _mib(1))
    frames = [Frame("/camera", IMAGE, 1000 + n, bytes(500_000)) for n in range(12)]
    path = write_mcap(tmp_path / "dark.mcap", frames, compression=CompressionType.ZSTD, chunk_size=400_000)
    assert effort.MOST_TIMES * path.stat().st_size < 12 * 500_000
    for wanted in (True, False):
        frames, faults, _ = read(path, topics=None if wanted else set())
        assert (len(frames), faults) == (12 if wanted else 0, [])
