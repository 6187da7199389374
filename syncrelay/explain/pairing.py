"""Whether it is certain which messages belong together, where the stamps of an input come of its times of receipt.

Such stamps, mapped or moved by the difference of delays, are late by the least time that a message takes to arrive.
Nothing shows that time: it only is likely to be some part of a period, and less than a tenth of a second. Where the
others come so often that this time decides which message is nearest, no trial can tell the right one.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from syncrelay.config import Distance
from syncrelay.explain.nearest import Nanoseconds, period_of, shifted, signed_distances
from syncrelay.explain.rows import Column, quantiles
from syncrelay.explain.trials import REQUIRED, Trials

# A message usually takes no longer than this, and leaves before the next is measured.
_LONGEST_WAY: Final = 100_000_000
_SHARE_OF_PERIOD: Final = 0.5
_NEARLY_ALL: Final = 0.98
# The delay of the quickest messages: one alone may have been quicker than any other.
_LEAST: Final = 0.05


def is_certain(moved: Trials, index: int, target: int | None = REQUIRED) -> bool:
    """Whether an input's messages have the same partners, or ones that are near enough, however long they take."""
    tolerance, possible = moved.config.options.tolerance, moved.possible(target)
    if possible is None or tolerance is None or moved.config.options.distance is not Distance.SPAN:
        return True
    own = moved.stamps(index)
    most = min(_LONGEST_WAY, round(_SHARE_OF_PERIOD * period_of(own)))
    messages, offset = moved.inputs[index], moved.config.topics[index].offset_ns
    if not messages.are_stamped.any():
        return False
    # When it was measured, after its stamp: between these.
    (last,) = quantiles(lambda: (at - shifted(stamps, offset) for stamps, at, _ in messages.stamped()), [_LEAST])
    first = last - most
    others = [each for each in possible.among if each != index] if index == possible.pivot else [possible.pivot]
    return all(_belong(own, moved.stamps(each), first, last, tolerance.ns) for each in others)


def _belong(own: Column, theirs: Column, first: int, last: int, tolerance: int) -> bool:
    """Whether the nearest are within the tolerance whenever its own were measured, between the first and the last.

    Or they are within it at some time, and no others are at any.
    """
    after = signed_distances(own, theirs) if len(own) <= len(theirs) else -signed_distances(theirs, own)
    if not len(after):
        return False
    if _nearly_all(np.maximum(np.abs(after - first), np.abs(after - last)) <= tolerance):
        return True
    least, most = first - tolerance, last + tolerance
    partners = _counts(theirs[:], own[:] + least, own[:] + most), _counts(own[:], theirs[:] - most, theirs[:] - least)
    return _nearly_all((least <= after) & (after <= most)) and all(_nearly_all(each <= 1) for each in partners)


def _counts(stamps: Nanoseconds, begins: Nanoseconds, ends: Nanoseconds) -> Nanoseconds:
    counts: Nanoseconds = np.searchsorted(stamps, ends, side="right") - np.searchsorted(stamps, begins, side="left")
    return counts


def _nearly_all(are: npt.NDArray[np.bool_]) -> bool:
    return bool(np.mean(are) >= _NEARLY_ALL)
