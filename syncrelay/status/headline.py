"""One sentence on all groups: what somebody who comes to the robot has to know first."""

from collections import Counter
from collections.abc import Sequence

from syncrelay.config.wording import all_of, counted
from syncrelay.explain import Code, listed
from syncrelay.status.document import Group
from syncrelay.status.state import Level, Phase

_FAILS = (Level.ERROR, Level.STALE)


def headline(phase: Phase, groups: Sequence[Group]) -> str:
    """Return a sentence such as `11 of 40 groups fail: no sets from front, left, rear and 8 more`."""
    if not groups:
        return "no group is running yet"
    ordered = sorted(groups, key=lambda group: group.name)
    failing = [group for group in ordered if group.level in _FAILS]
    warned = [group.name for group in ordered if group.level is Level.WARN]
    if phase in (Phase.PAUSED, Phase.INACTIVE):
        return f"{phase.value}: no sets from {_all_or(groups, len(groups))}"
    if failing:
        none = [group.name for group in failing if not group.rate_hz]
        few = [group.name for group in failing if group.rate_hz]
        parts = [f"{how} from {listed(names)}" for how, names in (("no sets", none), ("too few sets", few)) if names]
        fail = "fails" if len(failing) == 1 else "fail"
        rest = f"; {counted(len(warned), 'other')} with a warning" if warned else ""
        return f"{_all_or(groups, len(failing))} {fail}: {', '.join(parts)}{rest}"
    if warned:
        return f"{_all_or(groups, len(warned))} {'has' if len(warned) == 1 else 'have'} a warning: {listed(warned)}"
    others = Counter(_label(group) for group in groups if not group.rate_hz)
    giving = len(groups) - others.total()
    parts = [f"{count} {label}" for label, count in others.most_common()]
    if not giving:
        return f"{counted(len(groups), 'group')}: {all_of(parts)}"
    give = "gives" if giving == 1 else "give"
    return "; ".join([f"{_all_or(groups, giving)} {give} sets", *parts])


def _all_or(groups: Sequence[Group], count: int) -> str:
    """Return `11 of 40 groups`, or all of them in fewer words."""
    if len(groups) == 1:
        return "the only group"
    return f"all {count} groups" if count == len(groups) else f"{count} of {len(groups)} groups"


def _label(group: Group) -> str:
    """Say what a group does that is well and gives no sets."""
    said = group.explanation
    return "starting" if said is not None and said.code == Code.STARTING.value else "waiting"
