"""The screens of a relay: its groups, and one group."""

from collections.abc import Sequence
from itertools import chain
from typing import ClassVar, Final, Protocol, cast

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.events import Resize
from textual.screen import Screen
from textual.widgets import Footer, Input, OptionList, Static

from syncrelay.status.document import Group
from syncrelay.top import group_blocks
from syncrelay.top.group_rows import columns_of, heading, row
from syncrelay.top.pieces import line, screenful
from syncrelay.top.rows import MARK_WIDTH, Rows
from syncrelay.top.view import Order, View, holds, title

LEAST_WIDTH, LEAST_HEIGHT = 60, 15
# The rest is for the selected group.
_LIST_SHARE: Final = 0.6


class ShowsView(Protocol):
    """What screens need of the application."""

    view: View | None
    order: Order

    def action_relays(self) -> None:
        """Go back to the list of relays."""


class WatchScreen(Screen[None]):
    """Shows the application's view, and draws it again whenever it or the size of the terminal changes."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "app.freeze", "Freeze"),
        Binding("question_mark", "app.keys", "Keys", key_display="?"),
        Binding("q", "app.quit", "Quit"),
    ]

    def compose(self) -> ComposeResult:
        """Lay out the title and the keys."""
        yield Static(id="small")
        yield Static(id="title")
        yield from self.compose_body()
        yield Footer()

    def compose_body(self) -> ComposeResult:
        """Lay out what is between the title and the keys."""
        raise NotImplementedError

    def on_mount(self) -> None:
        """Follow the view."""
        self.watch(self.app, "view", self.draw)

    def on_screen_resume(self) -> None:
        """Show what changed while another screen was shown."""
        self.draw()

    def on_resize(self, event: Resize) -> None:
        """Draw for the new size, or say that it is too small."""
        width, height = event.size
        self.set_class(width < LEAST_WIDTH or height < LEAST_HEIGHT, "-small")
        self.query_one("#small", Static).update(
            f"This screen needs {LEAST_WIDTH}x{LEAST_HEIGHT}; this terminal has {width}x{height}."
        )
        self.draw()

    @property
    def shown(self) -> ShowsView:
        """The application."""
        return cast("ShowsView", self.app)

    def draw(self) -> None:
        """Draw the view if there is one and this screen is shown."""
        view = self.shown.view
        if view is None or not self.is_current or not self.size.width:
            return
        self.set_class(view.is_stale, "-stale")
        lines = title(view, self.size.width)
        self.query_one("#title", Static).update(screenful(lines, self.size.width))
        self.draw_body(view, height=self.size.height - len(lines) - 1)

    def draw_body(self, view: View, *, height: int) -> None:
        """Draw what is between the title and the keys, on `height` lines."""
        raise NotImplementedError


class GroupsScreen(WatchScreen):
    """The list of groups, and below it the selected one."""

    AUTO_FOCUS = "Rows"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("s", "app.sort", "Sort"),
        Binding("slash", "filter", "Filter", key_display="/"),
        Binding("escape,backspace", "back", "Relays", show=False),
    ]

    def compose_body(self) -> ComposeResult:
        """Lay out the list above and the selected group below."""
        yield Input(placeholder="a part of a name, topic, state or finding", id="filter", compact=True)
        yield Static(id="heading")
        yield Rows()
        yield Static(id="detail")

    def draw_body(self, view: View, *, height: int) -> None:
        """Draw the groups, and as much of the selected one as there is room for."""
        width = self.size.width
        sought = self.query_one(Input)
        height -= int(sought.display)
        groups = [group for group in view.groups(self.shown.order) if holds(group, sought.value)]
        listed = self.query_one(Rows)
        listed_lines = min(len(groups), max(3, int(height * _LIST_SHARE)))
        listed.styles.height = listed_lines
        # A scrollbar takes as much as the mark does.
        columns = columns_of(groups, width - 2 * MARK_WIDTH)
        self.query_one("#heading", Static).update(screenful([line("  ", heading(columns, self.shown.order))], width))
        listed.show({group.name: row(group, columns) for group in groups})
        left = height - 1 - listed_lines
        shown = view.group(listed.selected) if listed.selected else None
        lines = _summary(shown, width=width, height=left) if shown else []
        if sought.value and not groups:
            lines = [line(f"no group has {sought.value!r}; escape shows all")]
        self.query_one("#detail", Static).update(screenful(_clipped(lines, left), width))

    def on_mount(self) -> None:
        """Follow the view; what is sought is asked for by a key."""
        self.query_one(Input).display = False
        super().on_mount()

    def action_filter(self) -> None:
        """Ask which groups to show."""
        sought = self.query_one(Input)
        sought.display = True
        sought.focus()

    def action_back(self) -> None:
        """Show all groups again, or else go back to the list of relays."""
        sought = self.query_one(Input)
        if not sought.display:
            self.shown.action_relays()
            return
        sought.value, sought.display = "", False
        self.query_one(Rows).focus()
        self.draw()

    @on(Input.Changed)
    def _sought(self) -> None:
        self.draw()

    @on(Input.Submitted)
    def _found(self) -> None:
        self.query_one(Rows).focus()

    @on(OptionList.OptionHighlighted)
    def _selected(self) -> None:
        self.draw()

    @on(OptionList.OptionSelected)
    def _opened(self, event: OptionList.OptionSelected) -> None:
        self.app.push_screen(GroupScreen(event.option.id or ""))


def _summary(group: Group, *, width: int, height: int) -> list[Text]:
    lines = [
        group_blocks.title(group, width),
        *group_blocks.findings(group, width),
        *group_blocks.inputs(group, width),
        *group_blocks.figures(group, width),
    ]
    strip = [Text(""), *group_blocks.recent_sets(group, width)]
    # A strip is only of use as a whole.
    return [*lines, *strip] if len(lines) + len(strip) <= height else lines


def _clipped(lines: Sequence[Text], height: int) -> list[Text]:
    if len(lines) <= height:
        return list(lines)
    return [*lines[: max(0, height - 1)], line((f"… {len(lines) - height + 1} more lines: press enter", "dim"))]


class GroupScreen(WatchScreen):
    """All that is known of one group."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,backspace", "app.pop_screen", "Back"),
        Binding("left,p", "step(-1)", "Previous"),
        Binding("right,n", "step(1)", "Next"),
        Binding("j", "scroll('down')", "Down", show=False),
        Binding("k", "scroll('up')", "Up", show=False),
    ]

    def __init__(self, group: str) -> None:
        super().__init__()
        self._group = group

    def compose_body(self) -> ComposeResult:
        """Lay out one text that scrolls."""
        with VerticalScroll(id="scroll"):
            yield Static(id="group")

    def draw_body(self, view: View, *, height: int) -> None:  # noqa: ARG002  it scrolls
        """Draw all blocks of the group."""
        width = self.size.width - 2
        group = view.group(self._group)
        self.query_one("#group", Static).update(screenful(_all_of(group, self._group, width), width))

    def action_step(self, by: int) -> None:
        """Go to the next group or the one before, in the order of the list."""
        if self.shown.view is None:
            return
        names = [group.name for group in self.shown.view.groups(self.shown.order)]
        if names:
            at = names.index(self._group) if self._group in names else 0
            self._group = names[(at + by) % len(names)]
            self.query_one("#scroll").scroll_home(animate=False)
            self.draw()

    def action_scroll(self, direction: str) -> None:
        """Scroll by a line, as the arrows do."""
        scroll = self.query_one("#scroll")
        scroll.scroll_down() if direction == "down" else scroll.scroll_up()


def _all_of(group: Group | None, name: str, width: int) -> list[Text]:
    if group is None:
        return [line(f"The relay has no group {name} any more.")]
    blocks = [
        chain([group_blocks.title(group, width)], group_blocks.figures(group, width)),
        group_blocks.findings(group, width),
        group_blocks.inputs(group, width),
        group_blocks.recent_sets(group, width),
        group_blocks.connections(group, width),
    ]
    drawn = [lines for lines in map(list, blocks) if lines]
    return [each for lines in drawn for each in (*lines, Text(""))]
