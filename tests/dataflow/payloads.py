"""Payloads that have a name and a time of receipt, and no bytes; the flows that take them, and outlets for them."""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.group import GroupRelay

FLOWS = [Flow]
if find_spec("syncrelay.ros.compiled.path") is not None:
    from syncrelay.ros.compiled.path import Flow as CompiledFlow

    FLOWS.append(CompiledFlow)


class Named(NamedTuple):
    name: Any
    received: int = 0

    def content(self) -> bytes:
        return b""


class Outlet:
    """Keeps the names of what it sends."""

    topic = "/out"

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, payload: Named) -> None:
        self.sent.append(payload.name)


def connect(group: GroupRelay, outlets: Sequence[Outlet]) -> None:
    """Have a group publish on these, an output each."""
    for index, outlet in enumerate(outlets):
        group.connect(index, outlet, restamped=False)  # type: ignore[arg-type]  # as much of one as is used
