"""`syncrelay observe`: try a file beside a running robot: subscribe, publish nothing, and tell what would have left."""

import json
import math
import shutil
import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say
from syncrelay.cli.new_file import write_suggested
from syncrelay.cli.parser import Parser, output, positive
from syncrelay.cli.stop import StopRequest
from syncrelay.collector import resting_collector
from syncrelay.errors import UsageError
from syncrelay.output_files import require_new

if TYPE_CHECKING:
    from syncrelay.config import Config
    from syncrelay.explain import GroupReport
    from syncrelay.recordings.analysis import GroupAnalysis
    from syncrelay.ros.relay import Relay
    from syncrelay.status import RelayState
    from syncrelay.top.client import Answer


_ONE_FILE: Final = "--write goes with one --config FILE"


@dataclass(frozen=True, slots=True)
class Asked:
    """What is tried, all groups if `groups` is empty, and what comes of it; until it is ended if `seconds` is None.

    `write` is where the file with the suggested values goes.
    """

    files: tuple[str, ...]
    groups: tuple[str, ...]
    seconds: float | None
    json: bool
    write: str | None
    ros_args: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Observed:
    """What came of it."""

    seconds: float
    state: "RelayState"
    analyses: "tuple[GroupAnalysis, ...]"


def parser() -> Parser:
    """Return the parser of `syncrelay observe`."""
    parser = Parser(
        "syncrelay observe",
        example="syncrelay observe --config fusion.yaml --seconds 30",
        description="Tries a file beside a running robot: subscribes, publishes nothing, and shows live, as top does, "
        "what its groups make of what comes. Ends with what would have left, why not more, and the values that would "
        "fit. Exit code 1 unless all groups are healthy.",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        required=True,
        help="the file to try, or a directory of files; may be repeated",
    )
    parser.add_argument(
        "--group", metavar="NAME", action="append", default=[], help="try this group only; may be repeated"
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="end after N s, and print text only")
    parser.add_argument("--json", action="store_true", help="print JSON at the end, for programs")
    parser.add_argument(
        "--write", metavar="NEW", type=output, help="write the file with the suggested values; keeps its comments"
    )
    parser.add_argument("--ros-args", action="store_true", help="ROS arguments as the relay gets them, such as remaps")
    return parser


