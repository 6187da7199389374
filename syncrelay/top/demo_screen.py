"""The demo's screen: what `top` shows of a relay, and what a newcomer needs beside it."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Final

from rich.console import Group as Lines
from rich.text import Text

from syncrelay.explain import RecentDrop
from syncrelay.status.document import Group
from syncrelay.top import group_blocks, phrases
from syncrelay.top.pieces import line
from syncrelay.top.plain import DEMO, Moment
from syncrelay.top.strip import UNNEEDED, Window, letter_style, mark_of, newest_stamp

# Reports come once a second with what has left by then. The strip is drawn this much later, so that it moves steadily.
_DELAY_NS: Final = 1_250_000_000
# An input at 100 Hz has two messages in a column; a set of a group at 10 Hz has five columns for its letter and span.
_COLUMN_NS: Final = 20_000_000
# A report holds too few messages of a 100 Hz input to fill a wider strip.
_WIDEST_STRIP: Final = 65


def window_of(moment: Moment, width: int) -> Window:
    """Return what the strips of all groups show on a terminal of so many columns."""
    recent = chain.from_iterable(map(group_blocks.as_matched, moment.state.groups))
    head = min(moment.now - _DELAY_NS, newest_stamp(recent))
    return Window(head, min(width - group_blocks.LANE_LABEL - 2, _WIDEST_STRIP), _COLUMN_NS)


def frame(moment: Moment, *, width: int, height: int) -> Lines:
    """Draw a moment for a terminal of so many columns and lines; 80x24 shows all of two groups of two inputs."""
    groups = moment.state.groups
    window = window_of(moment, width)
    strips = [list(group_blocks.lanes(group, group_blocks.as_matched(group), window)) for group in groups]
    legend = list(_legend(groups, window, width))
    for draw in (_large_block, _block, _small_block):
        drawn = [list(draw(group, strip, width)) for group, strip in zip(groups, strips, strict=True)]
        blocks = [[_title(moment, width)], *drawn, legend]
        spare = height - sum(map(len, blocks))
        if spare >= 0:
            break
    # A blank line above each block but the title, above the last ones first, as far as there is room.
    above = [0, *(max(0, min(1, spare - index)) for index in reversed(range(len(blocks) - 1)))]
    lines = [each for blank, block in zip(above, blocks, strict=True) for each in (*[Text("")] * blank, *block)]
    return Lines(*lines[:height])


def _large_block(group: Group, strip: Sequence[Text], width: int) -> Iterator[Text]:
    yield group_blocks.title(group, width)
    yield from group_blocks.figures(group, width)
    yield from group_blocks.findings(group, width)
    yield from strip
    yield from group_blocks.inputs(group, width)


def _block(group: Group, strip: Sequence[Text], width: int) -> Iterator[Text]:
    yield from _small_block(group, strip, width)
    yield from group_blocks.inputs(group, width)


def _small_block(group: Group, strip: Sequence[Text], width: int) -> Iterator[Text]:
    yield group_blocks.title(group, width)
    if group.problems:
        yield from group_blocks.findings(group, width)
    else:
        yield group_blocks.rate_line(group, width)
        yield from group_blocks.offsets(group, width)
    yield from strip


def _title(moment: Moment, width: int) -> Text:
    clock = f"{moment.elapsed_s:.1f}" + (" s" if moment.total_s is None else f" / {moment.total_s:g} s")
    title = Text(DEMO, style="bold", no_wrap=True)
    title.truncate(width - len(clock) - 1, overflow="ellipsis", pad=True)
    return Text.assemble(title, " ", clock)


def _legend(groups: Sequence[Group], window: Window, width: int) -> Iterator[Text]:
    letters = Text(" ").join(Text(letter, letter_style(number)) for number, letter in enumerate("ABC"))
    yield line(letters, "  each letter is a set: messages matched by time and sent on together")
    drops = [each for group in groups for each in group_blocks.as_matched(group) if isinstance(each, RecentDrop)]
    occurred = {mark_of(each) for each in drops if window.column(each.stamp) is not None}
    # Always explained, as every newcomer meets it.
    yield from group_blocks.side_by_side(group_blocks.marks({UNNEEDED, *occurred}), width)
    column = phrases.duration(_COLUMN_NS / 1e6)
    yield line((f"a column is {column}, the newest is on the right; Ctrl-C ends it", "dim"))
