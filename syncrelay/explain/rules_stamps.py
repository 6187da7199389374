"""Findings about stamps: unset, of another clock, too far apart, falling, drifting."""

from statistics import median_low
from typing import Final

from syncrelay.config import Tolerance
from syncrelay.explain import words
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.drift import apart
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Code, Finding, Found, Severity, blocks, counted, nodes
from syncrelay.sync.messages import DropReason

# Stamps that are off by more come from another clock, or are older than a queue should hold.
_OTHER_CLOCK: Final = SECOND
_TOLD_JUMP: Final = 30 * SECOND
# A share of the slowest input's messages that could have no set, and from how many on it means something.
_MISSED: Final = 0.05
_FEWEST: Final = 5
# Where messages were held up, what is apart tells of slop only if it is most.
_MOST: Final = 0.5
# Below this drift is noise: so much apart since it was watched, so long watched, so much more than it bends.
_DRIFTED: Final = 5_000_000
_DRIFT_WATCHED: Final = 20 * SECOND
_DRIFT_BENDS: Final = 8
# A message in a hundred whose stamp repeats or comes late is no reason to call anyone.
_FAULTY: Final = 0.01
# What a computation may take; stamps that are older are those of another clock.
_LATENCY: Final = 10 * SECOND


def malformed(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages whose stamp or key could not be read."""
    if count := an_input.figures.dropped.get(DropReason.MALFORMED, 0):
        yield Finding(
            Code.MALFORMED,
            _blocks_if_most(facts, an_input, count),
            f"{counted(count, an_input.figures.fed)} messages of {an_input.name} are cut short, or not of its type",
            f"see that {nodes(an_input)} has the same version of {an_input.type} as is installed here",
            index,
        )


def unstamped(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages whose stamp was never set."""
    if count := an_input.figures.dropped.get(DropReason.UNSTAMPED, 0):
        yield Finding(
            Code.UNSTAMPED,
            _blocks_if_most(facts, an_input, count),
            f"{counted(count, an_input.figures.fed)} messages of {an_input.name} have stamp 0",
            f"have {nodes(an_input)} set header.stamp, or write `stamp: receive` at {an_input.name}",
            index,
        )


def _blocks_if_most(facts: GroupFacts, an_input: InputFacts, count: int) -> Severity:
    """Return how bad it is that so many messages are of no use: a few don't explain a silence."""
    return blocks(facts, an_input) if 2 * count >= an_input.figures.fed else Severity.WARN


def other_clock(facts: GroupFacts) -> Found:
    """Find an input whose stamps, against the time of their receipt, are far off those of the others."""
    if not facts.by_stamp or not facts.is_silent:
        return
    delays = {
        index: each.figures.delay for index, each in enumerate(facts.inputs) if each.required and each.figures.rate_hz
    }
    known = {index: delay - facts.inputs[index].offset for index, delay in delays.items() if delay is not None}
    if len(known) < 2:  # noqa: PLR2004  one alone has no other clock
        return
    # Of two, the one that is farther from this machine's time is odd.
    usual = median_low(known.values()) if len(known) > 2 else min(known.values(), key=abs)  # noqa: PLR2004
    odd = max(known, key=lambda index: abs(known[index] - usual))
    behind = known[odd] - usual
    if abs(behind) <= max(_OTHER_CLOCK, facts.tolerance.ns if facts.tolerance else 0):
        return
    name, offset = facts.inputs[odd].name, facts.inputs[odd].offset
    others = [facts.inputs[index].name for index in known if index != odd]
    side = "behind" if behind > 0 else "ahead of"
    shifted = f", with its offset of {words.exactly(offset)}," if offset else ""
    needed = max((each.counts.needed_queue or 0 for each in facts.inputs), default=0)
    may_be_late = needed > facts.queue_size and 0 < behind < _LATENCY
    wait = f"; if {name} really takes that long to come, write `queue_size: {needed}`" if may_be_late else ""
    yield Finding(
        Code.OTHER_CLOCK,
        Severity.ERROR,
        f"stamps of {name}{shifted} are {words.duration(abs(behind))} {side} those of"
        f" {others[0] if len(others) == 1 else 'the other inputs'}",
        f"synchronize the clocks of their machines, or write `offset: {words.exactly(behind + offset)}` at"
        f" {name}{wait}",
        odd,
    )


def no_common_key(facts: GroupFacts) -> Found:
    """Find that inputs that are matched by key have none in common."""
    if facts.by_stamp or not facts.is_silent or any(each.key is None for each in facts.inputs):
        return
    newest = ", ".join(f"{each.key!r} of {each.name}" for each in facts.inputs)
    yield Finding(
        Code.NO_COMMON_KEY,
        Severity.ERROR,
        f"no key came on all inputs while it was buffered; the newest are {newest}",
        "correct `key`, or write a larger `queue_size` if one input's keys come much later",
    )


def over_slop(facts: GroupFacts) -> Found:
    """Find that the sets that could be had are too wide for the file."""
    tolerance = facts.tolerance
    nearest = facts.figures.nearest_since if facts.is_silent else facts.figures.nearest
    if tolerance is None or len(nearest) < _FEWEST or next(other_clock(facts), None):
        return
    over = nearest.share_over(tolerance.ns)
    if facts.is_silent and over > 1 - _MISSED:
        text, suggestion = _too_wide(tolerance, nearest), _wide_enough(tolerance, nearest)
        yield Finding(Code.OVER_SLOP, Severity.ERROR, text, suggestion)
    elif not facts.is_silent and over > (_MOST if _come_at_once(facts) else _MISSED):
        text, suggestion = _often_too_wide(facts, tolerance, nearest)
        yield Finding(Code.OVER_SLOP, Severity.WARN, text, suggestion)


def _come_at_once(facts: GroupFacts) -> bool:
    """Whether what is measured as far apart may only have been held up: a wider slop would pair what came together."""
    return any(each.required and each.figures.bursts for each in facts.inputs)


def _often_too_wide(facts: GroupFacts, tolerance: Tolerance, nearest: Distribution) -> tuple[str, str]:
    missed = f"{words.share(nearest.share_over(tolerance.ns))} of the last {len(nearest)} messages of"
    name = facts.pacemaker.name
    if tolerance.wider_policy:
        # Others do have equal stamps: a wider slop would pair what does not belong together.
        lost = "look for messages that a driver leaves out or the network loses"
        return f"{missed} {name} have no partner of an equal stamp", lost
    farther = f"{missed} {name} were farther from their partners than {tolerance.key} {words.duration(tolerance.ns)}"
    return farther, _wide_enough(tolerance, nearest)


def _too_wide(tolerance: Tolerance, nearest: Distribution) -> str:
    least, most = words.duration(nearest.quantile(0)), words.duration(nearest.quantile(0.95))
    widths = least if least == most else f"{least} to {most}"
    if tolerance.wider_policy:
        return f"no stamps are equal: the nearest sets span {widths}"
    if tolerance.key == "max_age":
        return f"the latest messages are {widths} older than the trigger's, over max_age {words.duration(tolerance.ns)}"
    return f"the nearest sets span {widths}, over {tolerance.key} {words.duration(tolerance.ns)}"


def _wide_enough(tolerance: Tolerance, nearest: Distribution) -> str:
    most, nearly_all = words.at_least(nearest.quantile(0.95)), words.at_least(nearest.quantile(0.99))
    policy = f"`policy: {tolerance.wider_policy}` and " if tolerance.wider_policy else ""
    less = "" if most == nearly_all else f", `{tolerance.key}: {most}` would match 95 %"
    return f"write {policy}`{tolerance.key}: {nearly_all}`, which would match 99 %{less}"


def time_jump(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find, without blame, that stamps fell back."""
    now, figures = facts.figures.now, an_input.figures
    if figures.fell_at is not None and figures.fell_by is not None and now - figures.fell_at < _TOLD_JUMP:
        ago = words.seconds(max(0, now - figures.fell_at))
        text = f"stamps of {an_input.name} fell by {words.duration(figures.fell_by)} {ago} ago: the group began anew"
        yield Finding(
            Code.TIME_JUMP, Severity.OK, text, "a recording that is looped does this, or a reset clock", index
        )


def out_of_order(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that came after one of a later stamp."""
    count = an_input.figures.out_of_order
    if facts.by_stamp and count > _FAULTY * an_input.figures.fed:
        text = (
            f"{counted(count, an_input.figures.fed)} messages of {an_input.name} came out of the order of their stamps"
        )
        yield Finding(Code.OUT_OF_ORDER, Severity.WARN, text, _who_disorders(an_input), index)


def duplicates(facts: GroupFacts, index: int, an_input: InputFacts) -> Found:
    """Find messages that repeat a stamp; what is held until there is a newer one may be sent again and again."""
    count = an_input.figures.duplicates
    if facts.by_stamp and not facts.is_held(index) and count > _FAULTY * an_input.figures.fed:
        text = f"{counted(count, an_input.figures.fed)} messages of {an_input.name} repeat the stamp before them"
        yield Finding(Code.DUPLICATES, Severity.WARN, text, _who_disorders(an_input), index)


def _who_disorders(an_input: InputFacts) -> str:
    if len(an_input.graph.publishers) > 1:
        return f"{len(an_input.graph.publishers)} publish it, {nodes(an_input)}: give each a topic of its own"
    return f"see how {nodes(an_input)} stamps its messages"


def clock_drift(facts: GroupFacts) -> Found:
    """Find two inputs whose stamps run at different speeds."""
    known = [(each.figures.drift, index) for index, each in enumerate(facts.inputs) if each.figures.drift]
    if not facts.by_stamp or len(known) < 2:  # noqa: PLR2004  one alone cannot drift apart
        return
    (slow, slowest), (fast, fastest) = max(known), min(known)
    between = apart(slow, fast)
    if between.watched_ns >= _DRIFT_WATCHED and between.drifted_ns >= max(_DRIFTED, _DRIFT_BENDS * between.bend_ns):
        name, other = facts.inputs[slowest].name, facts.inputs[fastest].name
        yield Finding(
            Code.CLOCK_DRIFT,
            Severity.WARN,
            f"stamps of {name} lose {words.duration(between.slope * SECOND)} a second against those of {other}"
            f" ({words.figure(between.slope * 1e6)} ppm)",
            "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
            slowest,
        )
