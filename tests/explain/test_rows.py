"""Rows of numbers are what was appended, whichever of them are in memory and whichever in the file."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.errors import OutputError
from syncrelay.explain.rows import BLOCK, Rows, blocks, median, quantiles, steps

_SIZES = st.integers(0, 3 * BLOCK)


@given(sizes=st.lists(_SIZES, max_size=5), width=st.integers(1, 3), ends=st.tuples(st.integers(), st.integers()))
def test_any_stretch_is_what_was_appended(sizes, width, ends):
    whole = np.arange(width * sum(sizes), dtype=np.int64).reshape(-1, width)
    kept = Rows(width, in_memory=BLOCK * width * 8 * 2)
    begin = 0
    for size in sizes:
        kept.append(whole[begin : begin + size])
        begin += size
    assert len(kept) == len(whole)
    first, after = (end % (len(whole) + 1) for end in ends)
    assert np.array_equal(kept[first:after], whole[first:after])
    assert np.array_equal(np.concatenate([*kept.blocks(), whole[:0]]), whole)
    column = kept.column(width - 1)
    assert np.array_equal(np.concatenate([*blocks(column), whole[:0, 0]]), whole[:, -1])
    if len(whole):
        assert (column[0], column[-1], column[len(whole) // 2]) == tuple(whole[[0, -1, len(whole) // 2], -1].tolist())


def test_a_full_disk_is_said_with_what_helps(monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda: Path("/dev/full").open("r+b"))  # noqa: SIM115
    with pytest.raises(OutputError, match="cannot be written: No space left on device; set TMPDIR to another folder"):
        Rows(1, in_memory=0).append(np.zeros((BLOCK, 1), dtype=np.int64))


@pytest.mark.parametrize("count", [1, 2, 1000, 300_001])
@pytest.mark.parametrize("spread", [10, 10**6, 2**62])
def test_quantiles_and_medians_of_stretches_are_those_of_the_whole(count, spread):
    rng = np.random.default_rng(count)
    whole = rng.integers(-spread, spread, count)
    # One far off all others, as where a clock was set.
    whole[0] = 2**63 - 1
    shares = (0.0, 0.05, 0.5, 0.75, 0.95, 0.995, 1.0)
    expected = [int(np.quantile(whole, share, method="inverted_cdf")) for share in shares]
    assert quantiles(lambda: blocks(whole), shares) == expected
    assert median(lambda: blocks(whole)) == float(np.median(whole))
    assert np.array_equal(np.concatenate([*steps(whole), whole[:0]]), np.diff(whole))
