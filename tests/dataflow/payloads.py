"""Payloads that have a name and a time of receipt, and no bytes; sources, groups and outlets for them."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

from syncrelay.config import load_text
from syncrelay.dataflow.backend import ALL
from syncrelay.dataflow.deliveries import Deliveries
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.group import GroupRelay
from syncrelay.explain import Tape
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

FLOWS = [Flow]
if find_spec("syncrelay.ros.compiled.path") is not None:
    from syncrelay.ros.compiled.path import Flow as CompiledFlow

    FLOWS.append(CompiledFlow)

PAIR = ("/camera", "/lidar")


class Named(NamedTuple):
    name: Any
    received: int = 0

    def content(self) -> bytes:
        return b""


class Source:
    """Gives payloads, the first first, and fails where an exception stands in the place of one."""

    def __init__(self, *messages: Named | Exception, deliver: Any = lambda _: None) -> None:
        self.messages = deque(messages)
        self.deliver: Any = deliver
        self.waited = 0
        self.pending = ALL

    def deliveries(self) -> Sequence[Deliveries]:
        return ()

    def take(self) -> Named | None:
        message = self.messages.popleft() if self.messages else None
        if isinstance(message, Exception):
            raise message
        return message


class Outlet:
    """Notes what it sends in `log`, its own or one of many; refuses or is not heard, as it is told, until it ends."""

    topic = "/out"

    def __init__(self, *, log: list[Any] | None = None, place: int | None = None) -> None:
        self.log: list[Any] = [] if log is None else log
        self.sent = 0
        self.heard = True
        self.refusal: Exception | None = None
        self.ended = self.used_after_its_end = False
        self._place = place

    def send(self, payload: Named) -> None:
        self._send(payload.name)

    def send_stamped(self, payload: Named, stamp: int) -> None:
        self._send((payload.name, stamp))

    def send_content(self, content: bytes) -> None:
        # As publishing does, it lets other threads run.
        time.sleep(0)
        self.used_after_its_end |= self.ended
        self._send(content)

    def is_heard(self) -> bool:
        self.used_after_its_end |= self.ended
        return self.heard

    def _send(self, what: object) -> None:
        if self.refusal is not None:
            raise self.refusal
        self.sent += 1
        self.log.append(what if self._place is None else (self._place, what))


def group_of(
    *,
    topics: Iterable[Any] = PAIR,
    now: Callable[[], int] = lambda: 0,
    flow: type[Flow] = Flow,
    tape: Tape | None = None,
    **keys: Any,
) -> GroupRelay:
    """A group, `front` if it has no name, of vectors."""
    listed = [each for topic in topics for each in ([topic] if isinstance(topic, dict) else inputs({topic: VECTOR}))]
    text = config({keys.pop("name", "front"): {"policy": "exact_time", "topics": listed, **keys}})
    return GroupRelay(load_text(text).groups[0], now=now, flow=flow, tape=tape)


def connect(group: GroupRelay, outlets: Sequence[Outlet]) -> None:
    """Have a group publish on these, an output each."""
    for index, outlet in enumerate(outlets):
        group.connect(index, outlet, restamped=False)
