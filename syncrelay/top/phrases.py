"""Figures of a status in words, for the screen and for plain text."""

from collections.abc import Mapping
from typing import Final

from syncrelay.explain import words
from syncrelay.status import Phase
from syncrelay.status.document import Group, Input, Percentiles, Relay

_NS_PER_MS: Final = 1_000_000
_NS_PER_S: Final = 1_000_000_000
_LONG_MS: Final = 100_000_000
_YEAR_MS: Final = 31_557_600_000
# A relay is asked once a second.
_JUST_NOW_MS: Final = 1_500
NONE: Final = "-"


def duration(milliseconds: float | None) -> str:
    """Return a duration with its unit in at most 9 characters, or a dash."""
    if milliseconds is None:
        return NONE
    if abs(milliseconds) < _LONG_MS:
        return words.duration(milliseconds * _NS_PER_MS)
    # The lag of stamps that were never set goes back to 1970.
    return f"{milliseconds / _YEAR_MS:.2g} years"


def ago(milliseconds: float) -> str:
    """Return how long ago something was."""
    if milliseconds < _JUST_NOW_MS:
        return "just now"
    return f"{words.seconds(milliseconds * _NS_PER_MS)} ago"


def seconds(count: float) -> str:
    """Return how long something lasts."""
    return words.seconds(count * _NS_PER_S)


def percentiles(sample: Percentiles) -> str:
    """Return `p50 5 ms, p95 7 ms, max 8 ms`."""
    values = (("p50", sample.p50), ("p95", sample.p95), ("max", sample.max))
    return ", ".join(f"{name} {duration(value)}" for name, value in values)


def rate(hertz: float) -> str:
    """Return a rate with its unit, or a dash for none."""
    return words.rate(hertz) if hertz else NONE


def sets_of_possible(group: Group) -> str:
    """Return `9.9 of 10`: sets a second, and how many there could be."""
    return f"{words.figure(group.rate_hz)} of {words.figure(max(group.possible_hz, group.rate_hz))}"


def share_of_possible(group: Group) -> float:
    """Return how many of the possible sets leave, 0 to 1."""
    return min(1.0, group.rate_hz / group.possible_hz) if group.possible_hz else 0.0


def last_set(group: Group) -> str:
    """Say how many sets there were, and when the last one left."""
    if group.since_last_set_ms is None:
        return "no set yet"
    return f"{group.sets} {'set' if group.sets == 1 else 'sets'}, last {ago(group.since_last_set_ms)}"


def options(group: Group) -> str:
    """Return the policy and the options of a group."""
    tolerance = [f"{group.tolerance.key} {duration(group.tolerance.ms)}"] if group.tolerance else []
    waits = [] if group.max_wait_ms is None else [f"max_wait {duration(group.max_wait_ms)}"]
    bundle = [] if group.bundle is None else [f"bundle {group.bundle}"]
    return ", ".join([group.policy, *tolerance, f"queue_size {group.queue_size}", *waits, *bundle])


def phase(relay: Relay) -> str:
    """Say where a relay is in its life."""
    return f"{relay.phase.value}, {'ready' if relay.ready else 'not ready'}"


def place(relay: Relay, url: str) -> str:
    """Say where a relay answers; `observe` answers nobody, so say which file it tries."""
    return f"with {relay.config}" if relay.phase is Phase.OBSERVING else f"at {url}"


def offsets(group: Group) -> str | None:
    """Say how the file's offsets change the spans; None without offsets or sets."""
    if group.span_without_offsets_ms is None or group.span_ms is None:
        return None
    given = ", ".join(f"{each.offset_ms:+g} ms on {each.topic}" for each in group.inputs if each.offset_ms)
    return f"{given}: span p50 {duration(group.span_ms.p50)}, {duration(group.span_without_offsets_ms)} without it"


def drops(dropped: Mapping[str, int]) -> str:
    """Return `66 too_far, 1 late`, the most frequent first, or `none`."""
    by_count = sorted(dropped.items(), key=lambda item: -item[1])
    return ", ".join(f"{count} {reason}" for reason, count in by_count) or "none"


def drops_lately(an_input: Input) -> str:
    """Return `1 late, 66 not needed`, or `none`."""
    others = an_input.dropped_lately if an_input.other_drops_lately is None else an_input.other_drops_lately
    if not an_input.unneeded_lately:
        return drops(others)
    return f"{f'{drops(others)}, ' if others else ''}{an_input.unneeded_lately} not needed"


def sent(an_input: Input) -> str | None:
    """Say how many messages of an input were published lately and how many were lost; None where that is not known."""
    if not an_input.senders:
        return f"{an_input.lost} lost on the way in the last 10 s" if an_input.lost else None
    parts = [
        f"{each.sent} from {each.node}{f' at {rate(each.sent_hz)}' if each.sent_hz else ''}, {each.lost or 'none'} lost"
        for each in an_input.senders
    ]
    return f"in the last 10 s: {'; '.join(parts)}"


def fates(an_input: Input) -> str:
    """Say what became of all messages of an input."""
    others = an_input.dropped if an_input.other_drops is None else an_input.other_drops
    unneeded = f" {an_input.unneeded} not needed," if an_input.unneeded else ""
    reasons = f" ({drops(others)})" if others else ""
    return (
        f"{an_input.received} received, {an_input.matched} in sets, {an_input.buffered} waiting,{unneeded}"
        f" {sum(others.values())} dropped{reasons}"
    )
