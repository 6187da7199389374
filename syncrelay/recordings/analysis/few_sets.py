"""Which key costs a group most of the sets that a recording has for it: the engine is run without each."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.config.wording import counted
from syncrelay.explain import UNREADABLE, words
from syncrelay.explain.changes import Change, changed
from syncrelay.recordings.analysis.evaluation import evaluate
from syncrelay.recordings.analysis.streams import Stream, read_streams
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.recording import Recording
from syncrelay.sync import InputCounts
from syncrelay.sync.queues import LONGEST_QUEUE

# Below, half of them may be what is at the ends of a recording.
_FEWEST: Final = 10
# As if a tolerance or a wait were not there: a day.
_NO_LIMIT_NS: Final = 86_400 * 10**9


def why_few_sets(
    recording: Recording,
    binding: GroupBinding,
    counts: Collection[InputCounts],
    complete: int,
    *,
    needed: Collection[int] = (),
) -> str | None:
    """Say how few of the possible sets are complete where it is less than half, and which key costs most of the others.

    `counts` are those of a replay that gave so many complete sets: those that have the required inputs and the `needed`
    ones. The recording is read again only where sets are few.
    """
    group = binding.group
    fed = [each.fed for each in counts]
    among = sorted({*group.enough(fed), *needed})
    possible = _possible(recording, group, fed, among)
    if possible < _FEWEST or 2 * complete >= possible:
        return None
    few = f"{group.name}: only {complete} of {counted(possible, 'possible set')} are complete"
    (streams,) = read_streams(recording, [binding])
    best = max(
        ((_complete(other, streams, among), -number, key) for number, (key, other) in enumerate(_without_a_key(group))),
        default=None,
    )
    if best is None or 2 * (best[0] - complete) <= possible - complete:
        return f"{few}: `syncrelay analyze` says more"
    return f"{few}, because of {best[2]}: without it, {min(best[0], possible)} would be"


def _possible(recording: Recording, group: GroupConfig, fed: list[int], among: Collection[int]) -> int:
    """Return how many sets there could be: one for each message of the input that sets the pace, or each tick."""
    length = recording.end - recording.begin
    if group.ticks is not None:
        most = group.ticks.last_until(recording.end) - group.ticks.last_until(recording.begin)
    else:
        most = min(fed[index] for index in among) if group.trigger is None else fed[group.trigger]
    most //= group.options.every
    return min(most, length // group.options.max_rate) if group.options.max_rate else most


def _without_a_key(group: GroupConfig) -> Iterator[tuple[str, GroupConfig]]:
    """Yield a group as it would be without each key that keeps sets from leaving, and the key as it stands."""
    options = group.options
    for index, topic in enumerate(group.topics):
        can_differ = topic.tolerance is not None and topic.tolerance.key in type(options.topics[index]).model_fields
        if topic.tolerance is not None and can_differ and index != group.trigger:
            wider = options.topics[index].model_copy(update={topic.tolerance.key: _NO_LIMIT_NS})
            topics = (*options.topics[:index], wider, *options.topics[index + 1 :])
            yield f"{_said(topic.tolerance.key, topic.tolerance.ns)} for {topic.topic}", _with(group, topics=topics)
    tolerance = options.tolerance
    if tolerance is not None and tolerance.is_key:
        yield _said(tolerance.key, tolerance.ns), _with(group, **{tolerance.key: _NO_LIMIT_NS})
    elif tolerance is not None and tolerance.wider_policy is not None:
        wide = (Change("policy", tolerance.wider_policy), Change(tolerance.key, words.exactly(_NO_LIMIT_NS)))
        yield f"policy {options.policy}", changed(group, wide)
    yield f"queue_size {options.queue_size}", _with(group, queue_size=max(options.queue_size, LONGEST_QUEUE))
    if options.transforms is not None:
        yield f"the wait for transforms to {options.transforms.target}", _with(group, transforms=None)
    if options.max_wait is not None and group.ticks is None:
        yield _said("max_wait", options.max_wait), _with(group, max_wait=_NO_LIMIT_NS)


def _said(key: str, ns: int) -> str:
    return f"{key} {words.duration(ns)}"


def _with(group: GroupConfig, **keys: object) -> GroupConfig:
    return replace(group, options=group.options.model_copy(update=keys))


def _complete(group: GroupConfig, streams: tuple[Stream, ...], among: Collection[int]) -> int:
    """Return how many sets have a message of all these inputs: no more than of the one that the fewest have."""
    sets = evaluate(group, streams).sets.rows
    missing = sum((np.count_nonzero(rows == UNREADABLE, axis=0) for rows in sets.blocks()), np.zeros(sets.width, int))
    return int(len(sets) - missing[[*among]].max())
