"""The application: asks a relay once a second, on a thread, and holds what the screens show."""

import asyncio
import os
import select
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event, Thread
from typing import ClassVar, Final

from textual import on, work
from textual.app import App
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.reactive import reactive
from textual.widgets import OptionList
from textual.worker import get_current_worker

from syncrelay.errors import SyncRelayError
from syncrelay.top.client import Answer, NoAnswerError, OtherServerError, ask
from syncrelay.top.dialogs import KeysScreen, RelaysScreen
from syncrelay.top.screens import GroupsScreen
from syncrelay.top.view import Order, View

_PERIOD_S: Final = 1.0


class EndedError(SyncRelayError):
    """The watched process has ended and will not come back."""


class Heard(Message):
    """The answer of a relay, or why there was none."""

    def __init__(self, url: str, heard: Answer | SyncRelayError) -> None:
        super().__init__()
        self.url, self.heard = url, heard


def end_with_terminal() -> None:
    """From now on, end the process at once when its terminal is gone.

    SIGHUP is not enough: a process started by nohup or a CI runner ignores it, and it may arrive before its handler is
    installed.
    """
    polled = select.poll()
    polled.register(sys.stderr.fileno(), 0)

    def end() -> None:
        polled.poll()
        os._exit(128 + signal.SIGHUP)

    Thread(target=end, name="terminal", daemon=True).start()


class TopApp(App[None]):
    """Watches a relay; if several were found, the one that the user chooses.

    `source` returns the answer of the relay at a URL and is called on a thread. It raises NoAnswerError or
    OtherServerError if there is none, and EndedError to end the application. `failure` is the bug that ended it.
    """

    CSS_PATH = Path(__file__).parent / "top.tcss"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [Binding("ctrl+c", "quit", "Quit", show=False, priority=True)]

    view: reactive[View | None] = reactive(None)
    order: reactive[Order] = reactive(Order.WORST)

    def __init__(
        self, relays: Sequence[Answer], *, source: Callable[[str], Answer] = ask, period_s: float = _PERIOD_S
    ) -> None:
        # The terminal's own colours; set before anything is drawn, so that NO_COLOR means none at all.
        super().__init__(ansi_color=True)
        self.theme = "ansi-dark"
        self.failure: Exception | None = None
        self._relays = tuple(relays)
        self._source = source
        self._period_s = period_s
        self._url = ""
        self._answered_at = 0.0
        self._latest: View | None = None
        self._ended = Event()

    def on_mount(self) -> None:
        """Show the only relay, or ask which one."""
        # Else a signal would end the process without restoring the terminal.
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self.exit)
        if len(self._relays) > 1:
            self.push_screen(RelaysScreen(self._relays))
        else:
            self._watch(self._relays[0])

    def on_unmount(self) -> None:
        """Let the thread end."""
        self._ended.set()

    def _watch(self, answer: Answer) -> None:
        self._url = answer.url
        self._answered_at = time.monotonic()
        self.view = self._latest = View(answer)
        self.push_screen(GroupsScreen())
        self._follow(answer.url)

    @work(thread=True, exclusive=True)
    def _follow(self, url: str) -> None:
        worker = get_current_worker()
        while not worker.is_cancelled and not self._ended.wait(self._period_s):
            try:
                heard: Answer | SyncRelayError = self._source(url)
            except (NoAnswerError, OtherServerError, EndedError) as error:
                heard = error
            self.post_message(Heard(url, heard))

    @on(Heard)
    def _take(self, event: Heard) -> None:
        if event.url != self._url or self._latest is None:
            return
        now = time.monotonic()
        if isinstance(event.heard, EndedError):
            self.exit()
        elif isinstance(event.heard, Answer):
            self._answered_at = now
            self._latest = View(event.heard)
        else:
            self._latest = View(self._latest.answer, str(event.heard), now - self._answered_at)
        if self.view is not None and not self.view.frozen:
            self.view = self._latest

    @on(OptionList.OptionSelected)
    def _chosen(self, event: OptionList.OptionSelected) -> None:
        if isinstance(self.screen, RelaysScreen):
            self._watch(next(answer for answer in self._relays if answer.url == event.option.id))

    def action_freeze(self) -> None:
        """Hold the screen still, or go on with the latest answer."""
        if self.view is None or self._latest is None:
            return
        if self.view.frozen:
            self.view = self._latest
        else:
            self.view = View(self.view.answer, self.view.trouble, self.view.quiet_s, frozen=True)

    def action_sort(self) -> None:
        """Sort the groups in the next order."""
        self.order = self.order.following()
        if isinstance(self.screen, GroupsScreen):
            self.screen.draw()

    def action_relays(self) -> None:
        """Go back to the list of relays, if there are several."""
        if len(self._relays) > 1:
            self._url = ""
            self.pop_screen()

    def action_keys(self) -> None:
        """Show what the keys do."""
        self.push_screen(KeysScreen())

    def _handle_exception(self, error: Exception) -> None:
        self.failure = error
        super()._handle_exception(error)

    def _fatal_error(self) -> None:
        # Textual's own prints all locals, whole statuses among them. The caller raises `failure`.
        self._close_messages_no_wait()
