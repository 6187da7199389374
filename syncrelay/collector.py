"""Python's garbage collector, at rest while modules are imported."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


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
