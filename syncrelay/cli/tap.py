"""`syncrelay tap [GROUP]`: each set and drop of a running relay, as it leaves."""

import json
import time
from argparse import Namespace
from collections.abc import Collection
from contextlib import closing
from typing import Any, Final

from syncrelay.cli.boundary import DONE, flush, put, remark
from syncrelay.cli.parser import Parser
from syncrelay.cli.relays import find_one, otherwise
from syncrelay.cli.stop import StopRequest
from syncrelay.config.wording import counted, did_you_mean, quoted
from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.explain import words
from syncrelay.printable import printable
from syncrelay.sync import DropReason
from syncrelay.top.client import Answer, NoAnswerError, OtherServerError
from syncrelay.top.tap import DropLine, SetLine, Tap, Told, read_line
from syncrelay.wakeup import Wakeup

# Each time costs the relay most of a millisecond, whatever it has to tell.
_ASKS_EVERY_S: Final = 0.25
_NS_PER_S: Final = 1_000_000_000
_WIDTH: Final = 120


def command(_parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay tap`."""
    relay = find_one(arguments.url, otherwise=otherwise(arguments.url))
    groups = [] if arguments.group is None else [arguments.group]
    _require_names(relay, groups, arguments.input)
    tap = Tap(relay.url, groups=groups, inputs=arguments.input, reasons=arguments.reason, drops=arguments.drops)
    woken = Wakeup()
    stop.defer()
    stop.wake_with(woken.set)
    with closing(tap):
        return follow(tap, relay.url, as_json=arguments.json, most=arguments.number, woken=woken, stop=stop)


def follow(tap: Tap, url: str, *, as_json: bool, most: int | None, woken: Wakeup, stop: StopRequest) -> int:
    """Print lines until so many are printed or a stop is requested. Raises SyncRelayError when the relay is gone."""
    printed = 0
    while not stop.requested:
        told = _read(tap, url)
        _say_lost(told)
        lines = told.lines if most is None else told.lines[: most - printed]
        for line in lines:
            put(json.dumps(line) if as_json else plain_line(line))
        flush()
        printed += len(lines)
        if printed == most:
            break
        if not told.more:
            woken.wait(_ASKS_EVERY_S)
    return DONE


def _read(tap: Tap, url: str) -> Told:
    try:
        return tap.read()
    except (NoAnswerError, OtherServerError) as error:
        raise SyncRelayError(f"the relay at {url} cannot be followed any more: {error}") from error


def _say_lost(told: Told) -> None:
    if told.lost is None:
        remark("sets and drops may be missing here: the relay was not asked for long, or has started anew")
    elif told.lost:
        # Which of them were wanted is not known any more.
        remark(f"lost {counted(told.lost, 'line')}: sets and drops of all groups left faster than they were read")


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


def _require_names(relay: Answer, groups: Collection[str], inputs: Collection[str]) -> None:
    """Refuse what the relay does not have; one that is just starting may not have told yet. Raises UsageError."""
    chosen = [group for group in relay.state.groups if not groups or group.name in groups]
    _require(groups, [group.name for group in relay.state.groups], "group")
    _require(inputs, dict.fromkeys(each.topic for group in chosen for each in group.inputs), "input")


def _require(asked: Collection[str], there: Collection[str], what: str) -> None:
    for name in asked:
        if there and name not in there:
            hint = did_you_mean(name, there) or f"; it has {', '.join(there)}"
            raise UsageError(printable(f"the relay has no {what} {quoted(name)}{hint}"))
