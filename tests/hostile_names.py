"""Hostile names, and a check that a text made with them is safe to show."""

import random

FORGED = "FORGED"
_SEQUENCES = (
    *("\x1b[2J\x1b[H", "\x1b]0;owned\x07", "\x1b[31m", "\x9b5A", "\x85", "\u2028", "\u2029", "\u202e", "\u2066"),
    *("\ufeff", "\r", "\b\b\b", "\x00", "\x7f", "\t", "[bold red]", "[/]", "</script><script>", "<img src=x>"),
    *("::error::", "##[error]", "%0A", "`", "'", '"', "\\", "{", "#", " ", "ü", "点"),
)


def hostile_name(chance: random.Random) -> str:
    """A name with sequences that a terminal, a log, a page or a CI workflow may interpret."""
    parts = [*chance.sample(_SEQUENCES, 6), f"\n{FORGED}", f"\r\n{FORGED}", "name"]
    chance.shuffle(parts)
    return "".join(parts)


def assert_shown_safely(text: str) -> None:
    """Assert that a text has only printable characters and newlines, and that no name begins a line."""
    assert {each for each in text if not each.isprintable()} <= {"\n"}
    assert [line for line in text.split("\n") if line.startswith(FORGED)] == []
