"""What became of every message: the last thing that a relay and a replay say."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from syncrelay.config.wording import counted
from syncrelay.logs import LOGGER
from syncrelay.sync.counts import InputCounts

if TYPE_CHECKING:
    from syncrelay.explain import GroupReport


def log_summary(reports: "Iterable[GroupReport]") -> None:
    """Log what became of every message of groups."""
    for report in reports:
        facts = report.facts
        for line in summarize(facts.name, facts.figures.sets, [(each.name, each.counts) for each in facts.inputs]):
            LOGGER.info(line, extra={"group": facts.name})


def summarize(group: str, sets: int, inputs: Iterable[tuple[str, InputCounts]]) -> Iterator[str]:
    """Return a line for a group, and one for each of its inputs, which are named by their topics."""
    yield f"{group}: {counted(sets, 'set')}"
    for topic, counts in inputs:
        yield f"{group}:   {topic}: {_fates(counts)}"


def _fates(counts: InputCounts) -> str:
    text = f"{counts.fed} received, {counts.matched} in sets, {sum(counts.dropped.values())} dropped"
    if counts.dropped:
        reasons = sorted(counts.dropped.items(), key=lambda item: -item[1])
        text += f" ({', '.join(f'{reason.value} {count}' for reason, count in reasons)})"
    if counts.needed_queue is not None:
        text += "; some left the full queue before their partners came"
    return text
