"""The finding about transforms: which edge is missing, by how much it lags, and with what wait sets would leave."""

from collections.abc import Sequence
from math import ceil
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import words
from syncrelay.explain.codes import Severity
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found, nodes
from syncrelay.sync import DropReason, Lack, Lapse, Missing

# tf2 keeps transforms for 10 s: no `wait` may be longer.
_LONGEST_WAIT: Final = 10_000_000_000
_CHECK_BROADCASTER: Final = "check the node that publishes it on /tf"


def no_transform(facts: GroupFacts) -> Found:
    """Find sets that were dropped because they could not be transformed."""
    dropped = max(each.figures.dropped.get(DropReason.NO_TRANSFORM, 0) for each in facts.inputs)
    if not dropped or not facts.lapses or facts.transforms is None:
        return
    lapses = [each for each in _still_lacking(facts.lapses) if each.needed_ns is None][-dropped:]
    if not facts.has_stopped:
        # The first messages may be older than the first transforms: that is over once sets leave.
        lapses = [each for each in lapses if each.missing.lack is not Lack.PAST]
    if not lapses:
        return
    covered = [each for each in facts.lapses if each.needed_ns is not None][-dropped:]
    # What the last of them lacked: what those before lacked may have come.
    last = lapses[-1]
    an_input = facts.inputs[last.input]
    text, cure = _told(last.missing, an_input, covered, facts)
    for topic, publisher in facts.unheard:
        if (why := publisher.mismatch) is not None and last.missing.lack is not Lack.NO_FRAME:
            node = publisher.node
            text = f"{text}, and {node} offers {topic} with {why.policy} {why.offered}, tf2 requests {why.requested}"
            cure = f"have {node} offer {why.requested}"
    sets = f"{counted(dropped, 'set')} {'was' if dropped == 1 else 'were'}"
    yield Fault(
        f"{text}: {sets} dropped as no_transform in the last 10 s",
        cure,
        Severity.ERROR if facts.is_silent else Severity.WARN,
        input=last.input,
    )


def _still_lacking(lapses: Sequence[Lapse]) -> list[Lapse]:
    """Leave out what an input lacked before its chain was there: once it is, only its stamps can be early or late."""
    there, still = set(), []
    for each in reversed(lapses):
        if each.needed_ns is not None or each.missing.lack in (Lack.LATE, Lack.PAST):
            there.add(each.input)
            still.append(each)
        elif each.input not in there:
            still.append(each)
    return still[::-1]


def _told(missing: Missing, an_input: InputFacts, covered: Sequence[Lapse], facts: GroupFacts) -> tuple[str, str]:
    """Say what an input lacks, and what to do."""
    name = an_input.name
    match missing.lack:
        case Lack.LATE:
            return _late(missing, name, covered, facts)
        case Lack.PAST:
            text = f"the oldest transform {_edge(missing)} is {words.span_of_time(missing.by_ns)} newer than {name}"
            cure = "check whether the clocks of both agree; tf2 keeps transforms for 10 s"
        case Lack.UNKNOWN_FRAME if missing.child == missing.parent:
            text = f"no transform names the target {missing.child}"
            cure = "check `target`, and what publishes /tf and /tf_static"
        case Lack.UNKNOWN_FRAME:
            text = f"no transform names {missing.child}, the frame_id of {name}"
            cure = "check what should publish it on /tf or /tf_static, and how it is spelled there"
        case Lack.UNCONNECTED:
            text = f"{missing.child}, the frame_id of {name}, and {missing.parent} are in two unconnected trees"
            cure = "publish the transform that joins them on /tf or /tf_static"
        case Lack.LOOP:
            text = f"the tree of transforms has a loop at {missing.child}"
            cure = "check which nodes publish a transform of it with another parent"
        case Lack.NO_FRAME if missing.child:
            text = f"messages of {name} have the frame_id {missing.child}, and tf2 looks up none that begins with `/`"
            cure = f"have {nodes(an_input)} leave out the `/`"
        case Lack.NO_FRAME:
            text, cure = f"messages of {name} have an empty frame_id", f"have {nodes(an_input)} fill it in"
    return text, cure


def _edge(missing: Missing) -> str:
    return f"{missing.parent} -> {missing.child}"


def _late(missing: Missing, name: str, covered: Sequence[Lapse], facts: GroupFacts) -> tuple[str, str]:
    edge, wait = _edge(missing), facts.transforms.wait if facts.transforms is not None else 0
    needed = _needed(covered)
    enough = enough_wait(covered)
    if not covered and not missing.by_ns:
        return f"nothing is known of {edge} yet", _CHECK_BROADCASTER
    if not covered:
        return f"{edge} is {words.span_of_time(missing.by_ns)} behind {name}", _CHECK_BROADCASTER
    if enough is None:
        return f"{edge} was up to {words.duration(needed)} behind {name}", _CHECK_BROADCASTER
    text = f"{edge} is {words.duration(needed)} behind {name}"
    if needed <= wait:
        # As many wait at once as are matched in that time.
        size = max(facts.queue_size, ceil(needed / SECOND * facts.possible_hz)) + 1
        return f"{text}, and no more than {counted(facts.queue_size, 'set')} can wait", f"write `queue_size: {size}`"
    return text, f"write `wait: {enough}`"


def enough_wait(lapses: Sequence[Lapse]) -> str | None:
    """Return the wait that sets which were given up would have needed, and a tenth more; None if none is for that."""
    needed = _needed(lapses)
    times = [each.covered for each in lapses if each.covered is not None]
    # What came back after a break had all that waited leave at once, or nearly: no wait is for that.
    if not times or max(times) - min(times) < needed or needed > _LONGEST_WAIT:
        return None
    return words.at_least(min(needed + needed // 10, _LONGEST_WAIT))


def _needed(lapses: Sequence[Lapse]) -> int:
    return max((each.needed_ns for each in lapses if each.needed_ns is not None), default=0)
