"""A group of the file under observation: what came and left, and from it, at any moment, the facts."""

from collections.abc import Hashable, Sequence

from syncrelay.config import GroupConfig
from syncrelay.explain.facts import GroupFacts, InputFacts, InputGraph, Standstill
from syncrelay.explain.input_observation import Arrivals
from syncrelay.explain.observation import Observation, SentSets
from syncrelay.sync.counts import InputCounts


class GroupWatch:
    """Gathers what is known of a group, from `began` on; times are nanoseconds of one clock."""

    def __init__(self, config: GroupConfig, *, began: int) -> None:
        self.config = config
        self._counts: tuple[InputCounts, ...] = config.engine().counts()
        self._keys: Sequence[Hashable] = (None,) * len(config.topics)
        self._observation = Observation(
            offsets_ns=[topic.offset_ns for topic in config.topics],
            required=[topic.required for topic in config.topics],
            began=began,
            trigger=config.trigger,
        )

    def add(
        self,
        arrivals: Sequence[Arrivals],
        sets: SentSets,
        counts: Sequence[InputCounts],
        total_sets: int,
        *,
        keys: Sequence[Hashable] | None = None,
        now: int,
    ) -> None:
        """Take what came and left since the last call; see Observation. `keys` are the newest messages'."""
        self._counts = tuple(counts)
        if keys is not None:
            self._keys = keys
        self._observation.add(arrivals, sets, counts, total_sets, now=now)

    def facts(
        self,
        graph: Sequence[InputGraph],
        *,
        now: int,
        clock_stopped: int | None = None,
        waited: int = 0,
        standstill: Standstill | None = None,
        failure: str | None = None,
    ) -> GroupFacts:
        """Give all that is known now."""
        options = self.config.options
        figures, input_figures = self._observation.figures(now=now)
        rows = zip(self.config.topics, graph, self._counts, input_figures, self._keys, strict=True)
        return GroupFacts(
            name=self.config.name,
            policy=options.policy,
            queue_size=options.queue_size,
            inputs=tuple(
                InputFacts(
                    graph=shown,
                    type=topic.type,
                    required=topic.required,
                    counts=counts,
                    figures=seen,
                    key=key,
                    offset=topic.offset_ns,
                )
                for topic, shown, counts, seen, key in rows
            ),
            figures=figures,
            tolerance=options.tolerance,
            by_stamp=options.by_stamp,
            trigger=self.config.trigger,
            max_wait=options.max_wait,
            every=options.every,
            least_period=options.max_rate,
            clock_stopped=clock_stopped,
            waited=waited,
            standstill=standstill,
            failure=failure,
        )
