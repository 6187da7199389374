"""Where the boxes of a drawing stand: inputs to the left, groups in the middle, each group's outputs to its right."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from syncrelay.cli.graph.drawing import Box, Drawing

CHARACTER: Final = 7.9
"""The width of one, at most: of monospace fonts at 13 px."""
LINE: Final = 18.0
PADDING: Final = 10.0
MARGIN: Final = 20.0
_TITLE: Final = 34.0
_BETWEEN_BOXES: Final = 14.0
_BETWEEN_GROUPS: Final = 34.0
_BETWEEN_COLUMNS: Final = 70.0
# Of a link's label, which is set smaller.
_SMALL: Final = 6.8
_WIDEST: Final = 38
"""Characters of a line; longer ones are broken."""


@dataclass(frozen=True, slots=True)
class Placed:
    """A box with its lines as they are broken; of them the first `names` are its name, the last `found` its finding."""

    box: Box
    lines: tuple[str, ...]
    names: int
    found: int
    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """Its right edge."""
        return self.x + self.width

    @property
    def middle(self) -> float:
        """Half its height."""
        return self.y + self.height / 2


@dataclass(frozen=True, slots=True)
class Line:
    """A line between two boxes, from left to right; level at its end for `level` pixels, where its label stands."""

    start: tuple[float, float]
    end: tuple[float, float]
    level: float = 0.0
    label: str = ""
    is_dashed: bool = False


@dataclass(frozen=True, slots=True)
class Layout:
    """A drawing with its places, in pixels."""

    width: float
    height: float
    boxes: tuple[Placed, ...]
    groups: tuple[Placed, ...]
    lines: tuple[Line, ...]


def layout_of(drawing: Drawing) -> Layout:
    """Return where everything stands. Inputs stand near the groups that use them."""
    labels = max((len(link.label) for group in drawing.groups for link in group.links), default=0)
    left = MARGIN
    level = labels * _SMALL
    middle = left + _width(drawing.inputs) + _BETWEEN_COLUMNS + level
    groups_width = _width([group.box for group in drawing.groups])
    right = middle + groups_width + _BETWEEN_COLUMNS
    outputs_width = _width([output for group in drawing.groups for output in group.outputs])
    groups: list[Placed] = []
    outputs: list[Placed] = []
    lines: list[Line] = []
    wanted: dict[int, list[float]] = {}
    y = MARGIN + _TITLE
    for group in drawing.groups:
        stack = list(_stack(group.outputs, x=right, y=y, width=outputs_width))
        least = (len(group.links) + 1) * LINE
        box = _placed(group.box, x=middle, y=y, width=groups_width, least=least)
        block = max(box.height, stack[-1].y + stack[-1].height - y if stack else 0.0)
        box = _moved(box, y + (block - box.height) / 2)
        stack = [_moved(each, each.y + (block - (stack[-1].y + stack[-1].height - y)) / 2) for each in stack]
        for link, port in zip(group.links, _ports(box, len(group.links)), strict=True):
            wanted.setdefault(link.input, []).append(port)
        lines += [
            Line((box.right, port), (each.x, each.middle))
            for each, port in zip(stack, _ports(box, len(stack)), strict=True)
        ]
        groups.append(box)
        outputs += stack
        y += block + _BETWEEN_GROUPS
    inputs = _inputs(drawing.inputs, wanted, x=left)
    for group, box in zip(drawing.groups, groups, strict=True):
        # From above to below as the inputs stand, so that fewer lines cross.
        links = sorted(group.links, key=lambda link: inputs[link.input].y)
        for link, port in zip(links, _ports(box, len(links)), strict=True):
            start = inputs[link.input]
            lines.append(Line((start.right, start.middle), (box.x, port), level, link.label, link.is_dashed))
    boxes = (*inputs.values(), *outputs)
    bottom = max(each.y + each.height for each in (*boxes, *groups))
    return Layout(right + outputs_width + MARGIN, bottom + MARGIN, boxes, tuple(groups), tuple(lines))


def _inputs(boxes: Sequence[Box], wanted: dict[int, list[float]], *, x: float) -> dict[int, Placed]:
    """Place inputs at the mean height of where their lines lead, and below each other where that is too near."""
    means = {index: sum(heights) / len(heights) for index, heights in wanted.items()}
    order = sorted(means, key=lambda index: (means[index], index))
    width = _width(boxes)
    placed = {index: _placed(boxes[index], x=x, y=0.0, width=width) for index in order}
    tops = [means[index] - placed[index].height / 2 for index in order]
    for above, below in pairwise(range(len(order))):
        tops[below] = max(tops[below], tops[above] + placed[order[above]].height + _BETWEEN_BOXES)
    # Those that had to make room went down only: as many are to stand too high as too low.
    shift = sum(means[index] - placed[index].height / 2 - top for index, top in zip(order, tops, strict=True))
    shift = max(shift / len(order), MARGIN + _TITLE - tops[0])
    return {index: _moved(placed[index], top + shift) for index, top in zip(order, tops, strict=True)}


def _stack(boxes: Sequence[Box], *, x: float, y: float, width: float) -> Iterator[Placed]:
    for box in boxes:
        placed = _placed(box, x=x, y=y, width=width)
        yield placed
        y += placed.height + _BETWEEN_BOXES


def _ports(box: Placed, count: int) -> list[float]:
    """Return the heights at which lines meet a side of a box."""
    return [box.y + box.height * (index + 1) / (count + 1) for index in range(count)]


def _placed(box: Box, *, x: float, y: float, width: float, least: float = 0.0) -> Placed:
    name, told, found = _broken(box)
    lines = (*name, *told, *found)
    height = max(least, len(lines) * LINE + 2 * PADDING - 4)
    return Placed(box, lines, len(name), len(found), x, y, width, height)


def _moved(placed: Placed, y: float) -> Placed:
    return Placed(placed.box, placed.lines, placed.names, placed.found, placed.x, y, placed.width, placed.height)


def _width(boxes: Sequence[Box]) -> float:
    lines = (line for box in boxes for part in _broken(box) for line in part)
    return max((len(line) for line in lines), default=0) * CHARACTER + 2 * PADDING


def _broken(box: Box) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return name, what is told and finding, in lines that are not too wide."""
    told = tuple(part for line in box.lines for part in broken(line))
    return tuple(broken(box.name)), told, tuple(broken(box.finding)) if box.finding else ()


def broken(text: str) -> Iterator[str]:
    """Yield the lines of a text: broken after a space, else before a slash of a topic's name, else anywhere."""
    while len(text) > _WIDEST:
        head = text[:_WIDEST]
        places = (head.rfind(" ") + 1, head.rfind("/"), _WIDEST)
        at = next(place for place in places if place > _WIDEST // 3)
        yield text[:at].rstrip()
        text = text[at:]
    yield text
