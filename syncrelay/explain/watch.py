"""A group of the file under observation: what came and left, and from it, at any moment, the facts."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from syncrelay.config import GroupConfig
from syncrelay.explain.facts import Endpoint, GroupFacts, InputFacts, Refusal, Standstill, Tolerance
from syncrelay.explain.input_observation import Arrivals
from syncrelay.explain.observation import Observation, SentSets
from syncrelay.sync.counts import InputCounts


@dataclass(frozen=True, slots=True)
class InputGraph:
    """What the graph shows of an input; see InputFacts. A recording has no graph: its `name` alone."""

    name: str
    output: str
    publishers: tuple[Endpoint, ...] = ()
    subscribers: tuple[Endpoint, ...] = ()
    alike: tuple[str, ...] = ()
    not_importable: str | None = None
    refusal: Refusal | None = None
    lost: int = 0
    rivals: tuple[Endpoint, ...] = ()
    rivals_since: int = 0


class GroupWatch:
    """Gathers what is known of a group, from `began` on; times are nanoseconds of one clock."""

    def __init__(self, config: GroupConfig, *, began: int) -> None:
        self.config = config
        self._counts: tuple[InputCounts, ...] = config.engine().counts()
        self._keys: Sequence[Hashable] = (None,) * len(config.topics)
        self._trigger = config.inputs.index_of(config.keys.trigger) if config.keys.policy == "latest_time" else None
        self._observation = Observation(
            offsets_ns=[topic.offset_ns for topic in config.topics],
            required=[topic.required for topic in config.topics],
            began=began,
            trigger=self._trigger,
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
        keys = self.config.keys
        figures, input_figures = self._observation.figures(now=now)
        rows = zip(self.config.topics, graph, self._counts, input_figures, self._keys, strict=True)
        return GroupFacts(
            name=self.config.name,
            policy=keys.policy,
            queue_size=keys.queue_size,
            inputs=tuple(
                InputFacts(
                    name=shown.name,
                    type=topic.type,
                    output=shown.output,
                    required=topic.required,
                    counts=counts,
                    figures=seen,
                    publishers=shown.publishers,
                    subscribers=shown.subscribers,
                    alike=shown.alike,
                    not_importable=shown.not_importable,
                    refusal=shown.refusal,
                    lost=shown.lost,
                    rivals=shown.rivals,
                    rivals_since=shown.rivals_since,
                    key=key,
                    offset=topic.offset_ns,
                )
                for topic, shown, counts, seen, key in rows
            ),
            figures=figures,
            tolerance=_tolerance(self.config),
            by_stamp=keys.policy != "equal_key",
            trigger=self._trigger,
            max_wait=keys.max_wait,
            every=keys.every,
            least_period=keys.max_rate,
            clock_stopped=clock_stopped,
            waited=waited,
            standstill=standstill,
            failure=failure,
        )


def _tolerance(config: GroupConfig) -> Tolerance | None:
    match config.keys.policy:
        case "exact_time":
            return Tolerance("slop", 0)
        case "latest_time":
            return None if config.keys.max_age is None else Tolerance("max_age", config.keys.max_age)
        case "equal_key":
            return None
        case _:
            return Tolerance("slop", config.keys.slop)
