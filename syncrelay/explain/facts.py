"""What is known of a group at one moment: the file's values, what was observed, what the graph shows."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypedDict

from syncrelay.clock import Step
from syncrelay.config import Distance, Tolerance, TransformsConfig
from syncrelay.explain.figures import GroupFigures, InputFigures
from syncrelay.explain.graph_facts import BundleGraph, Endpoint, GraphSnapshot, InputGraph
from syncrelay.explain.standing import Standing
from syncrelay.explain.suggester import Suggester
from syncrelay.explain.unneeded import DropFates, drop_fates, may_set_pace
from syncrelay.sync import Lapse
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

_SECOND: Final = 1_000_000_000
_NO_SETS: Final = 5 * _SECOND
NO_SECOND: Final = 10 * _SECOND
"""For how long a second message may be awaited: slow sensors send every 5 s."""
# No set for this long, and for so many that should have come, may have a cause that is known already.
_STOPPED: Final = _SECOND
_STOPPED_SETS: Final = 5
_OF_NO_USE: Final = frozenset({DropReason.MALFORMED, DropReason.UNSTAMPED})
# What is found within this time of a group's beginning was there before.
_FOUND_AT_ONCE: Final = 2 * _SECOND


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class InputFacts:
    """An input and its output.

    `type` is the file's, or else the graph's; None until it is known. `key` is the newest message's. `offset` is added
    to stamps for matching, in nanoseconds. `served_since` is since when without a break the graph has shown a publisher
    whose messages can be received, None while it shows none. `own_tolerance` is what the file gives this input in
    place of the group's tolerance, and `narrowed` what it gives it beside.
    It is `required` if no set leaves without it. Where it is `in_quorum`, that goes by how many others come.
    """

    graph: InputGraph
    type: str | None
    required: bool
    counts: InputCounts
    figures: InputFigures
    key: Hashable = None
    offset: int = 0
    served_since: int | None = None
    own_tolerance: Tolerance | None = None
    narrowed: Tolerance | None = None
    in_quorum: bool = False

    @property
    def name(self) -> str:
        """Its topic's name in the graph."""
        return self.graph.name

    @property
    def output(self) -> str:
        """The topic on which its messages leave."""
        return self.graph.output

    def is_served(self) -> bool:
        """Whether it has publishers that all fit, and nothing keeps the relay from using it."""
        graph = self.graph
        return (
            bool(graph.publishers)
            and graph.refusal is None
            and not graph.not_importable
            and not graph.not_readable
            and all(each.type == self.type and each.mismatch is None for each in graph.publishers)
        )

    def comes_in_order(self) -> bool:
        """Whether its messages come whole, on time and in order, at its usual pace, as far as is known."""
        figures = self.figures
        return not (
            figures.duplicates
            or figures.out_of_order
            or figures.bursts
            or figures.swings
            or figures.slowed_from_hz is not None
            or figures.fell_at is not None
            or self.graph.lost
            or any(each.lost for each in self.graph.senders)
            or not figures.dropped.keys().isdisjoint(_OF_NO_USE)
        )

    def is_ours_alone(self) -> bool:
        """Whether nobody else publishes its output, and all that subscribe to it get it."""
        return not self.graph.rivals and all(each.mismatch is None for each in self.graph.subscribers)


class Standstill(NamedTuple):
    """The process got no turn for so many nanoseconds, until a time or for at most `rested` before that."""

    until: int
    ns: int
    rested: int = 0

    @property
    def earliest(self) -> int:
        """The earliest time at which it can have begun."""
        return self.until - self.ns - self.rested

    def overlap(self, begin: int, end: int) -> int:
        """Return for how long of it something else can have been, that began and ended then; negative if never."""
        return min(self.ns, min(end, self.until) - max(begin, self.earliest))


class Pause(NamedTuple):
    """Since when nothing leaves, because somebody asked for that; `ended_by` is the service that ends it."""

    since: int
    ended_by: str


class ClockState(NamedTuple):
    """The clock of a node with use_sim_time: whether /clock was ever received, and for how long it has stood still.

    `stopped` is in nanoseconds, None while the clock moves.
    """

    received: bool
    stopped: int | None = None


