"""What `observe --seconds N` and `doctor --live --seconds N` come to of a draw, in virtual time.

Both run the relay's judge for a while and go by its last report: here that report is made in virtual time, and the
verdicts are those of the commands.
"""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count

from syncrelay.doctor.diagnosis import worst_first
from syncrelay.doctor.graph import check_groups
from syncrelay.explain import GroupFacts, GroupReport, explanation
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.findings import Finding
from syncrelay.relay.look import is_early
from syncrelay.top.observed import unhealthy
from tests.bank.play import Drawn, Score, fit, is_of_rig, publishers_of, sets_of
from tests.explain.scenario import run

# Of few sets, one that is on its way at the end decides nothing.
_ON_ITS_WAY = 1


@dataclass(frozen=True, slots=True)
class Looked:
    """How a look ended: what was said first, which sets left of those that would have, and what each command says."""

    second: float
    report: GroupReport
    left: int
    possible: int
    is_ok: bool
    """Whether `observe` ends with exit code 0."""
    diagnosed: tuple[str, ...]
    """The codes of what `doctor` finds, the worst first."""

    @property
    def is_short(self) -> bool:
        """Whether fewer than 0.8 of the possible sets left."""
        return self.left + _ON_ITS_WAY < 0.8 * self.possible

    @property
    def said(self) -> Finding:
        """What explains most."""
        return explanation(self.report.findings)


class _OverError(Exception):
    pass


def look(draw: Drawn, seconds: float) -> Looked:
    """Look at a draw for so many seconds, and a little longer where the commands do."""
    last: list[tuple[float, GroupReport]] = []

    def hears(second: float, facts: GroupFacts, found: tuple[Finding, ...], _remarks: list[Remark]) -> None:
        last[:] = [(second, GroupReport(facts, found))]
        if second >= seconds and not is_early(last[0][1]):
            raise _OverError

    with contextlib.suppress(_OverError):
        run(
            *draw.sources,
            seconds=round(seconds) + 10,
            options=draw.rig.options,
            stops=draw.rig.stops,
            publishers=publishers_of(draw.rig.flows),
            facts=lambda _: {"is_look": True},
            looks=list(_looks(seconds)),
            hears=hears,
        )
    ((second, report),) = last
    well = replace(draw, rig=draw.well)
    return Looked(
        second,
        report,
        report.facts.figures.sets,
        len(list(sets_of(well, well.config, until=second))),
        not unhealthy([report], seconds),
        tuple(each.code for each in worst_first([*check_groups([report], ())])),
    )


def _looks(seconds: float) -> Iterator[float]:
    """Yield when the relay evaluates: once a second, at the end, and up to 10 s after it."""
    yield from (1.02 * n for n in range(1, int(seconds / 1.02) + 1))
    yield from (at for at, _ in zip(count(seconds), range(11), strict=False))


def names_the_cause(draw: Drawn, looked: Looked) -> bool | None:
    """Whether what is said first names a fault that was drawn; None where none could be seen by then."""
    if is_of_rig(draw, looked.said, looked.second):
        return None
    scores = [fit(draw, each, looked.second, looked.said)[0] for each in draw.truths if each.seen <= looked.second]
    return bool({Score.TOLD, Score.LATE}.intersection(scores)) if scores else None
