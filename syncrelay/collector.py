"""Python's garbage collector, at rest while modules are imported."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def resting_collector() -> Iterator[None]:
    """Collect no garbage meanwhile, and never go through what exists by the end: for imports, whose results stay.

    At its usual pace the collector goes through them again and again, which takes a sixth of the start of a relay.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
