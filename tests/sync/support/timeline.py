"""A drawn case: what arrives when, and what leaves because of it.

    lidar  |ab.c
    camera |..BC
    -> B: bB, a superseded
    -> C: cC

A column is a tick of 10 ms, of stamps and of the clock: messages arrive by column, top row first, each at
the moment of its stamp. Rows of one label are one input: two messages of one stamp need two rows.
`arrive: a B b` gives another order of arrival; the clock then follows the newest column so far.
`-> B:` is what leaves when B arrives, `-> @7:` what leaves by `expire` at column 7. A set is its letters,
`-` where an input is missing; a drop is a letter and its reason. `keys: aA bB` gives letters common keys.
"""

from dataclasses import dataclass, replace

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


def parse(drawing):
    labels, drawn, expected, order, keys = [], {}, [], None, {}
    width = 0
    for line in (line.strip() for line in drawing.strip().splitlines()):
        if line.startswith("->"):
            expected.append(line.removeprefix("->").strip())
        elif line.startswith("arrive:"):
            order = line.removeprefix("arrive:").split()
        elif line.startswith("keys:"):
            keys = {letter: same for same in line.removeprefix("keys:").split() for letter in same}
        else:
            label, row = (part.strip() for part in line.split("|"))
            if label not in labels:
                labels.append(label)
            width = max(width, len(row))
            for column, letter in enumerate(row):
                if letter != ".":
                    assert letter not in drawn, f"{letter} is drawn twice"
                    drawn[letter] = (column, Message(labels.index(label), stamp(column), letter, key=letter))
    for letter, key in keys.items():
        column, message = drawn[letter]
        drawn[letter] = column, replace(message, key=key)
    letters = order or sorted(drawn, key=lambda letter: (drawn[letter][0], drawn[letter][1].input))
    assert sorted(letters) == sorted(drawn), "arrive: must name each letter once"
    arrivals, newest = [], 0
    for letter in letters:
        newest = max(newest, drawn[letter][0])
        arrivals.append((newest, drawn[letter][1]))
    return Timeline(tuple(arrivals), width, tuple(expected))


def told(outcome):
    if isinstance(outcome, Match):
        return "".join("-" if message is None else message.payload for message in outcome.messages)
    assert isinstance(outcome, Drop)
    return f"{outcome.message.payload} {outcome.reason.value}"


def play_policy(policy, drawing):
    """Feed the drawing to a policy: (what left, what was drawn to leave)."""
    timeline = parse(drawing)
    lines = []
    for _, message in timeline.arrivals:
        outcomes = policy.add(message)
        if outcomes:
            lines.append(f"{message.payload}: " + ", ".join(map(told, outcomes)))
    return tuple(lines), timeline.expected


def play_group(group, drawing, raw_stamp=lambda message: message.stamp):
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
            note(message.payload, group.add(replace(message, stamp=raw_stamp(message)), now=stamp(column)))
    return tuple(lines), timeline.expected
