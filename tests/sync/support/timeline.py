"""Plays what is drawn; see syncrelay.recordings.cases.drawing for what is drawn how.

A column is a tick of 10 ms.
"""

from dataclasses import dataclass, replace

from syncrelay.recordings.cases.drawing import parse as parse_drawing
from syncrelay.sync import Drop, Match, Message

TICK_NS = 10_000_000
START_NS = 5_000_000_000


def stamp(column):
    return START_NS + column * TICK_NS


@dataclass(frozen=True)
class Timeline:
    arrivals: tuple
    """(column of the clock, Message) in order of arrival; the payload is the letter."""
    last_column: int
    expected: tuple
    """The lines after `->`, in order."""


def parse(text):
    drawing = parse_drawing(text)
    assert drawing.faults == []
    drawn = {
        letter: (mark.column, Message(drawing.labels.index(mark.label), stamp(mark.column), letter, key=letter))
        for letter, mark in drawing.marks.items()
    }
    for letter, key in drawing.keys.items():
        column, message = drawn[letter]
        drawn[letter] = column, replace(message, key=key)
    letters = drawing.order or sorted(drawn, key=lambda letter: (drawn[letter][0], drawn[letter][1].input))
    arrivals, newest = [], 0
    for letter in letters:
        newest = max(newest, drawn[letter][0])
        arrivals.append((newest, drawn[letter][1]))
    return Timeline(tuple(arrivals), drawing.width, tuple(drawing.expected))


def told(outcome):
    if isinstance(outcome, Match):
        return "".join("-" if message is None else message.payload for message in outcome.messages)
    assert isinstance(outcome, Drop)
    return f"{outcome.message.payload} {outcome.reason.value}"


def play_group(group, drawing):
    """Feed the drawing to a group whose driver meets every deadline: (what left, what was drawn to leave)."""
    timeline = parse(drawing)
    lines = []

    def note(moment, outcomes):
        if outcomes:
            lines.append(f"{moment}: " + ", ".join(map(told, outcomes)))

    arrivals = list(timeline.arrivals)
    for column in range(timeline.last_column):
        while (deadline := group.next_deadline()) is not None and deadline <= stamp(column):
            note(f"@{column}", group.expire(now=stamp(column)))
        while arrivals and arrivals[0][0] == column:
            message = arrivals.pop(0)[1]
            note(message.payload, group.add(message, now=stamp(column)))
    return tuple(lines), timeline.expected
