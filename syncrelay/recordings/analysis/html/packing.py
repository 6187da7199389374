"""Long rows of whole numbers in few characters, for the script of the page to unpack."""

import gzip
from base64 import b64encode
from typing import Any, Final

import numpy as np

from syncrelay.recordings.bag.columns import Nanoseconds

_LARGEST: Final = 2**31 - 1


def pack(values: Nanoseconds) -> dict[str, Any]:
    """Return how many numbers there are, the unit they are told in, and the steps from one to the next.

    The unit is 1, or the least power of ten in which each step fits 32 bits. `steps` are base64 of gzip of the lowest
    bytes of all steps, then the next, up to the highest: alike ones stand together.
    """
    unit = 1
    steps = _steps(values)
    while len(steps) and int(np.max(np.abs(steps))) > _LARGEST:
        unit *= 10
        steps = _steps(values // unit)
    planes = steps.astype("<i4").view(np.uint8).reshape(-1, 4).T
    # Without a time in it, the same recording makes the same file.
    packed = gzip.compress(planes.tobytes(), mtime=0)
    return {"count": len(values), "unit": unit, "steps": b64encode(packed).decode("ascii")}


def _steps(values: Nanoseconds) -> Nanoseconds:
    return np.diff(values, prepend=np.int64(0))
