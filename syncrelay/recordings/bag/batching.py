"""Batches of messages: large enough that the cost per batch does not matter, small enough for memory."""

from collections.abc import Iterable, Iterator
from typing import Final

from syncrelay.recordings.bag.recording import RawMessage

_MESSAGES: Final = 2_000
_BYTES: Final = 4_000_000


def batched(messages: Iterable[RawMessage]) -> Iterator[list[RawMessage]]:
    """Yield single messages in batches."""
    return filled([each] for each in messages)


def filled(batches: Iterable[list[RawMessage]]) -> Iterator[list[RawMessage]]:
    """Yield small batches joined into larger ones; none is empty."""
    held: list[RawMessage] = []
    size = 0
    for batch in batches:
        if not held and len(batch) >= _MESSAGES:
            yield batch
            continue
        held += batch
        size += sum([len(payload) for _, _, payload in batch])
        if len(held) >= _MESSAGES or size >= _BYTES:
            yield held
            held, size = [], 0
    if held:
        yield held
