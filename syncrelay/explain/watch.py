"""A group of the file under observation: what came and left, and from it, at any moment, the facts."""

from collections.abc import Callable, Hashable, Sequence
from typing import Unpack

from syncrelay.clock import Step
from syncrelay.config import GroupConfig
from syncrelay.explain.facts import Around, GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND
from syncrelay.explain.graph_facts import InputGraph, serving
from syncrelay.explain.input_observation import Arrivals
from syncrelay.explain.observation import Observation, SentSets
from syncrelay.explain.standing import StandingWatch
from syncrelay.explain.suggester import Suggester
from syncrelay.explain.trials import Trials
from syncrelay.explain.try_budget import TryBudget
from syncrelay.sync.counts import InputCounts


class GroupWatch:
    """Gathers what is known of a group, from `began` on; times are nanoseconds of one clock.

    `budget` bounds what is tried out for suggestions, together with other groups; without it each try is bounded alone.
    `whole` gives trials on a whole recording, whose values are then suggested.
    """

    def __init__(
        self,
        config: GroupConfig,
        *,
        began: int,
        budget: TryBudget | None = None,
        whole: Callable[[], Trials] | None = None,
    ) -> None:
        self.config = config
        self._tolerance = config.options.tolerance
        self._own_tolerances, self._narrowed = config.own_tolerances, config.narrowed
        self._ticks_hz = None if config.ticks is None else config.ticks.hz
        self._counts: tuple[InputCounts, ...] = config.engine().counts()
        self._keys: Sequence[Hashable] = (None,) * len(config.topics)
        self._publishers = [0] * len(config.topics)
        self._served_since: list[int | None] = [began] * len(config.topics)
        self._was_paused = False
        self._unpaused: int | None = None
        self._woke: int | None = None
        self._clock_set: Step | None = None
        self._observation = Observation(config, began=began)
        self._standing = StandingWatch()
        # Keys are not kept: what is matched by them cannot be run again. Nor can what a simulated clock triggered:
        # times of receipt are this machine's.
        can_run = config.options.by_stamp and (config.ticks is None or not config.inputs.node.use_sim_time)
        self._suggester = Suggester(config, self._observation.recent, budget, whole) if can_run else None

    def add(
        self,
        arrivals: Sequence[Arrivals],
        sets: SentSets,
        counts: Sequence[InputCounts],
        total_sets: int,
        *,
        keys: Sequence[Hashable] | None = None,
        by_clock: Callable[[int], int] | None = None,
        woke: int | None = None,
        clock_set: Step | None = None,
        now: int,
    ) -> None:
        """Take what came and left since the last call; see Observation. `keys` are the newest messages'.

        `by_clock` tells, where time is simulated, what its clock showed at a time of receipt. `woke` is when the group
        was last fed again after a sleep: it is judged by what came since. `clock_set` is how this machine's clock was
        last set.
        """
        if clock_set is not None and clock_set != self._clock_set:
            self._clock_set = clock_set
            if clock_set.by >= SECOND:
                # What came before was received by another clock: it would count as long ago.
                self._observation.begin_again(now)
                arrivals = [[each for each in came if each[1] > now - clock_set.by // 2] for came in arrivals]
        if woke is not None and woke != self._woke:
            self._woke = woke
            self._standing = StandingWatch()
            self._observation.begin_again(woke)
            arrivals = [[each for each in came if each[1] >= woke] for came in arrivals]
        self._counts = tuple(counts)
        if keys is not None:
            self._keys = keys
        self._observation.add(arrivals, sets, counts, total_sets, by_clock=by_clock, now=now)

    def facts(
        self,
        graph: Sequence[InputGraph],
        *,
        now: int,
        **around: Unpack[Around],
    ) -> GroupFacts:
        """Give all that is known now."""
        options = self.config.options
        self._follow_pauses(now, is_paused=around.get("pause") is not None)
        self._compare_publishers(graph)
        types = [
            shown.type_from.type if topic.type is None and shown.type_from else topic.type
            for topic, shown in zip(self.config.topics, graph, strict=True)
        ]
        self._follow_publishers(graph, types, now)
        figures, input_figures = self._observation.figures(now=now)
        needed = self._observation.needed
        rows = zip(
            self.config.topics,
            graph,
            types,
            self._counts,
            input_figures,
            self._keys,
            self._served_since,
            self._own_tolerances,
            self._narrowed,
            strict=True,
        )
        facts = GroupFacts(
            name=self.config.name,
            policy=options.policy,
            queue_size=options.queue_size,
            inputs=tuple(
                InputFacts(
                    graph=shown,
                    type=type_name,
                    required=index in needed,
                    in_quorum=topic.in_quorum,
                    counts=counts,
                    figures=seen,
                    key=key,
                    offset=topic.offset_ns,
                    served_since=since,
                    own_tolerance=own,
                    narrowed=narrowed,
                )
                for index, (topic, shown, type_name, counts, seen, key, since, own, narrowed) in enumerate(rows)
            ),
            figures=figures,
            tolerance=self._tolerance,
            by_stamp=options.by_stamp,
            distance=options.distance,
            repeats=options.repeats,
            trigger=self.config.trigger,
            ticks_hz=self._ticks_hz,
            max_wait=options.max_wait,
            every=options.every,
            least_period=options.max_rate,
            transforms=options.transforms,
            unpaused=self._unpaused,
            suggester=self._suggester,
            **around,
        )
        if facts.asleep:
            return facts
        # A group whose publishers have just come has not missed a set yet.
        is_silent = facts.is_silent and not facts.is_new
        facts.standing = self._standing.follow(figures.share, is_silent=is_silent)
        return facts

    def _follow_pauses(self, now: int, *, is_paused: bool) -> None:
        if self._was_paused and not is_paused:
            self._unpaused = now
            self._observation.begin_sets_anew(now)
        elif self._unpaused is not None:
            # This machine's clock may be set back.
            self._unpaused = min(self._unpaused, now)
        self._was_paused = is_paused

    def _follow_publishers(self, graph: Sequence[InputGraph], types: Sequence[str | None], now: int) -> None:
        for index, (shown, type_name) in enumerate(zip(graph, types, strict=True)):
            since = self._served_since[index]
            if not serving(shown, type_name):
                self._served_since[index] = None
            elif since is None:
                self._served_since[index] = now
                # By the same node, maybe, maybe not by the same clock.
                self._observation.inputs[index].forget_clock()
            elif since > now:
                # This machine's clock was set back.
                self._served_since[index] = now

    def _compare_publishers(self, graph: Sequence[InputGraph]) -> None:
        """See whether inputs have more or fewer publishers than they had; one that is restarted is the same."""
        for index, shown in enumerate(graph):
            count = len(shown.publishers)
            if count and count != self._publishers[index]:
                if self._publishers[index]:
                    self._observation.inputs[index].forget_publishers()
                self._publishers[index] = count
