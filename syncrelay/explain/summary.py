"""The summary that a relay and a replay end with: what became of every message, and what was wrong in between."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import words
from syncrelay.explain.finding_log import FindingLog
from syncrelay.explain.report import GroupReport
from syncrelay.explain.unneeded import DropFates
from syncrelay.logs import LOGGER
from syncrelay.sync.counts import InputCounts

_SOON_NS: Final = 1_000_000_000


def log_summary(reports: Iterable[GroupReport]) -> None:
    """Log what became of every message of groups, and what was wrong with them since the start."""
    for report in reports:
        facts = report.facts
        inputs = [(each.name, each.counts) for each in facts.inputs]
        lines = summarize(facts.name, facts.figures.sets, inputs, facts.fates)
        for line in chain(lines, [] if report.log is None else _spells(facts.name, report.log)):
            LOGGER.info(line, extra={"group": facts.name})


def summarize(
    group: str, sets: int, inputs: Sequence[tuple[str, InputCounts]], fates: Sequence[DropFates]
) -> Iterator[str]:
    """Return a line for a group, and one for each of its inputs, which are named by their topics."""
    yield f"{group}: {counted(sets, 'set')}"
    for (topic, counts), each in zip(inputs, fates, strict=True):
        lacking = [inputs[other][0] for other in each.lacking]
        yield f"{group}:   {topic}: {_fates(counts, each, lacking)}"


def _spells(group: str, log: FindingLog) -> Iterator[str]:
    if log.n_left_out:
        yield f"{group}:   {counted(log.n_left_out, 'earlier finding')} in the log above"
    for each in log.spells:
        lasted = "until the end" if each.lasted is None else f"for {words.seconds(each.lasted)}"
        began = f"{words.seconds(each.after)} after the start" if each.after >= _SOON_NS else "from the start"
        yield f"{group}:   {began}, {lasted}: {each.text}"


def why_unneeded(lacking: Sequence[str]) -> str:
    """Return why messages were not needed: which topics had none for them, or, where none lacked, what served."""
    return f"no message of {' or '.join(lacking)} left to pair with" if lacking else "a newer one served"


def _fates(counts: InputCounts, fates: DropFates, lacking: Sequence[str]) -> str:
    text = f"{counts.fed} received, {counts.matched} in sets"
    if fates.unneeded:
        text += f", {fates.unneeded} not needed ({why_unneeded(lacking)})"
    text += f", {sum(fates.others.values())} dropped"
    if fates.others:
        reasons = sorted(fates.others.items(), key=lambda item: -item[1])
        text += f" ({', '.join(f'{reason.value} {count}' for reason, count in reasons)})"
    if counts.needed_queue is not None:
        text += "; some left the full queue before their partners came"
    return text
