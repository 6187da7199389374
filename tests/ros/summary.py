"""The relay's last words, read back from its stderr."""

import re
from typing import NamedTuple


class InputSummary(NamedTuple):
    received: int
    matched: int
    unneeded: int
    dropped: dict[str, int]


class GroupSummary(NamedTuple):
    sets: int
    inputs: dict[str, InputSummary]


_GROUP = re.compile(r"(?P<group>\w+): (?P<sets>\d+) sets?$")
_INPUT = re.compile(
    r"(?P<group>\w+):   (?P<topic>/\S+): (?P<received>\d+) received, (?P<matched>\d+) in sets,"
    r"(?: (?P<unneeded>\d+) not needed \([^)]*\),)? (?P<dropped>\d+) dropped(?: \((?P<reasons>[^)]*)\))?(?:; .*)?$"
)


def read_summary(stderr: str) -> dict[str, GroupSummary]:
    """The summary by group; a group without one is absent."""
    groups: dict[str, GroupSummary] = {}
    for line in stderr.splitlines():
        if found := _GROUP.search(line):
            groups[found["group"]] = GroupSummary(int(found["sets"]), {})
        elif found := _INPUT.search(line):
            reasons = [one.rsplit(" ", 1) for one in (found["reasons"] or "").split(", ") if one]
            counts = {reason: int(count) for reason, count in reasons}
            assert sum(counts.values()) == int(found["dropped"])
            groups[found["group"]].inputs[found["topic"]] = InputSummary(
                int(found["received"]), int(found["matched"]), int(found["unneeded"] or 0), counts
            )
    return groups
