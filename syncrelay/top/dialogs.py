"""The screen to choose a relay from, and the one that explains the keys."""

from collections.abc import Sequence
from typing import ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import ModalScreen, Screen
from textual.widgets import Footer, Static

from syncrelay.top.client import Answer
from syncrelay.top.pieces import line
from syncrelay.top.rows import Rows

_KEYS: Final = (
    ("up, down, k, j", "select a group; in a group, scroll"),
    ("home, end, page up, page down", "the same, farther"),
    ("enter", "open the selected group"),
    ("left, right, p, n", "in a group: the one before, the next"),
    ("escape, backspace", "back to the groups, or to the list of relays"),
    ("space", "freeze the screen, and go on"),
    ("s", "sort: worst first, as in the file, by name"),
    ("/", "show the groups that hold a text; escape shows all"),
    ("q, ctrl-c", "quit"),
)
_MEANINGS: Final = (
    ("SETS/s", "sets a second, out of those that the slowest input allows"),
    ("SPAN", "from the oldest to the newest stamp of a set"),
    ("LAT.", "latency: from the last message of a set until it is published"),
    ("LAG", "time of receipt minus stamp, median"),
    ("JITTER", "how far the time between stamps strays from its median, p95"),
)


class RelaysScreen(Screen[None]):
    """A list of the relays that were found."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("question_mark", "app.keys", "Keys", key_display="?"),
        Binding("q", "app.quit", "Quit"),
    ]

    def __init__(self, relays: Sequence[Answer]) -> None:
        super().__init__()
        self._relays = {answer.url: answer for answer in relays}

    def compose(self) -> ComposeResult:
        """Lay out a line for each relay."""
        yield Static(f"{len(self._relays)} relays answer. Which one?\n", id="title")
        yield Rows({url: _relay(answer) for url, answer in self._relays.items()})
        yield Footer()


def _relay(answer: Answer) -> Text:
    names = ", ".join(group.name for group in answer.status.groups)
    return line((answer.status.relay.node, "bold"), f"  {answer.url}  groups: {names}")


class KeysScreen(ModalScreen[None]):
    """Explains keys and columns until any key is pressed."""

    def compose(self) -> ComposeResult:
        """Lay out one text."""
        keys = [line((f"{key:<30}", "bold"), does) for key, does in _KEYS]
        meanings = [line((f"{name:<8}", "bold"), means) for name, means in _MEANINGS]
        back = line(("press any key to go back", "dim"))
        yield Static(Text("\n").join([*keys, Text(""), *meanings, Text(""), back]), id="keys")

    def on_key(self) -> None:
        """Go back."""
        self.dismiss()

    def on_click(self) -> None:
        """Go back."""
        self.dismiss()
