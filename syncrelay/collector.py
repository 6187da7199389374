"""Python's garbage collector: at rest while modules are imported, at ease while recordings are read."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

# So many new objects make the collector look: a chunk of small messages.
_NEW_OBJECTS: Final = 50_000


@contextmanager
def resting_collector() -> Iterator[None]:
    """Collect no garbage meanwhile, and have the collector pass over all that exists by the end.

    For imports, whose results stay: the collector goes through them again and again otherwise, which takes a sixth of
    the start of a relay.
    """
    usual = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if usual:
            gc.enable()


@contextmanager
def eased_collector() -> Iterator[None]:
    """Have the garbage collector look less often: messages live for a chunk and make no cycles, and are many.

    At its usual pace, it takes an eighth of the time of a replay.
    """
    usual = gc.get_threshold()
    gc.set_threshold(_NEW_OBJECTS, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)