def command(parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay observe`."""
    parser.refuse_repeated(arguments.config)
    if arguments.write is not None:
        if len(arguments.config) > 1:
            parser.error(_ONE_FILE)
        require_new(Path(arguments.write))
    asked = Asked(
        files=tuple(arguments.config),
        groups=tuple(arguments.group),
        seconds=arguments.seconds,
        json=arguments.json,
        write=arguments.write,
        ros_args=tuple(arguments.ros_args),
    )
    return observe(asked, stop=stop)


def observe(asked: Asked, *, stop: StopRequest) -> int:
    """Show what the groups of files make of what is published now, then print it; 0 if all are healthy, else 1.

    Raises ConfigError for a faulty file, UsageError for a group that they lack, RosUnavailableError where ROS
    cannot be used.
    """
    from syncrelay.cli.run import loaded
    from syncrelay.logs import configure
    from syncrelay.ros.environment import require_rclpy

    configure("warning", "text")
    config = loaded(asked.files, asked.groups)
    if asked.write is not None and len(config.sources) > 1:
        raise UsageError(f"{_ONE_FILE}: {asked.files[0]} has {len(config.sources)}")
    require_rclpy()
    observed = _observed(asked, config, stop)
    if asked.json:
        put(json.dumps(_as_json(observed)))
    else:
        for line in _lines(observed, _columns()):
            put(line)
    if asked.write is not None:
        changes = [change for each in observed.analyses for change in each.suggestion.changes]
        write_suggested(asked.write, config.sources[0].text, changes)
    return conclude(observed.state.groups, observed.seconds, unjudged=observed.state.unjudged, tell=not asked.json)


def _observed(asked: Asked, config: "Config", stop: StopRequest) -> Observed:
    with resting_collector():
        from syncrelay.recordings.analysis.live import LiveStreams, analyze_live
        from syncrelay.ros.entities import Purpose
        from syncrelay.ros.relay import Relay

    groups = [group for group in config.groups if not asked.groups or group.name in asked.groups]
    live = LiveStreams(groups)
    stop.defer()
    with Relay(
        config,
        config_paths=asked.files,
        groups=asked.groups or None,
        ros_args=asked.ros_args,
        purpose=Purpose.OBSERVE,
    ) as relay:
        relay.monitor.heard = live.take
        stop.wake_with(relay.wake)
        began = time.monotonic()
        if asked.seconds is None and not asked.json and _is_on_terminal():
            _show(relay, stop)
        else:
            _say_how_long(asked.seconds)
            relay.look(asked.seconds or math.inf, is_over=lambda: stop.requested)
        seconds, state = time.monotonic() - began, relay.state()
    return Observed(seconds, state, tuple(analyze_live(config, groups, live)))


def _is_on_terminal() -> bool:
    from syncrelay.cli.top import why_no_screen

    return why_no_screen() is None


def _say_how_long(seconds: float | None) -> None:
    if sys.stderr.isatty():
        say(f"observing for {seconds:g} s ..." if seconds else "observing; Ctrl-C ends it ...")


def _show(relay: "Relay", stop: StopRequest) -> None:
    """Draw the screen of `top` until the user has seen enough; the relay's turns are taken on another thread."""
    from syncrelay.cli.top import show
    from syncrelay.logs import held_back
    from syncrelay.top.app import EndedError

    seen_enough = Event()
    with ThreadPoolExecutor(1) as thread, held_back():
        relay.evaluate()
        stepping = thread.submit(relay.look, math.inf, is_over=lambda: stop.requested or seen_enough.is_set())

        def source(_url: str) -> "Answer":
            if stepping.done():
                raise EndedError("it ended")
            return _answer(relay)

        try:
            show([_answer(relay)], source)
        finally:
            seen_enough.set()
            relay.wake()
        stepping.result()


def _answer(relay: "Relay") -> "Answer":
    from syncrelay.status import status_of
    from syncrelay.top.client import Answer

    return Answer("", b"", status_of(relay.state()))


def _as_json(observed: Observed) -> object:
    """Return the state as /status has it, for how long was observed, and what is suggested for each group."""
    from syncrelay.recordings.analysis.report_json import suggestion_as_json
    from syncrelay.status import status_of

    suggestions = [{"group": each.group.name, **suggestion_as_json(each.suggestion)} for each in observed.analyses]
    return {**status_of(observed.state).as_dict(), "seconds": round(observed.seconds, 1), "suggestions": suggestions}


def _columns() -> float:
    """Return how wide lines may be: what is piped is not broken."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else math.inf


def _fitted(text: str, columns: float) -> list[str]:
    from syncrelay.top.plain import wrapped

    words = text.lstrip()
    return [text] if len(text) <= columns else wrapped(words, indent=text.removesuffix(words), width=int(columns))


def _lines(observed: Observed, columns: float) -> Iterator[str]:
    from syncrelay.explain import words
    from syncrelay.recordings.analysis.report_text import suggestion_lines
    from syncrelay.status import status_of
    from syncrelay.top.plain import WIDTH, group_lines

    state = observed.state
    seconds = words.seconds(round(observed.seconds * 1e9))
    yield from _fitted(f"observed for {seconds} with {state.config}; nothing was published", columns)
    analyses = {each.group.name: each for each in observed.analyses}
    shown = status_of(state).groups
    for report, group in zip(state.groups, shown, strict=True):
        yield ""
        yield from group_lines(group, width=int(min(WIDTH, columns)))
        yield from _fitted(f"  {_would_have_left(report)}", columns)
        if (analysis := analyses.get(group.name)) is not None:
            for line in suggestion_lines(analysis):
                # Lines of the file, which stand deeper, are for copying.
                yield from [line] if line.startswith("    ") else _fitted(line, columns)


def _would_have_left(report: "GroupReport") -> str:
    """Say how many sets there were, and the share of the messages that set the pace that are in them."""
    from syncrelay.config.wording import counted

    pace, sets = report.facts.pacemaker, counted(report.facts.figures.sets, "set")
    came = pace.counts.fed - pace.counts.buffered
    if not came:
        return f"would have left: {sets}"
    share = round(100 * pace.counts.matched / came)
    return (
        f"would have left: {sets}, with {pace.counts.matched} of {counted(came, 'message')} of {pace.name} ({share} %)"
    )


def conclude(
    reports: "Sequence[GroupReport]", looked_s: float, *, unjudged: Sequence[str] = (), tell: bool = True
) -> int:
    """Return 0 if all groups are healthy, else 1; `tell` what decided that in a last line.

    `unjudged` are groups of which there is no report.
    """
    faults = [f"{report.facts.name} {fault}" for report in reports if (fault := _fault(report, looked_s))]
    faults += [f"{name} could not be evaluated: see the log" for name in unjudged]
    if faults and tell:
        put("")
        for line in _fitted(f"exit code 1: {'; '.join(faults)}", _columns()):
            put(line)
    return AT_FAULT if faults else DONE


def _fault(report: "GroupReport", looked_s: float) -> str | None:
    """Say why a group is not healthy, None if it is."""
    from syncrelay.config.wording import counted
    from syncrelay.explain import Severity

    for severity, word in ((Severity.ERROR, "error"), (Severity.WARN, "warning")):
        if count := sum(finding.severity is severity for finding in report.findings):
            return f"has {counted(count, word)}"
    if report.facts.figures.last_set is None:
        return f"produced no set in {looked_s:.0f} s, which is too short to tell why: observe it for longer"
    return None
