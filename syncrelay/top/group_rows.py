"""The list of groups: a line for each, below a heading."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rich.text import Text

from syncrelay.status import Level
from syncrelay.status.document import Group
from syncrelay.top import phrases
from syncrelay.top.names import fitted
from syncrelay.top.pieces import STYLES, line, sparkline
from syncrelay.top.view import Order

_LEVEL: Final = 7
_SETS: Final = 14
_FIGURE: Final = 10
_SPARKLINE: Final = 20
_FIXED: Final = _LEVEL + _SETS + 2 * _FIGURE
_SORTED: Final = "▾"
# Room for the reason in words; the names, latencies and sparklines get what is left beside it.
_REASON: Final = 18
_SENTENCE: Final = 40
_LEAST_NAME: Final = 10
_LAST: Final = "FINDING or SPANS"


@dataclass(frozen=True, slots=True)
class Columns:
    """The widths that vary; 0 leaves the latency or the sparklines out."""

    name: int
    latency: int
    sparkline: int
    reason: int


def columns_of(groups: Sequence[Group], width: int) -> Columns:
    """Divide a line of this width between names, figures and reasons."""
    longest = max((len(group.name) for group in groups), default=0)
    latency = _FIGURE if width >= _FIXED + _LEAST_NAME + _REASON else 0
    fixed = _FIXED - _FIGURE + latency
    name = min(max(8, longest) + 2, max(_LEAST_NAME, width - fixed - _REASON))
    left = width - fixed - name
    drawn = _SPARKLINE if left >= 2 * (_SPARKLINE + 2) + _SENTENCE else 0
    return Columns(name, latency, drawn, max(0, left - 2 * (drawn + 2) if drawn else left))


def heading(columns: Columns, order: Order) -> Text:
    """Draw the names of the columns; the one that groups are sorted by is marked."""
    name = "GROUP" + _SORTED * (order is Order.NAME)
    level = "STATE" + _SORTED * (order is Order.WORST)
    drawn = f"{'SPANS':<{columns.sparkline + 2}}{'LATENCIES':<{columns.sparkline + 2}}" if columns.sparkline else ""
    last = "FINDING" if columns.sparkline or columns.reason < len(_LAST) else _LAST
    latency = f"{'LAT. p95':<{columns.latency}}" if columns.latency else ""
    figures = f"{level:<{_LEVEL}}{'SETS/s':<{_SETS}}{'SPAN p95':<{_FIGURE}}{latency}"
    return line((f"{name:<{columns.name}}{figures}{drawn}{last}", "bold"))


def row(group: Group, columns: Columns) -> Text:
    """Draw a group."""
    drawn = [each.span_ms for each in group.last_sets], [each.latency_ms for each in group.last_sets]
    return line(
        (f"{fitted(group.name, columns.name - 1):<{columns.name}}", "bold"),
        (f"{group.level.name:<{_LEVEL}}", STYLES[group.level]),
        f"{phrases.sets_of_possible(group):<{_SETS}}",
        f"{phrases.duration(group.span_ms.p95 if group.span_ms else None):<{_FIGURE}}",
        f"{phrases.duration(group.latency_ms.p95 if group.latency_ms else None):<{_FIGURE}}" if columns.latency else "",
        *(f"{sparkline(values, columns.sparkline)}  " for values in drawn if columns.sparkline),
        _reason(group, columns),
    )


def _reason(group: Group, columns: Columns) -> Text:
    """Say what is wrong, by its code where there is no room for the sentence; draw spans where all is well."""
    finding = group.explanation
    if columns.sparkline:
        text = finding.text if finding else ""
    elif group.level is Level.OK or finding is None:
        text = sparkline([each.span_ms for each in group.last_sets], max(0, columns.reason - 1))
    else:
        text = finding.label
    reason = Text(text)
    reason.truncate(columns.reason, overflow="ellipsis")
    return reason
