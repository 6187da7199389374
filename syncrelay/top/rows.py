"""A list of lines to select one from."""

from collections.abc import Mapping
from typing import ClassVar, Final

from rich.text import Text
from textual import on
from textual.binding import Binding, BindingType
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from syncrelay.top.pieces import line

MARK_WIDTH: Final = 2
_MARK: Final = "▶"


class Rows(OptionList):
    """A list of lines by name. The selected one is marked and reversed; j and k move as the arrows do."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "select", "Open"),
        Binding("j", "cursor_down", "Down", show=False),
        Binding("k", "cursor_up", "Up", show=False),
    ]

    def __init__(self, lines: Mapping[str, Text] | None = None) -> None:
        super().__init__(id="rows", compact=True)
        self._rows: dict[str, Text] = {}
        if lines:
            self.show(lines)

    @property
    def selected(self) -> str | None:
        """The name of the selected line."""
        return self.highlighted_option.id if self.highlighted_option else None

    def show(self, lines: Mapping[str, Text]) -> None:
        """Show these lines; the selected name stays selected, and the list stays where it is scrolled to."""
        selected = self.selected
        was, self._rows = list(self._rows), dict(lines)
        if was != list(lines):
            self.set_options(Option("", id=name) for name in lines)
            at = list(lines).index(selected) if selected is not None and selected in lines else 0
            self.highlighted = at if lines else None
        self._draw()

    @on(OptionList.OptionHighlighted)
    def _draw(self) -> None:
        for index, (name, text) in enumerate(self._rows.items()):
            self.replace_option_prompt_at_index(
                index, self._marked(text) if name == self.selected else line("  ", text)
            )

    def _marked(self, text: Text) -> Text:
        marked = line(f"{_MARK:<{MARK_WIDTH}}", text)
        marked.pad_right(max(0, self.size.width - marked.cell_len))
        marked.stylize("reverse")
        return marked
