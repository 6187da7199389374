"""Python's garbage collector: at rest while modules are imported, at ease while recordings are read."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

# New objects between two collections: about a chunk of small messages.
_NEW_OBJECTS: Final = 50_000


@contextmanager
def resting_collector() -> Iterator[None]:
    """Collect no garbage during imports, and exclude what they leave from later collections.

    Modules stay for good. Going through them again and again would take a sixth of the start of a relay.
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
    """Collect garbage less often: messages are many, live for a chunk, and make no cycles.

    With the usual threshold the collector takes an eighth of the time of a replay.
    """
    usual = gc.get_threshold()
    gc.set_threshold(_NEW_OBJECTS, *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)
