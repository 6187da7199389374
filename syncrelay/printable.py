"""Text from outside, made safe to show: nothing in it moves a cursor, hides, reorders, or passes for a line of ours."""

import unicodedata
from collections.abc import Iterator, Sequence


def printable(text: str) -> str:
    """Return the text on one line, with escapes for what would move a cursor or hide in a terminal.

    That is all that Unicode does not call printable: the controls of C0 and C1, line breaks of every kind, what
    reorders text (bidi), and lone surrogates, which no encoding has.
    """
    return text if text.isprintable() else "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def printable_lines(text: str) -> str:
    """Return a text of our own as `printable` does, its newlines kept."""
    return text if text.isprintable() else "\n".join(map(printable, text.split("\n")))


def one_entry(text: str) -> str:
    """Return printable lines of which all but the first are indented, so that none passes for an entry of its own."""
    first, *more = printable_lines(text).split("\n")
    return "\n".join([first, *(line if line.startswith("  ") or not line else f"  {line}" for line in more)])


def columns_of(text: str) -> int:
    """Return how many columns of a terminal a printable text takes."""
    return sum(
        0 if unicodedata.combining(each) else 2 if unicodedata.east_asian_width(each) in ("W", "F") else 1
        for each in text
    )


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows as indented lines, each column as wide as its widest cell."""
    sizes = [list(map(columns_of, row)) for row in rows]
    widths = [max(column) for column in zip(*sizes, strict=True)]
    for row, of_row in zip(rows, sizes, strict=True):
        padded = [cell + " " * (width - size) for cell, size, width in zip(row, of_row, widths, strict=True)]
        yield f"  {'  '.join(padded)}".rstrip()
