"""`syncrelay tap [GROUP]`: each set and drop of a running relay, as it leaves."""

import json
from argparse import Namespace
from collections.abc import Collection
from contextlib import closing
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import DONE, flush, put, remark
from syncrelay.cli.parser import Parser, count
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.printable import printable
from syncrelay.sync.messages import DropReason

if TYPE_CHECKING:
    from syncrelay.top.tap import TapAnswer

# Each time costs the relay most of a millisecond, whatever it has to tell.
_ASKS_EVERY_S: Final = 0.25


def parser() -> Parser:
    parser = Parser(
        "syncrelay tap",
        example="syncrelay tap front --reason late",
        description="Prints each set and each dropped message of a running relay as it leaves, a line each, until "
        "Ctrl-C. It subscribes to nothing: the relay tells it over HTTP. For each set it shows how much later "
        "than the earliest stamp each input's stamp is, offsets included. The relay never waits: a reader that is too "
        "slow loses lines and is told how many.",
    )
    parser.add_argument("group", metavar="GROUP", nargs="?", help="print this group only")
    parser.add_argument("--url", metavar="URL", help="which relay, if there are several: its host, host:port or URL")
    parser.add_argument("--json", action="store_true", help="print lines of JSON, as replay does")
    parser.add_argument("--drops", action="store_true", help="print dropped messages only")
    parser.add_repeatable("--input", metavar="TOPIC", help="print only sets and drops of TOPIC")
    parser.add_repeatable(
        "--reason",
        metavar="REASON",
        choices=tuple(each.value for each in DropReason),
        help="print messages dropped for this reason, such as late or overflow",
    )
    parser.add_argument("-n", "--number", metavar="N", type=count, help="end after N lines")
    return parser


def command(_parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay tap`: print lines until so many are printed or a stop is requested.

    Raises SyncRelayError when the relay is gone.
    """
    from syncrelay.cli.relays import find_one, otherwise
    from syncrelay.top.client import NoAnswerError, OtherServerError
    from syncrelay.top.tap import Tap, plain_line
    from syncrelay.wakeup import Wakeup

    relay = find_one(arguments.url, otherwise=otherwise(arguments.url))
    groups = [] if arguments.group is None else [arguments.group]
    # One that is just starting may not have told its groups yet.
    chosen = [group for group in relay.status.groups if not groups or group.name in groups]
    _require(groups, [group.name for group in relay.status.groups], "group")
    _require(arguments.input, dict.fromkeys(each.topic for group in chosen for each in group.inputs), "input")
    woken = Wakeup()
    stop.defer()
    stop.wake_with(woken.set)
    printed = 0
    with closing(
        Tap(relay.url, groups=groups, inputs=arguments.input, reasons=arguments.reason, drops=arguments.drops)
    ) as tap:
        while not stop.requested:
            try:
                told = tap.read()
                lines = [json.dumps(line) if arguments.json else plain_line(line) for line in told.lines]
            except (NoAnswerError, OtherServerError) as error:
                raise SyncRelayError(f"the relay at {relay.url} cannot be followed any more: {error}") from error
            _say_lost(told)
            lines = lines if arguments.number is None else lines[: arguments.number - printed]
            for line in lines:
                put(line)
            flush()
            printed += len(lines)
            if printed == arguments.number:
                break
            if not told.more:
                woken.wait(_ASKS_EVERY_S)
    return DONE


def _say_lost(answer: "TapAnswer") -> None:
    from syncrelay.config.wording import counted

    if answer.lost is None:
        remark("sets and drops may be missing here: the relay was not asked for long, or has started anew")
    elif answer.lost:
        # Which of them were wanted is not known any more.
        remark(f"lost {counted(answer.lost, 'line')}: sets and drops of all groups left faster than they were read")


def _require(asked: Collection[str], there: Collection[str], what: str) -> None:
    """Raise UsageError for what a relay does not have."""
    from syncrelay.config.wording import did_you_mean, quoted

    for name in asked:
        if there and name not in there:
            hint = did_you_mean(name, there) or f"; it has {', '.join(there)}"
            raise UsageError(printable(f"the relay has no {what} {quoted(name)}{hint}"))
