"""Sets and drops as lines of JSON, for programs. All times and durations are nanoseconds."""

import json
from collections.abc import Sequence
from itertools import compress
from operator import add
from typing import Final

from syncrelay.config import GroupConfig
from syncrelay.explain.report import RecentDrop

# No name is this: it stands where a number will.
_HOLE: Final = "\0"


class GroupLines:
    """Writes the sets and drops of a group. `topics` are the inputs' full names.

    A relay that is tapped writes thousands a second, so what does not change from line to line is written once.
    """

    def __init__(self, group: GroupConfig, topics: Sequence[str]) -> None:
        self.group: Final = group
        self.topics: Final = topics
        self._offsets = tuple(topic.offset_ns for topic in group.topics)
        self._complete = (True,) * len(topics)
        self._forms: dict[tuple[bool, ...], str] = {}

    def of_set(self, stamps: Sequence[int | None], *, left: int, received: int) -> str:
        """Return the line of a set; `received` is when its last message was.

        `stamps` are as they came; they are matched with the `offsets` of the inputs that have one, and `span` is that
        of the sums. `latency` is how long the set waited since its last message was received.
        """
        there = [stamp for stamp in stamps if stamp is not None]
        kept = self._complete if len(there) == len(stamps) else tuple([stamp is not None for stamp in stamps])
        form = self._forms.get(kept)
        if form is None:
            form = self._forms[kept] = self._form(kept)
        matched = [*map(add, there, compress(self._offsets, kept))]
        return form % (left, *there, max(matched) - min(matched), left - received)

    def of_drop(self, drop: RecentDrop, *, left: int, received: int) -> str:
        """Return the line of a message that leaves unmatched, as `of_set` does; `unneeded` only where that is known."""
        line = {
            "group": self.group.name,
            "time": left,
            "topic": self.topics[drop.input],
            "stamp": drop.stamp,
            "received": received,
            "reason": drop.reason.value,
        }
        return json.dumps(line if drop.unneeded is None else {**line, "unneeded": drop.unneeded})

    def _form(self, kept: Sequence[bool]) -> str:
        """Return the line of every set that has these inputs, with `%d` for each number."""
        names = self.topics
        line = {
            "group": self.group.name,
            "time": _HOLE,
            "stamps": {name: _HOLE if is_there else None for name, is_there in zip(names, kept, strict=True)},
            "offsets": {name: offset for name, offset in zip(names, self._offsets, strict=True) if offset},
            "span": _HOLE,
            "latency": _HOLE,
            "missing": [name for name, is_there in zip(names, kept, strict=True) if not is_there],
        }
        return json.dumps(line).replace("%", "%%").replace(json.dumps(_HOLE), "%d")
