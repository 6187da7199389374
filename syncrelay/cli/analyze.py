"""`syncrelay analyze BAG`: figures of a recording, what a file makes of it, and the values that would fit."""

import json
from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

from syncrelay.bag import Channel, Recording, open_recording
from syncrelay.bag.analysis import Analysis, analyze, proposed_text, settled, with_changes
from syncrelay.bag.bindings import bind
from syncrelay.cli.analysis_json import as_json
from syncrelay.cli.analysis_text import report
from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.inventory import put_inventory
from syncrelay.cli.new_file import write_again, write_new
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import reading
from syncrelay.cli.stop import StopRequest
from syncrelay.config import load_text
from syncrelay.config.source import read_source
from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError, UsageError
from syncrelay.printable import printable

_GROUP = "matched"


@dataclass(frozen=True, slots=True)
class Asked:
    """What is analyzed: a file's groups, or topics as one group; and what comes of it beside the text."""

    config: str | None
    topics: tuple[str, ...]
    write: str | None
    html: str | None
    json: bool


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay analyze`."""
    config, *others = arguments.config or [None]
    if others:
        parser.error("--config was given more than once: analyze takes one file")
    asked = Asked(config, tuple(arguments.topics), arguments.write, arguments.html, arguments.json)
    return analyze_bag(arguments.bag, asked)


def analyze_bag(bag: str, asked: Asked) -> int:
    """Print what a recording tells, with neither file nor topics what is in it; 1 if a required topic is not.

    Raises ConfigError for a faulty file, BagError for a recording that cannot be read, UsageError where both a file
    and topics are named, or something is to be written of neither.
    """
    _require_sense(asked)
    with closing(open_recording([bag])) as recording:
        if asked.config is None and not asked.topics:
            put_inventory(bag, recording, is_json=asked.json)
            _tell_faults(recording)
            return DONE
        text = read_source(asked.config).text if asked.config else _proposed(recording, asked.topics)
        bindings = bind(load_text(text, name=asked.config or "<topics>"), recording)
        for problem in (problem for binding in bindings for problem in binding.problems):
            remark(printable(problem))
        with reading(recording):
            analysis = analyze(recording, text, bindings)
        if asked.config is None:
            analysis = settled(analysis)
        _tell_faults(recording)
    _print(bag, analysis, asked)
    return DONE if all(binding.is_complete for binding in bindings) else AT_FAULT


def _require_sense(asked: Asked) -> None:
    more = "\n  see syncrelay analyze --help"
    if asked.config is not None and asked.topics:
        raise UsageError(f"name a file with --config FILE, or the topics to match, not both{more}")
    if asked.config is None and not asked.topics and (asked.write or asked.html):
        raise UsageError(f"name a file with --config FILE, or the topics to match: there is nothing to write yet{more}")


def _tell_faults(recording: Recording) -> None:
    for fault in recording.faults:
        remark(printable(fault))


def _proposed(recording: Recording, topics: Sequence[str]) -> str:
    by_name: dict[str, Channel] = {channel.topic: channel for channel in recording.channels}
    for topic in topics:
        if topic not in by_name:
            raise BagError(
                f"{topic} is not in the recording{did_you_mean(topic, by_name)}; it has {', '.join(by_name)}"
            )
    if len(set(topics)) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
        raise UsageError("name 2 topics or more")
    return proposed_text(_GROUP, [by_name[topic] for topic in dict.fromkeys(topics)])


def _print(bag: str, analysis: Analysis, asked: Asked) -> None:
    if asked.json:
        put(json.dumps(as_json(bag, analysis), indent=2))
    else:
        for line in report(bag, analysis):
            put(line)
        if asked.config is None:
            put(f"\nA file that gives these sets:\n\n{analysis.text.rstrip()}")
    if asked.write is not None:
        write_new(asked.write, with_changes(analysis.text, analysis.changes))
    if asked.html is not None:
        from syncrelay.cli.analysis_html import MARK, as_html

        write_again(asked.html, as_html(bag, analysis), mark=MARK)
