"""`syncrelay observe`: try a file beside a running robot: subscribe, publish nothing, and tell what would have left."""

import json
import math
import shutil
import sys
import time
from argparse import Namespace
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from threading import Event
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say
from syncrelay.cli.new_file import write_suggested
from syncrelay.cli.parser import Parser, positive
from syncrelay.cli.stop import StopRequest
from syncrelay.collector import resting_collector
from syncrelay.errors import UsageError
from syncrelay.output_files import require_new

if TYPE_CHECKING:
    from collections.abc import Sequence

    from syncrelay.config import Config
    from syncrelay.recordings.analysis import GroupAnalysis
    from syncrelay.relay.relay import Relay
    from syncrelay.status import RelayState
    from syncrelay.top.client import Answer

_ONE_FILE: Final = "--write goes with one --config FILE"


def parser() -> Parser:
    parser = Parser(
        "syncrelay observe",
        example="syncrelay observe --config fusion.yaml --seconds 30",
        description="Tries a file beside a running robot: subscribes, publishes nothing, and shows live, as top does, "
        "what its groups make of what comes. Ends with what would have left, why not more, and the values that would "
        "fit. Exit code 1 unless all groups are healthy.",
    )
    parser.add_repeatable("--config", metavar="FILE", required=True, help="the file to try, or a directory of files")
    parser.add_repeatable("--group", metavar="NAME", help="try this group only")
    parser.add_argument("--seconds", metavar="N", type=positive, help="end after N s, and print text only")
    parser.add_argument("--json", action="store_true", help="print JSON at the end, for programs")
    parser.add_argument("--write", metavar="NEW", help="write the file with the suggested values; keeps its comments")
    parser.add_argument("--ros-args", action="store_true", help="ROS arguments as the relay gets them, such as remaps")
    return parser


def command(parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay observe`: show what groups make of what is published, then print it; 0 if all are healthy, else 1.

    Raises ConfigError for a faulty file, UsageError for a group that it lacks, RosUnavailableError where ROS cannot be
    used.
    """
    parser.refuse_repeated(arguments.config)
    if arguments.write is not None:
        if len(arguments.config) > 1:
            parser.error(_ONE_FILE)
        require_new(arguments.write)
    from syncrelay.cli.run import loaded
    from syncrelay.logs import configure
    from syncrelay.ros.environment import require_rclpy

    configure("warning", "text")
    config = loaded(arguments.config, arguments.group)
    if arguments.write is not None and len(config.sources) > 1:
        raise UsageError(f"{_ONE_FILE}: {arguments.config[0]} has {len(config.sources)}")
    require_rclpy()
    seconds, state, analyses = _observe(arguments, config, stop)
    if arguments.json:
        put(json.dumps(_as_json(state, seconds, analyses)))
    is_healthy = _print(state, seconds, analyses, is_text=not arguments.json)
    if arguments.write is not None:
        changes = [change for each in analyses for change in each.suggestion.changes]
        write_suggested(arguments.write, config.sources[0].text, changes)
    return DONE if is_healthy else AT_FAULT


def _observe(
    arguments: Namespace, config: "Config", stop: StopRequest
) -> "tuple[float, RelayState, Sequence[GroupAnalysis]]":
    """Return for how many seconds was observed, the state at the end, and the analysis of each group."""
    with resting_collector():
        from syncrelay.cli.top import why_no_screen
        from syncrelay.recordings.analysis.live import LiveStreams, analyze_live
        from syncrelay.relay.look import look
        from syncrelay.relay.ports import Purpose
        from syncrelay.relay.relay import Relay
        from syncrelay.ros.joining import joined

    groups = [group for group in config.groups if not arguments.group or group.name in arguments.group]
    live = LiveStreams(groups)
    stop.defer()
    with Relay(
        config,
        *joined(config, ros_args=arguments.ros_args, purpose=Purpose.OBSERVE),
        config_paths=arguments.config,
        groups=arguments.group or None,
        purpose=Purpose.OBSERVE,
    ) as relay:
        relay.monitor.heard = live.take
        stop.wake_with(relay.wake)
        began = time.monotonic()
        if arguments.seconds is None and not arguments.json and why_no_screen() is None:
            _show(relay, stop)
        else:
            if sys.stderr.isatty():
                how_long = f"for {arguments.seconds:g} s ..." if arguments.seconds else "until Ctrl-C ends it ..."
                say(f"observing {how_long}")
            look(relay, arguments.seconds or math.inf, is_over=lambda: stop.requested)
        seconds, state = time.monotonic() - began, relay.state()
    return seconds, state, tuple(analyze_live(config, groups, live))


def _show(relay: "Relay", stop: StopRequest) -> None:
    """Draw the screen of `top` until the user has seen enough; the relay's turns are taken on another thread."""
    from syncrelay.cli.top import show
    from syncrelay.logs import held_back
    from syncrelay.relay.look import look
    from syncrelay.top.app import EndedError

    seen_enough = Event()
    with ThreadPoolExecutor(1) as thread, held_back():
        relay.evaluate()
        stepping = thread.submit(look, relay, math.inf, is_over=lambda: stop.requested or seen_enough.is_set())

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
    from syncrelay.status.as_document import status_of
    from syncrelay.top.client import Answer

    return Answer("", b"", status_of(relay.state()))


def _as_json(state: "RelayState", seconds: float, analyses: "Sequence[GroupAnalysis]") -> object:
    """Return the state as /status has it, for how long was observed, and what is suggested for each group."""
    from syncrelay.status.as_document import status_of

    suggestions = [{"group": each.group.name, **asdict(each.suggestion)} for each in analyses]
    return {**status_of(state).as_dict(), "seconds": round(seconds, 1), "suggestions": suggestions}


def _print(state: "RelayState", seconds: float, analyses: "Sequence[GroupAnalysis]", *, is_text: bool) -> bool:
    """Tell whether all groups are healthy; as text, print what came of them first, and last why they are not."""
    from syncrelay.recordings.analysis.report_text import suggestion_lines
    from syncrelay.top.observed import fitted, observed_lines, unhealthy

    faults = unhealthy(state.groups, seconds, unjudged=state.unjudged)
    if is_text:
        # What is piped is not broken.
        columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else math.inf
        suggested = {each.group.name: list(suggestion_lines(each)) for each in analyses}
        lines = list(observed_lines(state, seconds, suggested, columns))
        put("\n".join([*lines, *(["", *fitted(f"exit code 1: {'; '.join(faults)}", columns)] if faults else [])]))
    return not faults
