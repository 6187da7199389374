"""What `syncrelay tap` prints of a set or a drop for people."""

import time
from typing import Any, Final

from syncrelay.explain import words
from syncrelay.sync import DropReason
from syncrelay.top.tap import DropLine, SetLine, read_line

_NS_PER_S: Final = 1_000_000_000
_WIDTH: Final = 120


def plain_line(line: dict[str, Any]) -> str:
    """Say a line in words: of a set how much later than the earliest each stamp is, with the inputs' offsets."""
    read = read_line(line)
    seconds, rest = divmod(read.time, _NS_PER_S)
    when = f"{time.strftime('%H:%M:%S', time.localtime(seconds))}.{rest // 1_000_000:03}"
    begin = f"{when} {read.group}:"
    return f"{begin} {_of_set(read)}" if isinstance(read, SetLine) else _of_drop(begin, read)


def _of_set(line: SetLine) -> str:
    matched = {
        topic: None if stamp is None else stamp + line.offsets.get(topic, 0) for topic, stamp in line.stamps.items()
    }
    first = min((stamp for stamp in matched.values() if stamp is not None), default=0)
    inputs = ", ".join(f"{topic} {_after(stamp, first)}" for topic, stamp in matched.items())
    return f"set, span {words.duration(line.span)}, latency {words.duration(line.latency)}: {inputs}"


def _after(stamp: int | None, first: int) -> str:
    return "missing" if stamp is None else f"+{words.duration(stamp - first)}"


def _of_drop(begin: str, line: DropLine) -> str:
    """Say what the reason means where that fits."""
    meaning = {each.value: f" ({each.meaning})" for each in DropReason}.get(line.reason, "")
    waited = f" after {words.duration(line.time - line.received)}"
    if line.unneeded:
        return f"{begin} drop, {line.topic} not needed ({line.reason}){waited}"
    what = f"{begin} drop, {line.topic} {line.reason}"
    return f"{what}{meaning if len(what + meaning + waited) <= _WIDTH else ''}{waited}"
