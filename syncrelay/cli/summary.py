"""What became of every message, in words: the last thing a relay and the demo say."""

from collections.abc import Iterator

from syncrelay.ros.snapshot import GroupSnapshot, InputSnapshot

_LONGEST_ADVISED = 1000


def summarize(group: GroupSnapshot) -> Iterator[str]:
    """A line for the group, and one for each input."""
    yield f"{group.name}: {group.sets} {'set' if group.sets == 1 else 'sets'}"
    for each in group.inputs:
        yield f"{group.name}:   {each.topic}: {_fates(each)}"


def _fates(each: InputSnapshot) -> str:
    counts = each.counts
    text = f"{counts.fed} received, {counts.matched} in sets, {sum(counts.dropped.values())} dropped"
    if counts.dropped:
        reasons = sorted(counts.dropped.items(), key=lambda item: -item[1])
        text += f" ({', '.join(f'{reason.value} {count}' for reason, count in reasons)})"
    # Beyond it, the stamps are of another clock, and no queue is the answer.
    if counts.needed_queue is not None and counts.needed_queue <= _LONGEST_ADVISED:
        text += f"; a match needed what had overflowed: queue_size {counts.needed_queue} would have held it"
    return text
