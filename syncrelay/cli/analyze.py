"""`syncrelay analyze BAG...`: figures of recordings, what a file makes of each, and the values that would fit."""

import json
import os
from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path

from syncrelay.cli.analysis_json import as_json
from syncrelay.cli.analysis_text import report
from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.fleet import do_on_many, put_facts, require_into
from syncrelay.cli.inventory import put_inventory
from syncrelay.cli.new_file import write_again, write_new, write_suggested
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import reading, tell_faults
from syncrelay.cli.side_by_side import Work, side_by_side
from syncrelay.cli.stop import StopRequest
from syncrelay.config import load_text
from syncrelay.config.source import read_source
from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError, UsageError
from syncrelay.printable import printable
from syncrelay.recordings.analysis import Analysis, analyze, file_with_changes, proposed_text, settled
from syncrelay.recordings.bag import Channel, Recording, is_recording, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.fleet.recordings import names_recordings
from syncrelay.recordings.fleet.robots import RobotPattern
from syncrelay.urls import redacted

_GROUP = "matched"


@dataclass(frozen=True, slots=True)
class Asked:
    """What is analyzed: a file's groups, or topics as one group; and what comes of it beside the text.

    `text` is what the file of this name holds. `indent` is that of JSON.
    """

    config: str | None
    text: str | None
    topics: tuple[str, ...]
    write: str | None
    html: str | None
    json: bool
    indent: int | None


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay analyze`."""
    config, *others = arguments.config or [None]
    if others:
        parser.error("--config was given more than once: analyze takes one file")
    require_into(parser, arguments)
    is_bag = is_recording if arguments.into is None else names_recordings
    bags = [arguments.bag, *filter(is_bag, arguments.more)]
    asked = Asked(
        config=config,
        text=None,
        topics=tuple(word for word in arguments.more if not is_bag(word)),
        write=arguments.write,
        html=arguments.html,
        json=arguments.json,
        indent=2 if len(bags) == 1 else None,
    )
    _require_sense(asked, bags if arguments.into is None else bags[:1])
    if config is not None:
        asked = replace(asked, text=read_source(config).text)
    if arguments.into is not None:
        return _analyze_many(parser, arguments, bags, asked)
    if arguments.robot:
        parser.error("--robot goes with --into")
    if len(bags) == 1:
        return analyze_bag(bags[0], asked)
    if asked.text is not None:
        load_text(asked.text, name=config)
    works = [Work(redacted(bag), partial(analyze_bag, bag, asked)) for bag in bags]
    return side_by_side(works, jobs=arguments.jobs or len(os.sched_getaffinity(0)))


def _analyze_many(parser: Parser, arguments: Namespace, bags: Sequence[str], asked: Asked) -> int:
    """Leave an analysis of each recording in a folder, and a table of all of them where there are groups."""
    from syncrelay.cli.fleet_tasks import AnalyzeTask

    if asked.write or asked.html:
        parser.error("--write and --html are for one recording, and --into is for many")
    if asked.text is None and not asked.topics:
        if asked.json or arguments.robot:
            parser.error("--json and --robot are about groups: name a file with --config FILE, or topics")
        return do_on_many(AnalyzeTask.of(asked), bags, arguments)
    pattern = None if arguments.robot is None else RobotPattern.parse(arguments.robot)
    # Without it hours of work would end in no table.
    import_module("pyarrow")

    def finish(*_: object) -> int:
        return put_facts(Path(arguments.into), pattern, is_json=asked.json)

    return do_on_many(AnalyzeTask.of(asked), bags, arguments, finish=finish)


def analyze_bag(bag: str, asked: Asked) -> int:
    """Print what a recording tells, with neither file nor topics what is in it.

    Returns 1 if a required topic is not there, or part of the recording is missing or cannot be read.
    Raises ConfigError for a faulty file, BagError for a recording that cannot be read.
    """
    name = redacted(bag)
    with closing(open_recording([bag], tell=remark)) as recording:
        if asked.config is None and not asked.topics:
            put_inventory(name, recording, is_json=asked.json, indent=asked.indent)
            return tell_faults(recording)
        text, bindings = bound(recording, asked)
        for problem in (problem for binding in bindings for problem in binding.problems):
            remark(printable(problem))
        with reading(recording):
            analysis = measured(recording, text, bindings, asked)
    _print(name, analysis, asked)
    if tell_faults(recording) or not all(binding.is_complete for binding in bindings):
        return AT_FAULT
    return DONE


def bound(recording: Recording, asked: Asked) -> tuple[str, tuple[GroupBinding, ...]]:
    """Return the text of the file that is meant, and its groups as the recording fills them; raises as analyze_bag."""
    text = _proposed(recording, asked.topics) if asked.text is None else asked.text
    return text, bind(load_text(text, name=asked.config or "<topics>"), recording)


def measured(recording: Recording, text: str, bindings: Sequence[GroupBinding], asked: Asked) -> Analysis:
    """Read a recording to its end; where only topics are named, with the values that fit them."""
    analysis = analyze(recording, text, bindings)
    return settled(analysis) if asked.config is None else analysis


def _require_sense(asked: Asked, bags: Sequence[str]) -> None:
    more = "\n  see syncrelay analyze --help"
    if asked.config is not None and asked.topics:
        raise UsageError(f"name a file with --config FILE, or the topics to match, not both{more}")
    if asked.config is None and not asked.topics and (asked.write or asked.html):
        raise UsageError(f"name a file with --config FILE, or the topics to match: there is nothing to write yet{more}")
    if len(bags) > 1 and (asked.write or asked.html):
        raise UsageError(f"--write and --html are for one recording, found {len(bags)}{more}")


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
        put(json.dumps(as_json(bag, analysis), indent=asked.indent))
    else:
        for line in report(bag, analysis):
            put(line)
        if asked.config is None:
            put(f"\nA file that gives these sets:\n\n{analysis.text.rstrip()}")
    if asked.write is not None and asked.config is None:
        write_new(asked.write, file_with_changes(analysis.text, analysis.changes))
    elif asked.write is not None:
        write_suggested(asked.write, analysis.text, analysis.changes)
    if asked.html is not None:
        from syncrelay.cli.analysis_html import MARK, as_html

        write_again(asked.html, as_html(bag, analysis), mark=MARK)
