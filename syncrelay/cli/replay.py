"""`syncrelay replay BAG...`: what a file makes of a recording."""

from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark, say
from syncrelay.cli.parser import COMPRESSIONS, Parser, add_what_if, faults_of
from syncrelay.cli.stop import StopRequest
from syncrelay.printable import printable
from syncrelay.urls import redacted

if TYPE_CHECKING:
    from syncrelay.recordings.bag.bindings import GroupBinding
    from syncrelay.recordings.bag.replay import Left, Listener
    from syncrelay.recordings.bag.writing import SetWriter
    from syncrelay.rig.what_if import Fault
    from syncrelay.sync import Outcome


def parser() -> Parser:
    parser = Parser(
        "syncrelay replay",
        example="syncrelay replay drive.mcap --config fusion.yaml -o sets.mcap",
        description="Runs the groups of a file on a recording, without ROS, and says what became of every message. "
        "The sets are those that the relay would have published. Exit code 1 if a required topic, or part of "
        "the recording, is missing.",
    )
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        help="a rosbag2 folder, or an MCAP, sqlite3 or ROS 1 bag file, compressed or not; several are read as one",
    )
    parser.add_repeatable(
        "--config", metavar="FILE", required=True, help="the file with the groups, or a directory of files"
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="write the sets as a recording: OUT.mcap, or OUT as a rosbag2 folder"
    )
    parser.add_argument(
        "--compression", choices=COMPRESSIONS, metavar="HOW", help="how OUT is packed: zstd (default), lz4 or none"
    )
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each set")
    parser.add_argument("--drops", action="store_true", help="print a line of JSON for each message that is dropped")
    add_what_if(parser)
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    parser.refuse_repeated(arguments.config)
    faults, seed = faults_of(parser, arguments)
    if arguments.compression and not arguments.output:
        parser.error("--compression goes with --output")
    return _replay(arguments, faults, seed)


def _replay(arguments: Namespace, what_if: "tuple[Fault, ...]", seed_of_faults: int) -> int:
    """Feed recordings to the groups of files and print what became of them.

    Returns 1 if a required topic is not there, or part of the recording is missing or cannot be read.

    Lines go to stdout, and the summary then to stderr. Raises ConfigError for a faulty file, BagError for a
    recording that cannot be read, or has not the stamps that the file names.
    """
    from syncrelay.cli.reading import reading, tell_faults
    from syncrelay.config import load
    from syncrelay.config.wording import all_of, counted
    from syncrelay.explain import drop_fates, may_set_pace
    from syncrelay.explain.summary import summarize
    from syncrelay.recordings.bag import open_recording
    from syncrelay.recordings.bag.bindings import bind
    from syncrelay.recordings.bag.replay import replay as replay_groups
    from syncrelay.recordings.bag.what_if import Disturbed

    config = load(*arguments.config)
    with ExitStack() as opened:
        recording = open_recording(arguments.bags, tell=remark)
        opened.callback(recording.close)
        plain = recording
        disturbed = Disturbed(recording, what_if, seed=seed_of_faults) if what_if else None
        if disturbed is not None:
            recording = disturbed
            faults = ", ".join(f"`{fault.written}`" for fault in what_if)
            remark(printable(f"faults laid over the recording (seed {seed_of_faults}): {faults}"))
        bindings = bind(config, recording)
        _remark_all(problem for binding in bindings for problem in binding.problems)
        written = _written(arguments, bindings, opened)
        listeners = [*_printing(arguments, bindings), *([] if written is None else [written.take])]
        with reading(recording):
            results = replay_groups(recording, bindings, listeners=listeners)
        _remark_all(disturbed.idle() if disturbed is not None else ())
        without_faults = results
        if disturbed is not None:
            with reading(plain):
                without_faults = replay_groups(plain, bindings)
    if written is not None:
        sets = sum(result.sets for result in results)
        remark(f"wrote {redacted(arguments.output)}: {counted(written.messages, 'message')} of {counted(sets, 'set')}")
    tell = say if arguments.json or arguments.drops else put
    for result, binding in zip(results, bindings, strict=True):
        group = binding.group
        needed = group.enough([each.counts.fed for each in result.inputs])
        set_pace = may_set_pace(needed, trigger=group.trigger, by_clock=group.ticks is not None)
        fates = drop_fates([each.counts.dropped for each in result.inputs], set_pace)
        for line in summarize(result.name, result.sets, [(each.topic, each.counts) for each in result.inputs], fates):
            tell(line)
    if disturbed is not None:
        for result, without in zip(results, without_faults, strict=True):
            remark(printable(f"{result.name}: {counted(result.sets, 'set')} with the faults, {without.sets} without"))
    if tell_faults(recording) or not all(binding.is_complete for binding in bindings):
        return AT_FAULT
    none = [result.name for result in without_faults if not result.sets]
    if none:
        remark(f"no sets of {all_of(none)}: `syncrelay analyze` with this recording and file tells why")
    return DONE


def _remark_all(sentences: Iterable[str]) -> None:
    for sentence in sentences:
        remark(printable(sentence))


def _printing(arguments: Namespace, bindings: "Sequence[GroupBinding]") -> "Iterator[Listener]":
    """Yield what prints sets and drops, if any are to be printed."""
    from syncrelay.explain import GroupLines, RecentDrop
    from syncrelay.recordings.bag.replay import received
    from syncrelay.sync import Match

    lines = {each.group.name: GroupLines(each.group, [one.topic for one in each.inputs]) for each in bindings}

    def line(name: str, outcome: "Outcome", now: int) -> str | None:
        if isinstance(outcome, Match):
            last = max(received(message) for message in outcome.messages if message is not None)
            return lines[name].of_set(outcome.stamps, left=now, received=last) if arguments.json else None
        drop = RecentDrop(outcome.message.input, outcome.message.stamp, outcome.reason)
        return lines[name].of_drop(drop, left=now, received=received(outcome.message)) if arguments.drops else None

    def show(left: "Sequence[Left]") -> None:
        for binding, outcomes, now in left:
            for outcome in outcomes:
                if (shown := line(binding.group.name, outcome, now)) is not None:
                    put(shown)

    if arguments.json or arguments.drops:
        yield show


def _written(arguments: Namespace, bindings: "Sequence[GroupBinding]", opened: ExitStack) -> "SetWriter | None":
    """Return what writes the recording, if one is to be written, and say what there is to say of it."""
    if arguments.output is None:
        return None
    from syncrelay.recordings.bag import Encoding
    from syncrelay.recordings.bag.mcap_output import McapOutput
    from syncrelay.recordings.bag.writing import SetWriter

    channels = (channel for binding in bindings for each in binding.inputs for channel in each.channels)
    recording = opened.enter_context(McapOutput(arguments.output, compression=arguments.compression or "zstd"))
    if any(channel.encoding is Encoding.ROS1 for channel in channels):
        remark("this is a ROS 1 recording: its messages are written as ROS 2 CDR, without header.seq")
    writer = SetWriter(recording)
    for binding in bindings:
        writer.begin(binding)
    _remark_all(writer.left_out)
    return writer
