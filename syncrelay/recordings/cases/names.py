"""Finds the input that a case names by its topic, or by a part that no other topic has."""

from collections.abc import Sequence

from syncrelay.config import GroupConfig
from syncrelay.config.wording import all_of, one_of, quoted
from syncrelay.recordings.cases.drawing import DidYouMean


def input_named(name: str, group: GroupConfig, *, did_you_mean: DidYouMean) -> int:
    """Return the index of an input by a name: `left` names /left/image_raw if no other topic has that part.

    Raises ValueError if no input or several have it.
    """
    topics = [topic.topic for topic in group.topics]
    for known in (group.inputs.names, topics):
        if name in known:
            return known.index(name)
    wanted = _parts(name)
    found = [index for index, topic in enumerate(topics) if wanted and _has(_parts(topic), wanted)]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{quoted(name)} is a part of {all_of(topics[index] for index in found)}: write more of it")
    hint = did_you_mean(
        name, [*topics, *(_parts(topic)[-1] for topic in topics), *(_parts(topic)[0] for topic in topics)]
    )
    raise ValueError(f"{quoted(name)} is not an input of {group.name}{hint or f', expected {one_of(topics)}'}")


def _parts(name: str) -> Sequence[str]:
    return [part for part in name.split("/") if part]


def _has(parts: Sequence[str], wanted: Sequence[str]) -> bool:
    places = range(len(parts) - len(wanted) + 1)
    return any(parts[place : place + len(wanted)] == wanted for place in places)