class Around(TypedDict, total=False):
    """The facts that no observation of a group's own messages gives; `GroupFacts` says what each is."""

    clock: ClockState | None
    clock_set: Step | None
    is_recorded: bool
    waited: int
    standstills: Sequence[Standstill]
    failure: str | None
    pause: Pause | None
    asleep: bool
    empty_graph: GraphSnapshot | None
    is_discovering: bool
    is_look: bool
    inactive: str | None
    lapses: Sequence[Lapse]
    unheard: Sequence[tuple[str, Endpoint]]
    bundle: BundleGraph | None


@dataclass(slots=True)  # frozen, it would cost three times as much to make, at each look
class GroupFacts:
    """A group at one moment; times and durations in nanoseconds. `GroupWatch.facts` fills it in."""

    name: str
    """The group's name in the file."""
    policy: str
    """The name of its policy."""
    queue_size: int
    """How many messages the file keeps per input."""
    inputs: tuple[InputFacts, ...]
    """Its inputs, in the order of the file."""
    figures: GroupFigures
    """What was observed of it."""
    tolerance: Tolerance | None = None
    """How far apart the stamps of a set may be. None: any distance, as where keys are matched."""
    distance: Distance = Distance.SPAN
    """How it is measured how far apart they are."""
    by_stamp: bool = True
    """Whether messages are matched by their stamps."""
    repeats: bool = False
    """Whether a message may be in more than one set."""
    trigger: int | None = None
    """The index of the input whose every message makes a set."""
    ticks_hz: float | None = None
    """The rate of the clock that makes the sets, where one does."""
    max_wait: int | None = None
    """How long a set may wait."""
    every: int = 1
    """Of so many sets, one leaves."""
    least_period: int | None = None
    """The least time between two sets."""
    clock: ClockState | None = None
    """The simulated clock. None without use_sim_time."""
    clock_set: Step | None = None
    """When this machine's clock was recently set, and by how much."""
    is_recorded: bool = False
    """Whether a recording is judged, and no live graph."""
    waited: int = 0
    """The longest recent wait of its messages in the receive queue."""
    standstills: Sequence[Standstill] = ()
    """When the process recently got no turn."""
    failure: str | None = None
    """What stopped the group for good."""
    pause: Pause | None = None
    """Since when it is paused."""
    unpaused: int | None = None
    """When the last pause ended."""
    asleep: bool = False
    """Whether it is lazy, and nobody subscribes to its outputs."""
    suggester: Suggester | None = field(default=None, compare=False, repr=False)
    """Tries other values of the file on the last messages. None where they cannot be run again."""
    empty_graph: GraphSnapshot | None = None
    """The graph, where it holds no node but our own."""
    is_discovering: bool = False
    """Whether running nodes may be missing from the graph, because this one has just joined it."""
    is_look: bool = False
    """Whether somebody looks for a while and then goes by what was said: what is not known is not well."""
    transforms: TransformsConfig | None = None
    """The transforms for which its sets wait."""
    lapses: Sequence[Lapse] = ()
    """The last sets that were given up because they could not be transformed."""
    unheard: Sequence[tuple[str, Endpoint]] = ()
    """The publishers of transforms that do not offer what tf2 requests, with their topics."""
    inactive: str | None = None
    """The name of a managed node that waits to be activated."""
    bundle: BundleGraph | None = None
    """What there is around the topic on which its sets leave as one message each, if they do."""
    standing: Standing = Standing.ENOUGH
    """How many of the possible sets leave."""

    @property
    def clock_name(self) -> str:
        """The clock by which the times of receipt are."""
        if self.is_recorded:
            return "the recorder's clock"
        return "this machine's clock" if self.clock is None else "/clock"

    @property
    def required_first(self) -> Sequence[int]:
        """The indices of the inputs, those of the required ones first."""
        indices = range(len(self.inputs))
        if all(each.required for each in self.inputs):
            return indices
        return sorted(indices, key=lambda index: not self.inputs[index].required)

    @property
    def possible_hz(self) -> float:
        """The most sets a second that there could be: one for each message of the input that sets the pace, or tick."""
        possible = self.figures.best_hz / self.every
        return min(possible, _SECOND / self.least_period) if self.least_period else possible

    @property
    def pacemaker(self) -> InputFacts:
        """The input that sets the pace: the trigger, or the required one with the fewest messages."""
        if self.trigger is not None:
            return self.inputs[self.trigger]
        return min((each for each in self.inputs if each.required), key=lambda each: each.figures.rate_hz)

    @property
    def fates(self) -> tuple[DropFates, ...]:
        """What became of the dropped messages of each input since the group's start."""
        return drop_fates([each.counts.dropped for each in self.inputs], self._counted)

    @property
    def fates_lately(self) -> tuple[DropFates, ...]:
        """What became of those of the last seconds."""
        return drop_fates([each.figures.dropped for each in self.inputs], self._counted)

    @property
    def _counted(self) -> tuple[int, ...]:
        required = [index for index, each in enumerate(self.inputs) if each.required]
        return may_set_pace(required, trigger=self.trigger, by_clock=self.ticks_hz is not None)

    def lag(self, index: int) -> int | None:
        """Return how long after their stamps an input's messages come, in nanoseconds; None if no clock can tell."""
        return None if self.clock and not self.clock.received else self.inputs[index].figures.delay

    def tolerance_of(self, index: int) -> Tolerance | None:
        """Return how far an input's stamps may be from those of its set; None where any distance will do."""
        return self.inputs[index].own_tolerance or self.tolerance

    def is_held(self, index: int) -> bool:
        """Whether the latest message of this input is held and serves until there is a newer one."""
        return self.repeats and index != self.trigger

    @property
    def silent_after(self) -> int:
        """After how long without a set the group is silent: 5 s, or three sets that should have come.

        15 s while an input has sent a single message, which does not tell how often it sends.
        """
        if self.possible_hz:
            return max(_NO_SETS, round(3 * _SECOND / self.possible_hz))
        is_young = any(
            each.required and each.figures.rate_hz == 0 and len(each.figures.received) == 1
            for index, each in enumerate(self.inputs)
            if not self.is_held(index)
        )
        return NO_SECOND + _NO_SETS if is_young else _NO_SETS

    @property
    def is_silent(self) -> bool:
        """Whether sets that should have come did not."""
        # The first of these is the usual answer, and the cheapest.
        return self.silent_for >= _NO_SETS and self.silent_for >= self.silent_after and not self._is_resting

    @property
    def _is_resting(self) -> bool:
        return self.asleep or self.pause is not None or self.inactive is not None

    @property
    def has_stopped(self) -> bool:
        """Whether a few sets in a row that should have come did not. What it takes longer to be sure of is silence."""
        if self.silent_for < _STOPPED:
            return False
        if self.is_silent:
            return True
        required = [each.figures for each in self.inputs if each.required]
        flows = [each.flows_since for each in required if each.flows_since is not None]
        if self._is_resting or len(flows) < len(required) or not self.possible_hz:
            return False
        since = max(self.figures.now - self.silent_for, *flows)
        return self.figures.now - since >= max(_STOPPED, round(_STOPPED_SETS * _SECOND / self.possible_hz))

    @property
    def had_time(self) -> bool:
        """Whether messages have come on all inputs for long enough that there should be a set."""
        required = [each for each in self.inputs if each.required]
        since = max(max(each.figures.flows_since or self.figures.now, each.served_since or 0) for each in required)
        return self.figures.now - self._from_the_start_on(since) >= self.silent_after

    @property
    def is_new(self) -> bool:
        """Whether no set leaves, of a publisher that came so recently that its messages do not yet tell why."""
        if not self.is_silent:
            return False
        since = max(each.served_since or 0 for each in self.inputs if each.required)
        return self.figures.now - self._from_the_start_on(since) < 2 * self.silent_after and not self.had_time

    def _from_the_start_on(self, since: int) -> int:
        """Return when a flow began, or when the group did if discovery alone made it seem later."""
        began = self.figures.began
        return began if began <= since <= began + _FOUND_AT_ONCE else since

    @property
    def silent_for(self) -> int:
        """For how long no set has left that might have: not while the group was paused."""
        last = self.figures.began if self.figures.last_set is None else self.figures.last_set
        return self.figures.now - (last if self.unpaused is None else max(last, self.unpaused))
