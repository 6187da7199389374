"""What became of every message, in words: the last thing a relay, a replay and the demo say."""

from collections.abc import Iterator, Sequence
from typing import Protocol

from syncrelay.sync.counts import InputCounts


class InputAccount(Protocol):
    """An input, by the name that the file gives its topic, and where its messages went."""

    @property
    def topic(self) -> str: ...
    @property
    def counts(self) -> InputCounts: ...


class GroupAccount(Protocol):
    """A group, its inputs in the file's order, and how many sets left."""

    @property
    def name(self) -> str: ...
    @property
    def inputs(self) -> Sequence[InputAccount]: ...
    @property
    def sets(self) -> int: ...


def summarize(group: GroupAccount) -> Iterator[str]:
    """A line for the group, and one for each input."""
    yield f"{group.name}: {group.sets} {'set' if group.sets == 1 else 'sets'}"
    for each in group.inputs:
        yield f"{group.name}:   {each.topic}: {_fates(each.counts)}"


def _fates(counts: InputCounts) -> str:
    text = f"{counts.fed} received, {counts.matched} in sets, {sum(counts.dropped.values())} dropped"
    if counts.dropped:
        reasons = sorted(counts.dropped.items(), key=lambda item: -item[1])
        text += f" ({', '.join(f'{reason.value} {count}' for reason, count in reasons)})"
    if counts.needed_queue is not None:
        text += "; some left the full queue before their partners came"
    return text
