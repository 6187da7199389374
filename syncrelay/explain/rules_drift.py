"""Findings about clocks that drift apart."""

from collections.abc import Mapping
from statistics import median_low
from typing import Final

from syncrelay.config import Distance
from syncrelay.explain import words
from syncrelay.explain.clocks import Drift, apart
from syncrelay.explain.codes import Code
from syncrelay.explain.epochs import OTHER_RATE
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import SECOND, Fault, Found
from syncrelay.explain.other_stamps import offered_stamps

# A drift is reported after this much change, over at least this time, and only if the delays bend far less than that.
_DRIFTED: Final = 5_000_000
_DRIFT_WATCHED: Final = 8 * SECOND
_DRIFT_BENDS: Final = 8
_USUAL: Final = 0.95
# Wait this long for proof of a drift; the second time only, from when sets are missing, unless stamps look like one.
_DRIFT_PROVEN: Final = 60 * SECOND
_DRIFT_PROVEN_SILENT: Final = 15 * SECOND
# Of two inputs, one with less than this share of the other's drift has the better clock.
_EVIDENTLY: Final = 0.2
# A drift explains wide spans if it accounts for this share of the tolerance.
_MATTERS: Final = 0.5


def _drifts(facts: GroupFacts) -> dict[int, Drift]:
    """Return the drifts of the inputs of which they are known, none where they are not known of two."""
    # What no crystal is off by is another rate.
    known = {
        index: each.figures.drift
        for index, each in enumerate(facts.inputs)
        if each.figures.drift and each.figures.reading is None
    }
    return known if facts.by_stamp and len(known) > 1 else {}


def _between(known: Mapping[int, Drift]) -> dict[int, Drift]:
    """Return how inputs drift away from the others' median."""
    return {
        index: apart(drift, median_low([known[other] for other in known if other != index]))
        for index, drift in known.items()
    }


def may_drift(facts: GroupFacts) -> bool:
    """Whether a drift that is neither proven nor refuted yet may be why stamps are so far apart.

    For a while only: what takes longer to prove is not why they were apart so soon.
    """
    watched, tolerance = facts.figures.now - facts.figures.began, facts.tolerance
    # How old the latest message is, its period says.
    if tolerance is None or facts.distance is Distance.AGE or facts.is_recorded or not 0 < watched < _DRIFT_PROVEN:
        return False
    nearest = facts.figures.nearest_since if facts.is_silent else facts.figures.nearest
    if not nearest.share_over(tolerance.ns) or any(each.figures.resolution > tolerance.ns for each in facts.inputs):
        return False
    needed = max(_MATTERS * tolerance.ns, nearest.quantile(_USUAL) - tolerance.ns) / watched
    # A drift moves them all the time.
    measured_at = facts.figures.nearest_at[-len(nearest) :]
    moves = needed * (facts.figures.now - measured_at[0]) if measured_at else 0
    if nearest.quantile(_USUAL) - nearest.quantile(1 - _USUAL) < _MATTERS * moves:
        return False
    is_urgent = (_missing_for(facts, tolerance.ns) if facts.is_silent else watched) >= _DRIFT_PROVEN_SILENT
    if facts.by_stamp and not is_urgent and any(each.required and each.figures.drift is None for each in facts.inputs):
        return True
    return any(
        abs(each.slope) >= max(needed, each.error) or (not is_urgent and abs(each.slope) + each.error >= needed)
        for each in _between(_drifts(facts)).values()
    )


def _missing_for(facts: GroupFacts, limit: int) -> int:
    """Return for how long sets have been missing: by chance a few left meanwhile, while most were too wide."""
    figures = facts.figures
    are_wide = figures.nearest_at and 2 * figures.nearest.share_over(limit) > 1
    return max(facts.silent_for, figures.now - figures.nearest_at[0] if are_wide else 0)


def clock_drift(facts: GroupFacts) -> Found:
    """Find the input whose stamps drift away from the others' median; of two that may be either, both."""
    known = _drifts(facts)
    if not known:
        return
    between = _between(known)
    most = max(abs(each.slope) for each in between.values())
    # Of those that are as far from the others, the one whose stamps run least like this machine's clock.
    odd = max(
        (index for index, each in between.items() if abs(each.slope) >= (1 - _EVIDENTLY) * most),
        key=lambda index: abs(known[index].slope),
    )
    found = between[odd]
    drifted = abs(found.drifted_ns)
    if found.watched_ns < _DRIFT_WATCHED or drifted < max(_DRIFTED, _DRIFT_BENDS * found.bend_ns):
        return
    if not found.doubt <= abs(found.slope) <= OTHER_RATE:
        return
    others = [index for index in known if index != odd]
    is_evident = len(others) > 1 or abs(known[others[0]].slope) < _EVIDENTLY * abs(known[odd].slope)
    a_second = f"{words.duration(abs(found.slope) * SECOND)} a second"
    ppm = words.figure(abs(found.slope) * 1e6)
    name = facts.inputs[odd].name
    against = facts.inputs[others[0]].name if len(others) == 1 else "the other inputs"
    text = (
        f"stamps of {name} {'lose' if found.slope > 0 else 'gain'} {a_second} against those of {against} ({ppm} ppm)"
        if is_evident
        else f"stamps of {name} and {against} drift apart by {a_second} ({ppm} ppm)"
    )
    gone = abs(found.slope) * (facts.figures.now - facts.figures.began)
    yield Fault(
        text,
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time"
        + offered_stamps(facts, Code.CLOCK_DRIFT, odd),
        input=odd if is_evident else None,
        # A clock that is off by a few ppm is not why stamps lie far apart today.
        explains=facts.tolerance is not None and gone >= _MATTERS * facts.tolerance.ns,
    )
