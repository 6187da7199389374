"""Payloads that have a name and a time of receipt, and no bytes; and the flows that take them."""

from importlib.util import find_spec
from typing import Any, NamedTuple

from syncrelay.dataflow.flow import Flow

FLOWS = [Flow]
if find_spec("syncrelay.ros.compiled.path") is not None:
    from syncrelay.ros.compiled.path import Flow as CompiledFlow

    FLOWS.append(CompiledFlow)


class Named(NamedTuple):
    name: Any
    received: int = 0

    def content(self) -> bytes:
        return b""
