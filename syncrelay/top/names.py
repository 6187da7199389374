"""Short names of topics, where the full ones do not fit."""

from collections.abc import Sequence
from itertools import takewhile
from typing import Final

_ELLIPSIS: Final = "…"


def short_names(topics: Sequence[str]) -> list[str]:
    """Name topics by the first part that differs in all: /demo/camera/image_raw is `camera` beside /demo/imu/data."""
    parts = [topic.strip("/").split("/") for topic in topics]
    for candidates in zip(*parts, strict=False):
        if len(set(candidates)) == len(topics):
            return list(candidates)
    return list(topics)


def fitted_names(topics: Sequence[str], width: int) -> list[str]:
    """Shorten topics that are longer than a width: leave out the parts that all begin and end with.

    /robot/camera_1/image and /robot/camera_2/image are `…/camera_1/…` and `…/camera_2/…`.
    """
    if all(len(topic) <= width for topic in topics):
        return list(topics)
    parts = [topic.split("/") for topic in topics]
    before = _n_common(parts)
    # At least one part of the shortest topic stays.
    most_behind = min(map(len, parts)) - before - 1
    behind = min(_n_common([each[::-1] for each in parts]), most_behind)
    if len(topics) == 1 or most_behind < 0:
        return [fitted(topic, width) for topic in topics]
    return [fitted(_without(each, before, behind), width) for each in parts]


def fitted(name: str, width: int) -> str:
    """Cut a name in its middle to a width if it is longer, as the ends of topics tell more."""
    if len(name) <= width:
        return name
    tail = (width - 1) * 2 // 3
    return name[: width - 1 - tail] + _ELLIPSIS + name[len(name) - tail :]


def _n_common(parts: Sequence[Sequence[str]]) -> int:
    return len(list(takewhile(lambda column: len(set(column)) == 1, zip(*parts, strict=False))))


def _without(parts: Sequence[str], before: int, behind: int) -> str:
    kept = "/".join(parts[before : len(parts) - behind])
    # A name in the root has an empty part before its slash.
    begin = f"{_ELLIPSIS}/" if before > 1 else "/"
    return f"{begin}{kept}{f'/{_ELLIPSIS}' if behind else ''}"
