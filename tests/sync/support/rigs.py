"""Hypothesis strategies for what may happen to a group: any policy, any options, any disorder.

The policies are made from their models, as those of a file are: one that is added there is tested here.
"""

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace

from hypothesis import strategies as st

from syncrelay import sync
from syncrelay.config.installed import policy_name, topic_model
from syncrelay.config.models import Inputs
from syncrelay.config.policies import GROUP_MODELS
from syncrelay.config.sections import NodeConfig
from syncrelay.config.units import parse_duration
from syncrelay.sync import DropReason, LatestAtTicks, Match, Message, Restamp, SyncGroup, Ticks

TICK = 10_000_000
START = 10**12


@dataclass(frozen=True)
class Options:
    """A group, but for its policy's name; times in ticks."""

    required: tuple
    quorum: int | None = None
    queue_size: int = 3
    slop: int = 2
    age_penalty: float = 0.1
    min_periods: tuple = ()
    max_ages: tuple = ()
    tolerances: tuple = ()
    max_wait: int | None = None
    offsets: tuple = ()
    restamp: object = None
    every: int = 1
    min_set_period: int | None = None

    @property
    def n_inputs(self):
        return len(self.required)

    @property
    def max_ages_ns(self):
        """Those that are drawn, else slop for all inputs."""
        return [None if age is None else age * TICK for age in self.max_ages or (self.slop,) * self.n_inputs]


POLICIES = {policy_name(model): model for model in GROUP_MODELS}
"""The models of all policies, by their names."""
# Sets leave as time passes: what is promised of the others as a message comes is not promised of it.
BY_CLOCK = {
    "latest_at_ticks": lambda options: LatestAtTicks(
        n_inputs=options.n_inputs,
        queue_size=options.queue_size,
        ticks=Ticks(10**9, 3 * TICK),
        max_ages_ns=options.max_ages_ns,
    )
}
EXPORTED = {
    each
    for each in vars(sync).values()
    if isinstance(each, type) and hasattr(each, "by_stamp") and each is not sync.Policy
}
"""The engines of all policies that the library has."""
# Sets can be made round a message of any input.
OF_ANY = ["exact_time", "approximate_time", *BY_CLOCK]
ONCE = [name for name, model in POLICIES.items() if not model.repeats]


def make_policy(name, options):
    if name in BY_CLOCK:
        return BY_CLOCK[name](options)
    model = POLICIES[name]
    of_group = {"age_penalty": options.age_penalty, "queue_size": options.queue_size}
    keys = {key: value for key, value in of_group.items() if key in model.model_fields}
    needed = {key for key, field in model.model_fields.items() if field.is_required()} - {"policy", "topics"}
    keys |= {key: _needed(key, model, options) for key in needed}
    group = model.model_validate({"policy": name, "topics": tuple(_topics(model, options)), **keys})
    return group.build_policy(Inputs.of(group.topics, NodeConfig()))


def _needed(key, model, options):
    """A value for a key without a default: the first required input, the drawn slop for a duration, else an example."""
    example = model.model_fields[key].examples[0]
    if key == model.trigger_key:
        return f"/input_{options.required.index(True)}"
    with suppress(ValueError):
        parse_duration(example)
        return f"{options.slop * TICK}ns"
    return example


def _topics(model, options):
    of_topics = {
        "min_period": [each * TICK for each in options.min_periods],
        "max_age": options.max_ages_ns,
        "tolerance": [each if each is None else int(each * TICK) for each in options.tolerances],
    }
    known = topic_model(model).model_fields
    for index in range(options.n_inputs):
        values = {key: each[index] for key, each in of_topics.items() if key in known and each}
        yield {"topic": f"/input_{index}", **{key: f"{value}ns" for key, value in values.items() if value is not None}}


def make_group(name, options):
    return SyncGroup(
        make_policy(name, options),
        required=options.required,
        quorum=options.quorum,
        max_wait_ns=None if options.max_wait is None else options.max_wait * TICK,
        offsets_ns=[offset * TICK for offset in options.offsets] or None,
        restamp=options.restamp,
        every=options.every,
        min_set_period_ns=None if options.min_set_period is None else options.min_set_period * TICK,
    )


