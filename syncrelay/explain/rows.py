"""Rows of numbers, as many as a long recording gives: the first are in memory, all after these in a temporary file."""

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from math import ceil
from typing import IO, Final, Protocol, TypeAlias, overload

import numpy as np
import numpy.typing as npt

from syncrelay.errors import OutputError

Numbers: TypeAlias = npt.NDArray[np.int64]
Stretches: TypeAlias = Callable[[], Iterable[Numbers]]
"""Gives numbers some at a time, each time that it is called."""

BLOCK: Final = 1 << 14
"""So many rows are kept, and worked on, at a time."""

# So many bytes stay in memory: most recordings need no file.
_IN_MEMORY: Final = 1_000_000
_BYTES: Final = 8
# So many numbers are sorted at once; of more, those are counted that lie in each of so many parts of their range.
_AT_ONCE: Final = 1 << 17
_PARTS: Final = 1 << 14


class Column(Protocol):
    """Numbers that are read in stretches; an array is one."""

    def __len__(self) -> int: ...

    @overload
    def __getitem__(self, at: int, /) -> int: ...
    @overload
    def __getitem__(self, at: slice, /) -> Numbers: ...


def blocks(column: Column, size: int = BLOCK) -> Iterator[Numbers]:
    """Yield the numbers of a column in order, in arrays of up to `size`."""
    for begin in range(0, len(column), size):
        yield column[begin : begin + size]


def steps(column: Column) -> Iterator[Numbers]:
    """Yield how far it is from each number of a column to the next."""
    for begin in range(0, len(column) - 1, BLOCK):
        yield np.diff(column[begin : begin + BLOCK + 1])


def extent(stretches: Stretches) -> tuple[int, int, int]:
    """Return how many numbers there are, the least and the greatest; the least is above the greatest of none."""
    count, least, greatest = 0, 2**63 - 1, -(2**63)
    for some in stretches():
        if len(some):
            count, least, greatest = count + len(some), min(least, int(some.min())), max(greatest, int(some.max()))
    return count, least, greatest


def quantiles(stretches: Stretches, shares: Sequence[float]) -> list[int]:
    """Return the numbers that these shares of all do not exceed; they occurred. There must be one or more."""
    count, least, greatest = extent(stretches)
    # As np.quantile's inverted_cdf has it, to the last bit.
    ranks = [max(0, ceil(count * share - 1)) for share in shares]
    return _ranked(stretches, ranks, count, least, greatest)


