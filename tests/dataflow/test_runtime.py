"""What measures a time or waits does so by the runtime that it is given."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, cast

from syncrelay.config import load_text
from syncrelay.config.rereading import ConfigFiles
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.inbox import PolledInbox
from syncrelay.dataflow.observers import Standstills
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.explain import Standstill
from syncrelay.runtime import SystemRuntime
from tests.dataflow.payloads import Named, Source
from tests.status.support.states import TEXT


class _Clock:
    """Clocks that stand still but while somebody sleeps, as a runtime has them."""

    def __init__(self) -> None:
        self.now = 0
        self.runtime = runtime = cast("Any", SystemRuntime())
        runtime.monotonic_ns = runtime.time_ns = lambda: self.now
        runtime.monotonic = lambda: self.now / 1e9
        runtime.sleep = self.sleep

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9)


class _Watch:
    """Names a source after 30 ns, once."""

    def __init__(self, source: Source, clock: _Clock) -> None:
        self._ready, self.add, self.wake = [source], lambda _: None, lambda: None
        self._clock = clock

    def wait(self, _: int):
        self._clock.sleep(30e-9)
        return [self._ready.pop()] if self._ready else [], 2**62, False


def test_messages_wait_and_sets_are_timed_by_the_runtime():
    clock, source = _Clock(), Source(Named("x", 1))
    runtime, watch = clock.runtime, cast("Any", _Watch(source, clock))
    group = GroupRelay(load_text(TEXT).groups[0], now=lambda: 0, flow=partial(Flow, runtime=runtime), runtime=runtime)
    group.flow.receive(1, Named("y", 2), 5)
    source.deliver = lambda payload: group.flow.receive(0, payload, 5)
    inbox, standstills = PolledInbox(watch, runtime=runtime), Standstills(runtime=runtime)
    inbox.add(source)
    inbox.receive_once(1)
    assert list(group.watched().sets) == [((5, 5), 28)]
    standstills.end()
    standstills.observe()
    assert standstills.recent == (Standstill(30, 30),)
    group.pause()
    group.wake()
    assert (group.paused_since, group.woke) == (30, 30)
    assert ReceiveLoop(inbox, now=lambda: 0, expire=lambda _: None, runtime=runtime).turned == 30e-9


def test_files_are_read_on_a_thread_of_the_runtime_and_too_late_by_its_clock(tmp_path: Path):
    (tmp_path / "a.yaml").write_text(TEXT)
    clock, threads = _Clock(), list[Callable[[], None]]()
    runtime = clock.runtime
    runtime.start = lambda _name, target, **_: threads.append(target)
    with ConfigFiles([str(tmp_path)], watched=False, runtime=runtime) as files:
        asked = files.read_again()
        assert files.take() is None
        clock.sleep(6.1)
        late = files.take()
        assert late is not None
        assert late.asked == (asked,)
        assert "could not be read within 6 s" in str(late.config.exception())
        files.call_when_read(lambda: files.__exit__(None, None, None))
        threads.pop()()
        read = files.take()
    assert read is not None
    assert read.asked == ()
    assert [each.name for each in read.config.result().groups] == [each.name for each in load_text(TEXT).groups]