@dataclass(frozen=True)
class Step:
    """What happens to a group at `now`: a message if there is one, else `expire`."""

    now: int
    message: Message | None

    def shifted(self, by):
        return replace(self, now=self.now + by)


def few(low, high):
    return st.integers(low, high)


@st.composite
def options(draw, *, optional=True, limited=True, thinned=True, offset=False):
    n_inputs = draw(few(1, 4))
    required = draw(st.tuples(*[st.sampled_from((True, not optional))] * n_inputs).filter(any))
    waits = few(0, 8) if not all(required) else st.none() | few(0, 8) if limited else st.none()
    shifts = st.tuples(*[few(-5, 5)] * n_inputs)
    return Options(
        required=required,
        quorum=draw(st.none() | few(sum(required), n_inputs)),
        queue_size=draw(few(1, 5)),
        slop=draw(few(0, 5)),
        age_penalty=draw(st.sampled_from((0.0, 0.1, 0.7, 2.0))),
        min_periods=draw(st.just(()) | st.tuples(*[few(0, 4)] * n_inputs)),
        max_ages=draw(st.just(()) | st.tuples(*[st.none() | few(0, 5)] * n_inputs)),
        max_wait=draw(waits),
        offsets=draw(shifts if offset else st.just(()) | shifts),
        restamp=draw(st.none() | st.sampled_from((Restamp.EARLIEST, Restamp.LATEST)) | few(0, n_inputs - 1)),
        every=draw(few(1, 3)) if thinned else 1,
        min_set_period=draw(st.none() | few(1, 6)) if thinned else None,
    )


def plain_options():
    """Options of a group that asks for nothing but matching."""
    drawn = options(optional=False, limited=False, thinned=False)
    return drawn.map(lambda each: replace(each, offsets=(), restamp=None))


LAGS = (0, 0, 0, 0, 0, 1, 1, 2, 3, 5, 8, 13, 100, 101, 250)
"""By how much a stamp is behind the newest: jitter between inputs, inversions, jumps of more than a second."""


@st.composite
def steps(draw, n_inputs, *, disorder=True, jumps=True):
    """Messages and expiries as they may come; with `disorder` the clock falls at times, too."""
    lags = st.sampled_from([lag for lag in LAGS if disorder and (jumps or lag < 100)] or [0])
    falls = st.sampled_from((0,) * 20 + (30,)) if disorder else st.just(0)
    kinds = st.tuples(few(-1, n_inputs - 1), few(0, 3), lags, few(0, 3), falls)
    newest, clock, drawn = START // TICK, START // TICK, []
    for number, (index, advance, lag, key, fall) in enumerate(draw(st.lists(kinds, max_size=40))):
        newest += advance
        clock += advance - fall
        stamp = (newest - lag) * TICK if lag != 13 or not disorder else 0
        message = None if index < 0 else Message(index, stamp, number, key=newest // 2 + key)
        drawn.append(Step(now=clock * TICK, message=message))
    return drawn


def take(group, step):
    if step.message is None:
        return group.expire(now=step.now)
    return group.add(step.message, now=step.now)


def run(group, taken):
    return [list(take(group, step)) for step in taken]


def finish(group, taken):
    """What leaves step by step, and at the end by a flush."""
    return [*run(group, taken), list(group.flush(DropReason.SHUTDOWN))]


def members(match):
    return [message for message in match.messages if message is not None]


class Tally:
    """Counts from outside, by each message's own fate."""

    def __init__(self, n_inputs):
        self.fed = [0] * n_inputs
        self.matched: list[set] = [set() for _ in range(n_inputs)]
        self.dropped: list[Counter[DropReason]] = [Counter() for _ in range(n_inputs)]

    def note(self, message, outcomes):
        if message is not None:
            self.fed[message.input] += 1
        for outcome in outcomes:
            if isinstance(outcome, Match):
                for each in members(outcome):
                    self.matched[each.input].add(each.payload)
            else:
                self.dropped[outcome.message.input][outcome.reason] += 1

    def agrees(self, group):
        return [(counts.fed, counts.matched, counts.dropped, counts.buffered) for counts in group.counts()] == [
            (fed, len(matched), dropped, fed - len(matched) - dropped.total())
            for fed, matched, dropped in zip(self.fed, self.matched, self.dropped, strict=True)
        ]