def median(stretches: Stretches) -> float:
    """Return the number in the middle, or the mean of the two there. There must be one or more."""
    count, least, greatest = extent(stretches)
    low, high = _ranked(stretches, [(count - 1) // 2, count // 2], count, least, greatest)
    return (float(low) + float(high)) / 2


def _ranked(stretches: Stretches, ranks: Sequence[int], count: int, least: int, greatest: int) -> list[int]:
    """Return numbers by their ranks, from 0, among those from the least to the greatest, of which there are so many."""

    def within() -> Iterator[Numbers]:
        return (some[(some >= least) & (some <= greatest)] for some in stretches())

    if least == greatest:
        return [least] * len(ranks)
    if count <= _AT_ONCE:
        ordered = np.sort(np.concatenate([*within()]))
        return [int(ordered[rank]) for rank in ranks]
    width, counts = (greatest - least) // _PARTS + 1, np.zeros(_PARTS, dtype=np.int64)
    for some in within():
        # Unsigned, as two numbers may be farther apart than an int64 can say.
        beyond = some.astype(np.uint64) - np.uint64(least % 2**64)
        counts += np.bincount((beyond // np.uint64(width)).astype(np.int64), minlength=_PARTS)
    ends = np.cumsum(counts)
    parts = np.searchsorted(ends, ranks, side="right").tolist()
    found: dict[int, int] = {}
    for part in set(parts):
        begin, before = least + part * width, int(ends[part] - counts[part])
        of_part = [rank for rank, its in zip(ranks, parts, strict=True) if its == part]
        numbers = _ranked(
            stretches, [rank - before for rank in of_part], int(counts[part]), begin, min(greatest, begin + width - 1)
        )
        found.update(zip(of_part, numbers, strict=True))
    return [found[rank] for rank in ranks]


def no_numbers() -> Column:
    """Return a column without numbers."""
    return np.zeros(0, dtype=np.int64)


class Rows:
    """A table of numbers that grows at its end; `rows[first:after]` reads a stretch of it."""

    def __init__(self, width: int, *, in_memory: int = _IN_MEMORY) -> None:
        """Keep up to so many bytes in memory, and a block more."""
        self.width: Final = width
        self._in_memory = in_memory
        self._blocks: list[Numbers] = []
        self._file: IO[bytes] | None = None
        self._last: list[Numbers] = []
        self._in_last = 0
        self._in_blocks = 0

    def append(self, rows: Numbers) -> None:
        """Add rows at the end. Raises OutputError if the temporary file cannot be written."""
        if not len(rows):
            return
        self._last.append(rows)
        self._in_last += len(rows)
        if whole := self._in_last - self._in_last % BLOCK:
            joined = np.concatenate(self._last)
            for begin in range(0, whole, BLOCK):
                self._keep(joined[begin : begin + BLOCK])
            self._in_last -= whole
            # A copy, so that the rest is not held.
            self._last = [joined[whole:].copy()]

    def _keep(self, block: Numbers) -> None:
        self._in_blocks += BLOCK
        if (len(self._blocks) + 1) * block.size * _BYTES <= self._in_memory:
            self._blocks.append(block.copy())
            return
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115  closed by __del__
            self._file.write(block.tobytes())
            self._file.flush()
        except OSError as error:
            why = f"{tempfile.tempdir or 'a temporary file'}: cannot be written: {error.strerror or error}"
            raise OutputError(f"{why}; set TMPDIR to another folder") from error

    def __del__(self) -> None:
        if self._file is not None:
            # What could not be written would be tried once more.
            with suppress(OSError):
                self._file.close()

    def __len__(self) -> int:
        return self._in_blocks + self._in_last

    def __getitem__(self, among: slice) -> Numbers:
        first, after, _ = among.indices(len(self))
        held = len(self._blocks) * BLOCK
        parts = [
            self._blocks[begin // BLOCK][max(0, first - begin) : after - begin]
            for begin in range(first - first % BLOCK, min(after, held), BLOCK)
        ]
        if (begin := max(first, held)) < (end := min(after, self._in_blocks)):
            parts.append(self._read(begin - held, end - begin))
        if after > self._in_blocks:
            if len(self._last) > 1:
                self._last = [np.concatenate(self._last)]
            parts.append(self._last[0][max(0, first - self._in_blocks) : after - self._in_blocks])
        if not parts:
            return np.zeros((0, self.width), dtype=np.int64)
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _read(self, place: int, count: int) -> Numbers:
        assert self._file is not None  # noqa: S101  there are blocks after those in memory
        size = self.width * _BYTES
        content = os.pread(self._file.fileno(), count * size, place * size)
        return np.frombuffer(content, dtype=np.int64).reshape(-1, self.width)

    def blocks(self) -> Iterator[Numbers]:
        """Yield all rows in order, many at a time."""
        for begin in range(0, len(self), BLOCK):
            yield self[begin : begin + BLOCK]

    def lists(self) -> Iterator[list[int]]:
        """Yield the rows in order as lists."""
        for block in self.blocks():
            yield from block.tolist()

    def column(self, place: int) -> Column:
        """Return one column, as long as the table is whenever it is asked."""
        return _ColumnOf(self, place)


class _ColumnOf:
    def __init__(self, rows: Rows, place: int) -> None:
        self._rows = rows
        self._place = place

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, at: int) -> int: ...
    @overload
    def __getitem__(self, at: slice) -> Numbers: ...
    def __getitem__(self, at: int | slice) -> int | Numbers:
        if isinstance(at, slice):
            # Not a view, which would keep the other columns.
            first, after, _ = at.indices(len(self))
            column = np.empty(max(0, after - first), dtype=np.int64)
            for begin in range(first, after, BLOCK):
                some = self._rows[begin : min(begin + BLOCK, after)]
                column[begin - first : begin - first + len(some)] = some[:, self._place]
            return column
        at = range(len(self))[at]
        return int(self._rows[at : at + 1][0, self._place])
