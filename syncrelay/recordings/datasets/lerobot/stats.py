"""Statistics of features, by which policies are normalized: of an episode and of the dataset.

They are those of LeRobot 0.6: min, max, mean, std, count and five quantiles, for each value of a vector and each colour
of a video. The quantiles of the dataset are means of the episodes' quantiles, weighted by frames.
"""

from collections.abc import Mapping
from typing import Any, Final, TypeAlias

import numpy as np

Numbers: TypeAlias = np.ndarray[Any, np.dtype[Any]]
Stats: TypeAlias = dict[str, Numbers]
"""The statistics of one feature, by LeRobot's names."""

_QUANTILES: Final[Mapping[str, float]] = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_COUNT: Final = "count"
# Of pictures from this size on, about so many pixels of the longer side are used.
_LARGE: Final = 300
_SAMPLED: Final = 150
_LEVELS: Final = 256
_COLOURS: Final = 3


def stats_of(rows: Numbers) -> Stats:
    """Return the statistics of vectors, [frame, value], or of single values, [frame]."""
    values = rows.reshape(len(rows), -1).astype(np.float64)
    kept = rows.dtype if np.issubdtype(rows.dtype, np.integer) else np.float64
    quantiles = np.quantile(values, list(_QUANTILES.values()), axis=0)
    return {
        "min": values.min(axis=0).astype(kept),
        "max": values.max(axis=0).astype(kept),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        _COUNT: np.array([len(rows)]),
        **dict(zip(_QUANTILES, quantiles, strict=True)),
    }


class PictureStats:
    """The statistics of a video's colours, from 0 to 1, of some pixels of every frame."""

    def __init__(self) -> None:
        self._levels = np.zeros((_COLOURS, _LEVELS), np.int64)
        self._frames = 0

    def add(self, pixels: Numbers, times: int) -> None:
        """Add a picture [height, width, RGB] that so many frames show."""
        longer = max(pixels.shape[:2])
        step = 1 if longer < _LARGE else longer // _SAMPLED
        seen = pixels[::step, ::step].reshape(-1, _COLOURS)
        for colour in range(_COLOURS):
            self._levels[colour] += times * np.bincount(seen[:, colour], minlength=_LEVELS)
        self._frames += times

    def stats(self) -> Stats:
        """Return the statistics of the pictures so far."""
        levels = np.arange(_LEVELS) / (_LEVELS - 1)
        passed = self._levels.cumsum(axis=1)
        total = passed[:, -1:]
        means = self._levels @ levels / total[:, 0]
        variances = self._levels @ levels**2 / total[:, 0] - means**2
        found = {
            "min": levels[(passed > 0).argmax(axis=1)],
            "max": levels[(passed == total).argmax(axis=1)],
            "mean": means,
            "std": np.sqrt(np.maximum(variances, 0)),
            _COUNT: np.array([self._frames]),
            **{name: levels[(passed >= part * total).argmax(axis=1)] for name, part in _QUANTILES.items()},
        }
        return {name: each if name == _COUNT else each.reshape(_COLOURS, 1, 1) for name, each in found.items()}


def together(some: Stats, more: Stats) -> Stats:
    """Return the statistics of a feature in two parts of a dataset together."""
    counts = (int(some[_COUNT][0]), int(more[_COUNT][0]))
    total = sum(counts)

    def weighted(one: Numbers, other: Numbers) -> Numbers:
        mean: Numbers = (one * counts[0] + other * counts[1]) / total
        return mean

    mean = weighted(some["mean"], more["mean"])
    variance = weighted(some["std"] ** 2 + (some["mean"] - mean) ** 2, more["std"] ** 2 + (more["mean"] - mean) ** 2)
    return {
        "min": np.minimum(some["min"], more["min"]),
        "max": np.maximum(some["max"], more["max"]),
        "mean": mean,
        "std": np.sqrt(variance),
        _COUNT: np.array([total]),
        **{name: weighted(some[name], more[name]) for name in _QUANTILES},
    }


def as_lists(stats: Mapping[str, Stats]) -> dict[str, dict[str, Any]]:
    """Return the statistics of features as JSON has them."""
    return {name: {what: value.tolist() for what, value in each.items()} for name, each in stats.items()}
