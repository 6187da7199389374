from array import array

import numpy as np
import numpy.typing as npt

from syncrelay.sync.group import SyncGroup

SOURCE: str

def feed(
    engine: SyncGroup,
    inputs: npt.NDArray[np.int64],
    stamps: npt.NDArray[np.int64],
    received: npt.NDArray[np.int64],
    at: int,
    sets: array[int],
    drops: array[int],
    no_tick: int,
) -> int: ...
