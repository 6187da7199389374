"""`syncrelay analyze BAG...`: figures of recordings, what a file makes of each, and the values that would fit."""

import json
from argparse import Namespace
from contextlib import closing
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import AT_FAULT, DONE, exit_code, flush, put, remark, tell, tell_machine_or_bug
from syncrelay.cli.new_file import write_again, write_new, write_suggested
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError
from syncrelay.printable import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from syncrelay.recordings.analysis import Analysis


def parser() -> Parser:
    parser = Parser(
        "syncrelay analyze",
        example="syncrelay analyze drive.mcap --config fusion.yaml",
        description="Measures a recording without ROS: rates, gaps, faulty stamps, offsets; what the groups of a file "
        "make of it, and why; and the values that would fit. With BAG alone it lists what the recording holds. "
        "Each of several recordings is measured by itself. "
        "Exit code 1 if a required topic, or part of a recording, is missing.",
    )
    parser.add_argument("bag", metavar="BAG", help="a recording, as for replay")
    parser.add_argument(
        "more",
        metavar="BAG|TOPIC",
        nargs="*",
        default=[],
        help="more recordings; topics to match, if there is no file yet",
    )
    parser.add_argument("--config", metavar="FILE", action="append", help="the file with the groups")
    parser.add_argument("--write", metavar="NEW", help="write the file with the suggested values; keeps its comments")
    parser.add_argument("--html", metavar="REPORT", help="write a report with charts: one HTML file, opens offline")
    parser.add_argument(
        "--json",
        action="store_true",
        help="print all figures as JSON; of several recordings, each in one line",
    )
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    from syncrelay.config import load_text
    from syncrelay.config.source import read_source
    from syncrelay.recordings.bag import is_recording

    config, *others = arguments.config or [None]
    if others:
        parser.error("--config was given more than once: analyze takes one file")
    bags = [arguments.bag, *filter(is_recording, arguments.more)]
    topics = tuple(word for word in arguments.more if not is_recording(word))
    if config is not None and topics:
        parser.error("name a file with --config FILE, or the topics to match, not both")
    if config is None and not topics and (arguments.write or arguments.html):
        parser.error("name a file with --config FILE, or the topics to match: there is nothing to write yet")
    text = None if config is None else read_source(config).text
    if len(bags) > 1 and (arguments.write or arguments.html):
        parser.error(f"--write and --html are for one recording, found {len(bags)}")
    if len(bags) == 1:
        return _analyze(bags[0], arguments, text, topics, indent=2)
    if text is not None:
        load_text(text, name=config)
    return _analyze_in_turn(bags, arguments, text, topics)


def _analyze_in_turn(bags: "Sequence[str]", arguments: Namespace, text: str | None, topics: tuple[str, ...]) -> int:
    """Analyze recordings one after another; neither one that cannot be read nor a bug ends the others."""
    from syncrelay.urls import redacted

    code = DONE
    for bag in bags:
        try:
            code = max(code, _analyze(bag, arguments, text, topics, indent=None))
        except SyncRelayError as error:
            tell(error)
            code = max(code, exit_code(error))
        except BrokenPipeError:
            raise
        except Exception as error:  # noqa: BLE001  a bug with one recording must not stop the others
            code = max(code, tell_machine_or_bug(error))
            remark(f"it happened with the recording {redacted(bag)}")
        # Each is there when it is done, and before what is said of the next.
        flush()
    return code


def _analyze(bag: str, arguments: Namespace, text: str | None, topics: tuple[str, ...], *, indent: int | None) -> int:
    """Print what a recording tells, with neither file nor topics what is in it; `indent` is that of JSON.

    Returns 1 if a required topic is not there, or part of the recording is missing or cannot be read.
    Raises ConfigError for a faulty file, BagError for a recording that cannot be read.
    """
    from syncrelay.cli.reading import reading, tell_faults
    from syncrelay.recordings.analysis import analyze, find_all, inventory, with_suggestions
    from syncrelay.recordings.analysis.proposal import bind_file_or_topics
    from syncrelay.recordings.analysis.report_json import inventory_as_json
    from syncrelay.recordings.analysis.report_text import inventory_lines
    from syncrelay.recordings.bag import open_recording
    from syncrelay.urls import redacted

    name = redacted(bag)
    with closing(open_recording([bag], tell=remark)) as recording:
        if text is None and not topics:
            with reading(recording):
                found = inventory(recording)
            if arguments.json:
                put(json.dumps(inventory_as_json(name, recording, found), indent=indent))
            else:
                put("\n".join(inventory_lines(name, recording, found)))
            return tell_faults(recording)
        file = arguments.config[0] if arguments.config else None
        text, bindings = bind_file_or_topics(recording, file=file, text=text, topics=topics)
        for problem in (problem for binding in bindings for problem in binding.problems):
            remark(printable(problem))
        with reading(recording):
            analysis = analyze(recording, text, bindings)
            if file is None:
                analysis = with_suggestions(analysis)
            find_all(analysis)
    _give(name, analysis, arguments, indent=indent)
    if tell_faults(recording) or not all(binding.is_complete for binding in bindings):
        return AT_FAULT
    return DONE


def _give(name: str, analysis: "Analysis", arguments: Namespace, *, indent: int | None) -> None:
    """Print an analysis, and write the files that the options name."""
    from syncrelay.recordings.analysis import file_with_changes
    from syncrelay.recordings.analysis.report_json import as_json
    from syncrelay.recordings.analysis.report_text import report

    if arguments.json:
        put(json.dumps(as_json(name, analysis), indent=indent))
    else:
        put("\n".join(report(name, analysis)))
        if arguments.config is None:
            put(f"\nA file that gives these sets:\n\n{analysis.text.rstrip()}")
    if arguments.write is not None and arguments.config is None:
        write_new(arguments.write, file_with_changes(analysis.text, analysis.changes))
    elif arguments.write is not None:
        write_suggested(arguments.write, analysis.text, analysis.changes)
    if arguments.html is not None:
        from syncrelay.recordings.analysis.html import MARK, as_html

        write_again(arguments.html, as_html(name, analysis), mark=MARK)
