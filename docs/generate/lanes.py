"""A group's messages and sets on a line of time as SVG: the lanes of the report, small and without a script."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import syncrelay.status
from syncrelay.recordings.analysis import GroupAnalysis
from syncrelay.recordings.analysis.html.lanes import Lanes, lanes_of
from syncrelay.status.fates import FATES

_SECOND: Final = 1_000_000_000
_ALL: Final = 1_000_000
_WIDTH, _MARGIN = 460, 12
_HEADING, _LANE, _NAME, _MARK, _LEGEND = 28, 42, 12, 28, 30
_KEY: Final = 106
_COLOURS: Final = (Path(syncrelay.status.__file__).parent / "page" / "colours.css").read_text()


class Panel(NamedTuple):
    """What stands above the lanes of a group, and the group."""

    heading: str
    group: GroupAnalysis


def picture(panels: Sequence[Panel], *, begin: int, window: tuple[float, float]) -> str:
    """Return some seconds (from, for) of a recording that begins at `begin`, as each panel's group matched them."""
    from_ns, lasts_ns = (round(each * _SECOND) for each in window)
    lines: list[str] = []
    seen: set[int] = set()
    top = _MARGIN
    for heading, group in panels:
        lanes = lanes_of(group, begin, most=_ALL)
        lines.append(f'<text class="head" x="{_MARGIN}" y="{top + 14}">{heading}</text>')
        drawing = _Drawing(lanes, from_ns, lasts_ns, top + _HEADING)
        lines += [*drawing.sets(), *drawing.marks(seen)]
        top += _HEADING + len(lanes.lanes) * _LANE
    lines += _legend(sorted(seen), top + _LEGEND // 2)
    shapes = "".join(
        f'<path id="{FATES[code].name}" class="shape fate-{FATES[code].name} '
        f'{"filled" if FATES[code].is_filled else "stroked"}" d="{FATES[code].path}"/>'
        for code in sorted(seen)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH}" height="{top + _LEGEND}" '
        f'viewBox="0 0 {_WIDTH} {top + _LEGEND}">\n'
        f"<style>{_COLOURS}"
        "text { font: 13px ui-monospace, monospace; fill: var(--ink); stroke: var(--paper); stroke-width: 4;"
        " paint-order: stroke; }\n.head { font-weight: 600; }\n"
        ".joint { stroke: var(--matched); stroke-opacity: .55; stroke-width: 2; fill: none; }</style>\n"
        f'<defs>{shapes}</defs>\n<rect width="100%" height="100%" rx="6" fill="var(--paper)"/>\n'
        + "\n".join(lines)
        + "\n</svg>\n"
    )


class _Drawing:
    def __init__(self, lanes: Lanes, begin: int, lasts: int, top: int) -> None:
        self._lanes = lanes
        self._begin, self._lasts, self._top = begin, lasts, top

    def _x(self, time: int) -> float:
        return round(_MARGIN + (time - self._begin) / self._lasts * (_WIDTH - 2 * _MARGIN), 1)

    def _y(self, lane: int) -> int:
        return self._top + lane * _LANE + _MARK

    def _is_shown(self, time: int) -> bool:
        return self._begin <= time <= self._begin + self._lasts

    def marks(self, seen: set[int]) -> list[str]:
        """Return the topics and their messages; adds the codes of their fates to those that were seen."""
        lines = []
        for at, lane in enumerate(self._lanes.lanes):
            lines.append(f'<text x="{_MARGIN}" y="{self._top + at * _LANE + _NAME}">{lane.topic}</text>')
            for time, fate in zip(lane.times.tolist(), lane.fates.tolist(), strict=True):
                if self._is_shown(time):
                    seen.add(fate)
                    lines.append(f'<use href="#{FATES[fate].name}" x="{self._x(time)}" y="{self._y(at)}"/>')
        return lines

    def sets(self) -> list[str]:
        """Return a line through the messages of each set that is shown whole."""
        lines = []
        for members in self._lanes.members.tolist():
            there = [(lane, place) for lane, place in enumerate(members) if place >= 0]
            times = [(lane, int(self._lanes.lanes[lane].times[place])) for lane, place in there]
            if all(self._is_shown(time) for _, time in times):
                points = " ".join(f"{self._x(time)},{self._y(lane)}" for lane, time in times)
                lines.append(f'<polyline class="joint" points="{points}"/>')
        return lines


def _legend(codes: Sequence[int], y: int) -> list[str]:
    lines = []
    for place, code in enumerate(codes):
        x = _MARGIN + 6 + place * _KEY
        lines.append(f'<use href="#{FATES[code].name}" x="{x}" y="{y}"/>')
        lines.append(f'<text x="{x + 10}" y="{y + 4}">{FATES[code].word}</text>')
    return lines
