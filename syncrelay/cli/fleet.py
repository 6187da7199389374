"""`syncrelay fleet analyze|replay BAG... --into FOLDER`: a command on many recordings, each by itself."""

from argparse import Namespace
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import DONE, put, remark
from syncrelay.cli.many_options import add_many_options
from syncrelay.cli.parser import COMPRESSIONS, Parser, add_what_if, faults_of
from syncrelay.cli.stop import StopRequest

if TYPE_CHECKING:
    from syncrelay.recordings.fleet.run import Run

_ANALYZE, _REPLAY = "analyze", "replay"
# Options of one of the two, by their names among the arguments.
_ONLY = {_ANALYZE: ("json", "robot"), _REPLAY: ("compression", "what_if", "seed")}


def parser() -> Parser:
    parser = Parser(
        "syncrelay fleet",
        example="syncrelay fleet analyze bags --config fusion.yaml --into facts",
        description="Does each of many recordings by itself, on all cores or on a cluster, and leaves its result in a "
        "folder; the same command goes on where it was stopped. `analyze` ends with a table of all of them, `replay` "
        "writes the sets of each; `syncrelay export` does the same for datasets. Exit code 1 if a recording is at "
        "fault.",
    )
    parser.add_argument("does", metavar="COMMAND", choices=tuple(_ONLY), help="analyze or replay")
    parser.add_argument("bag", metavar="BAG", help="a recording, a pattern, a folder, a URL, or @FILE that lists them")
    parser.add_argument(
        "more", metavar="BAG|TOPIC", nargs="*", default=[], help="more of them; for analyze also topics to match"
    )
    parser.add_argument("--into", required=True, metavar="FOLDER", help="where the results go; those there are kept")
    parser.add_repeatable("--config", metavar="FILE", help="the file with the groups")
    parser.add_argument("--json", action="store_true", help="with analyze: print the rows of its table as JSON")
    parser.add_argument(
        "--robot",
        metavar="PATTERN",
        help="with analyze: where in a path the robot's name is, as in '{robot}/{day}/*.mcap'; default: the first"
        " folder in which paths differ",
    )
    parser.add_argument(
        "--compression", choices=COMPRESSIONS, metavar="HOW", help="with replay: zstd (default), lz4 or none"
    )
    add_what_if(parser)
    add_many_options(parser)
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    for does, names in _ONLY.items():
        for name in names:
            if does != arguments.does and getattr(arguments, name):
                parser.error(f"--{name.replace('_', '-')} goes with fleet {does}")
    return (_replay if arguments.does == _REPLAY else _analyze)(parser, arguments)


def _replay(parser: Parser, arguments: Namespace) -> int:
    """Write the sets of each recording into a folder."""
    parser.refuse_repeated(arguments.config)
    if not arguments.config:
        parser.error("the following arguments are required: --config")
    faults, seed = faults_of(parser, arguments)
    from syncrelay.cli.many import do_on_many
    from syncrelay.config import load
    from syncrelay.recordings.fleet.tasks import ReplayTask

    task = ReplayTask.of(load(*arguments.config), faults, seed, arguments.compression or "zstd")
    return do_on_many(task, [arguments.bag, *arguments.more], arguments)


def _analyze(parser: Parser, arguments: Namespace) -> int:
    """Leave an analysis of each recording in a folder, and a table of all of them where there are groups."""
    from syncrelay.cli.many import do_on_many
    from syncrelay.config.source import read_source
    from syncrelay.config.wording import counted
    from syncrelay.recordings.fleet.recordings import names_recordings
    from syncrelay.recordings.fleet.robots import RobotPattern
    from syncrelay.recordings.fleet.summary import Summary
    from syncrelay.recordings.fleet.table import TABLE, fleet_rows, write_table
    from syncrelay.recordings.fleet.tasks import AnalyzeTask
    from syncrelay.urls import redacted

    file, *others = arguments.config or [None]
    if others:
        parser.error("--config was given more than once: analyze takes one file")
    bags = [arguments.bag, *filter(names_recordings, arguments.more)]
    topics = tuple(word for word in arguments.more if not names_recordings(word))
    if file is not None and topics:
        parser.error("name a file with --config FILE, or the topics to match, not both")
    text = None if file is None else read_source(file).text
    has_groups = text is not None or bool(topics)
    if not has_groups and (arguments.json or arguments.robot):
        parser.error("--json and --robot are about groups: name a file with --config FILE, or topics")
    task = AnalyzeTask.of(file=file, text=text, topics=topics)
    if not has_groups:
        return do_on_many(task, bags, arguments)
    pattern = None if arguments.robot is None else RobotPattern.parse(arguments.robot)
    folder, summary = arguments.into.rstrip("/"), Summary()

    def finish(run: "Run", _sources: object) -> int:
        for row in write_table(f"{folder}/{TABLE}", fleet_rows(folder, run.entries(), pattern)):
            summary.take(row)
            if arguments.json:
                put(row.model_dump_json())
        for line in () if arguments.json else summary.lines():
            put(line)
        rows = counted(summary.rows, "row")
        remark(f"wrote {redacted(folder)}/{TABLE}: {rows}; docs/howto/fleet_report.md has ten queries")
        return DONE

    return do_on_many(task, bags, arguments, finish=finish)
