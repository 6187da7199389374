"""`syncrelay init`: a first file, from what a recording or the ROS graph shows."""

import sys
from argparse import Namespace
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import DONE, put, remark, say
from syncrelay.cli.new_file import write_new
from syncrelay.cli.parser import Parser, positive
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import NothingToMatchError
from syncrelay.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from syncrelay.recordings.analysis import Proposal
    from syncrelay.recordings.analysis.streams import Stream
    from syncrelay.recordings.bag import Channel
    from syncrelay.relay.listening import Heard


def parser() -> Parser:
    parser = Parser(
        "syncrelay init",
        example="syncrelay init --from-bag drive.mcap -o fusion.yaml",
        description="Proposes a file for a recording or for a live ROS graph: groups of its topics, their types, and "
        "values that fit, with what was measured as comments. Exit code 1 if there is nothing to match, or part of the "
        "recording is missing or cannot be read.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--from-bag", metavar="BAG", help="a recording, as for replay; needs no ROS")
    source.add_argument("--from-graph", action="store_true", help="listen to what is being published now")
    parser.add_argument("--seconds", metavar="N", type=positive, help="with --from-graph: listen for N s (10)")
    parser.add_argument("-o", "--output", metavar="NEW", help="write the file here instead of printing it")
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay init`: print a file, or write it where --output says."""
    if not arguments.from_graph and arguments.seconds is not None:
        parser.error("--seconds N needs --from-graph: it is how long to listen")
    if arguments.from_graph:
        proposal, code = _from_graph(arguments.seconds or 10.0), DONE
    else:
        proposal, code = _from_bag(arguments.from_bag)
    for sentence in proposal.left_out:
        remark(printable(f"left out: {sentence}"))
    if arguments.output is None:
        put(proposal.text.rstrip())
    else:
        write_new(arguments.output, proposal.text)
    return code


def _from_bag(bag: str) -> "tuple[Proposal, int]":
    """Return what is proposed for a recording, and the exit code: 1 if part of it is missing or cannot be read.

    Raises BagError for a recording that cannot be read, NothingToMatchError where it holds too little.
    """
    from syncrelay.cli.reading import reading, tell_faults
    from syncrelay.recordings.analysis import propose
    from syncrelay.recordings.bag import open_recording

    with closing(open_recording([bag], tell=remark)) as recording:
        try:
            with reading(recording):
                proposal = propose(recording)
        finally:
            code = tell_faults(recording)
    return proposal, code


def _from_graph(seconds: float) -> "Proposal":
    """Raises RosUnavailableError where ROS cannot be used, NothingToMatchError where too little is published."""
    from syncrelay.recordings.analysis import inventory_of, propose_for
    from syncrelay.recordings.analysis.inventory import no_header
    from syncrelay.ros.environment import require_rclpy

    require_rclpy()
    from syncrelay.ros.joining import listen

    if sys.stderr.isatty():
        say(f"listening to the graph for {seconds:g} s ...")
    heard = listen(seconds=seconds)
    if heard.relayed:
        remark(f"left out: published by a running relay: {', '.join(heard.relayed)}")
    headerless = [f"{name} ({type_name}): {no_header(type_name)}" for name, type_name in heard.headerless.items()]
    without = (*heard.unusable, *headerless)
    try:
        proposal = propose_for(inventory_of(list(_streams(heard))), source=f"{seconds:g} s of the graph")
    except NothingToMatchError as error:
        helps = "listen longer with --seconds N, or write `stamp: receive` for topics without stamps"
        if not (heard.topics or heard.headerless or heard.unusable):
            helps = "nobody publishes anything that can be used here: start the nodes, or run `syncrelay doctor --live`"
        raise NothingToMatchError("\n  ".join([str(error), *without, helps])) from error
    return replace(proposal, left_out=(*proposal.left_out, *without))


def _streams(heard: "Heard") -> "Iterator[tuple[Channel, Stream]]":
    from syncrelay.config.profile import Profile
    from syncrelay.explain import UNREADABLE
    from syncrelay.recordings.analysis.streams import Stream
    from syncrelay.recordings.bag import Channel, Encoding

    for number, topic in enumerate(heard.topics):
        profile = Profile(reliability="reliable" if topic.is_reliable else "best_effort")
        stamps = [UNREADABLE if stamp is None else stamp for stamp in topic.stamps]
        messages = [*zip(stamps, topic.received, topic.places, strict=True)]
        stream = Stream.of(topic.name, topic.type, messages)
        yield Channel(number, topic.name, topic.type, Encoding.CDR, qos=(profile,)), stream
