"""Whether the compiled path may be used here: a message must go through it there and back, before any other does."""

import time
from typing import Any

from syncrelay.ros.compiled import path, source_fingerprint
from syncrelay.ros.compiled.backend import CompiledBackend
from syncrelay.ros.librcl.check import PATIENCE_NS, PAYLOAD, LibrclUnusableError, endpoints
from syncrelay.ros.librcl.rcl import Rcl, RclCallError


def compiled_backend(rcl: Rcl, node: Any) -> CompiledBackend:
    """Return the compiled backend, proven on a topic of the node's own; raises LibrclUnusableError.

    The functions of librcl must have proven themselves.
    """
    if source_fingerprint() not in (None, path.SOURCE):
        raise LibrclUnusableError("it was built from another path.pyx: install syncrelay again")
    try:
        backend = CompiledBackend(rcl)
        with endpoints(node) as (subscription, publisher):
            _check_there_and_back(backend, subscription, publisher)
    except (ValueError, RclCallError) as error:
        raise LibrclUnusableError(str(error)) from error
    return backend


def _check_there_and_back(backend: CompiledBackend, subscription: Any, publisher: Any) -> None:
    came: list[tuple[bytes, int]] = []

    def deliver(payload: Any) -> None:
        came.append((bytes(payload.content()), payload.received))
        if len(came) == 1:
            backend.outlet(publisher).send(payload)

    inbox, source = backend.inbox(), backend.source(subscription, deliver)
    inbox.add(source)
    before, end = time.time_ns(), time.monotonic_ns() + PATIENCE_NS
    try:
        publisher.handle.publish_raw(PAYLOAD)
        while len(came) < 2 and (left := end - time.monotonic_ns()) > 0 and not inbox.failed:  # noqa: PLR2004
            inbox.receive_once(left)
        failed = inbox.failed.get(source)
    finally:
        inbox.close()
    if failed is not None:
        raise LibrclUnusableError(str(failed)) from failed
    if [content for content, _ in came] != [PAYLOAD, PAYLOAD]:
        raise LibrclUnusableError("a message does not come back as it was")
    if any(not 0 <= received - before <= PATIENCE_NS for _, received in came):
        raise LibrclUnusableError("the time of receipt is not as expected")
