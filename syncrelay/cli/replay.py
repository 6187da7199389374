"""`syncrelay replay BAG...`: what a file makes of a recording."""

from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark, say
from syncrelay.cli.fleet import do_on_many, require_into
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import reading, tell_faults
from syncrelay.cli.stop import StopRequest
from syncrelay.cli.summary import summarize
from syncrelay.config import GroupConfig, load
from syncrelay.config.wording import all_of, counted
from syncrelay.explain import DropFates, GroupLines, RecentDrop, drop_fates, may_set_pace
from syncrelay.printable import printable
from syncrelay.recordings.bag import Encoding, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.mcap_output import McapOutput
from syncrelay.recordings.bag.replay import GroupResult, Listener, received
from syncrelay.recordings.bag.replay import replay as replay_groups
from syncrelay.recordings.bag.what_if import Disturbed
from syncrelay.recordings.bag.writing import SetWriter
from syncrelay.rig.what_if import Fault, parse_fault
from syncrelay.sync import Match, Outcome


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a replay gives beside its summary: a line a set, a line a drop, the outputs in a recording.

    `what_if` are faults laid over the recording, whose chance is that of `seed`.
    """

    sets: bool
    drops: bool
    output: str | None
    what_if: tuple[Fault, ...] = ()
    seed: int = 0


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay replay`."""
    parser.refuse_repeated(arguments.config)
    try:
        what_if = tuple(map(parse_fault, arguments.what_if))
    except ValueError as error:
        parser.error(f"argument --what-if: {error}")
    require_into(parser, arguments)
    if arguments.into is not None:
        from syncrelay.cli.fleet_tasks import ReplayTask

        if arguments.output or arguments.json or arguments.drops:
            parser.error("--output, --json and --drops are for one replay: --into writes the sets of each recording")
        task = ReplayTask.of(load(*arguments.config), what_if, arguments.seed)
        return do_on_many(task, arguments.bags, arguments)
    if arguments.jobs is not None:
        parser.error("--jobs goes with --into")
    wanted = Wanted(arguments.json, arguments.drops, arguments.output, what_if, arguments.seed)
    return replay(arguments.bags, arguments.config, wanted)


def replay(bags: Sequence[str], config_paths: Sequence[str], wanted: Wanted) -> int:
    """Feed recordings to the groups of files and print what became of them.

    Returns 1 if a required topic is not there, or part of the recording is missing or cannot be read.

    Lines go to stdout, and the summary then to stderr. Raises ConfigError for a faulty file, BagError for a
    recording that cannot be read, or has not the stamps that the file names.
    """
    config = load(*config_paths)
    with ExitStack() as opened:
        recording = open_recording(bags, tell=remark)
        opened.callback(recording.close)
        plain = recording
        disturbed = Disturbed(recording, wanted.what_if, seed=wanted.seed) if wanted.what_if else None
        if disturbed is not None:
            recording = disturbed
            faults = ", ".join(f"`{fault.written}`" for fault in wanted.what_if)
            remark(printable(f"faults laid over the recording (seed {wanted.seed}): {faults}"))
        bindings = bind(config, recording)
        _say_all(problem for binding in bindings for problem in binding.problems)
        written = _written(wanted.output, bindings, opened)
        listeners = [*_printing(wanted, bindings), *([] if written is None else [written.take])]
        with reading(recording):
            results = replay_groups(recording, bindings, listeners=listeners)
        _say_all(disturbed.idle() if disturbed is not None else ())
        without_faults = results
        if disturbed is not None:
            with reading(plain):
                without_faults = replay_groups(plain, bindings)
    if written is not None:
        sets = sum(result.sets for result in results)
        remark(f"wrote {wanted.output}: {counted(written.messages, 'message')} of {counted(sets, 'set')}")
    tell = say if wanted.sets or wanted.drops else put
    for result, binding in zip(results, bindings, strict=True):
        inputs = [(each.topic, each.counts) for each in result.inputs]
        for line in summarize(result.name, result.sets, inputs, _drop_fates(result, binding.group)):
            tell(line)
    if wanted.what_if:
        _say_all([_compared(*each) for each in zip(results, without_faults, strict=True)])
    if tell_faults(recording) or not all(binding.is_complete for binding in bindings):
        return AT_FAULT
    none = [result.name for result in without_faults if not result.sets]
    if none:
        remark(f"no sets of {all_of(none)}: `syncrelay analyze` with this recording and file tells why")
    return DONE


def _drop_fates(result: GroupResult, group: GroupConfig) -> tuple[DropFates, ...]:
    required = [topic.required for topic in group.topics]
    counted = may_set_pace(required, trigger=group.trigger, by_clock=group.ticks is not None)
    return drop_fates([each.counts.dropped for each in result.inputs], counted)


def _compared(result: GroupResult, without_faults: GroupResult) -> str:
    return f"{result.name}: {counted(result.sets, 'set')} with the faults, {without_faults.sets} without"


def _say_all(sentences: Iterator[str] | Sequence[str]) -> None:
    for sentence in sentences:
        remark(printable(sentence))


def _printing(wanted: Wanted, bindings: Sequence[GroupBinding]) -> Iterator[Listener]:
    lines = {each.group.name: GroupLines(each.group, [one.topic for one in each.inputs]) for each in bindings}

    def print_set(binding: GroupBinding, outcome: Outcome, now: int) -> None:
        if isinstance(outcome, Match):
            last = max(received(message) for message in outcome.messages if message is not None)
            put(lines[binding.group.name].of_set(outcome.stamps, left=now, received=last))

    def print_drop(binding: GroupBinding, outcome: Outcome, now: int) -> None:
        if not isinstance(outcome, Match):
            message = outcome.message
            drop = RecentDrop(message.input, message.stamp, outcome.reason)
            put(lines[binding.group.name].of_drop(drop, left=now, received=received(message)))

    if wanted.sets:
        yield print_set
    if wanted.drops:
        yield print_drop


def _written(output: str | None, bindings: Sequence[GroupBinding], opened: ExitStack) -> SetWriter | None:
    """Return what writes the recording, if one is to be written, and say what there is to say of it."""
    if output is None:
        return None
    channels = (channel for binding in bindings for each in binding.inputs for channel in each.channels)
    recording = opened.enter_context(McapOutput(Path(output)))
    if any(channel.encoding is Encoding.ROS1 for channel in channels):
        remark("this is a ROS 1 recording: its messages are written as ROS 2 CDR, without header.seq")
    writer = SetWriter(recording)
    for binding in bindings:
        writer.begin(binding)
    return writer
