"""`syncrelay init`: a first file, from what a recording or the ROS graph shows."""

import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import DONE, put, remark, say
from syncrelay.cli.new_file import write_new
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import reading
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import NothingToMatchError
from syncrelay.explain import UNREADABLE
from syncrelay.printable import printable
from syncrelay.recordings.analysis import Proposal, inventory_of, propose, propose_for
from syncrelay.recordings.analysis.inventory import no_header
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.bag import Channel, Encoding, open_recording
from syncrelay.recordings.bag.qos import Profile

if TYPE_CHECKING:
    from syncrelay.ros.listening import Heard


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay init`."""
    if arguments.from_graph:
        return init_from_graph(arguments.seconds or 10.0, arguments.output)
    if arguments.seconds is not None:
        parser.error("--seconds N needs --from-graph: it is how long to listen")
    return init_from_bag(arguments.from_bag, arguments.output)


def init_from_bag(bag: str, output: str | None) -> int:
    """Print a file that gives sets of a recording, or write it where `output` says; 0.

    Raises BagError for a recording that cannot be read, NothingToMatchError where it holds too little.
    """
    with closing(open_recording([bag], tell=remark)) as recording:
        with reading(recording):
            proposal = propose(recording)
        for fault in recording.faults:
            remark(printable(fault))
    return _give(proposal, output)


def init_from_graph(seconds: float, output: str | None) -> int:
    """Listen to the graph and give a file as init_from_bag does; 0.

    Raises RosUnavailableError where ROS cannot be used, NothingToMatchError where too little is published.
    """
    from syncrelay.ros.environment import require_rclpy

    require_rclpy()
    from syncrelay.ros.listening import listen

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
        raise NothingToMatchError("\n  ".join([str(error), *without, _what_helps(heard)])) from error
    return _give(replace(proposal, left_out=(*proposal.left_out, *without)), output)


def _give(proposal: Proposal, output: str | None) -> int:
    for sentence in proposal.left_out:
        remark(printable(f"left out: {sentence}"))
    if output is None:
        put(proposal.text.rstrip())
    else:
        write_new(output, proposal.text)
    return DONE


def _streams(heard: "Heard") -> Iterator[tuple[Channel, Stream]]:
    for number, topic in enumerate(heard.topics):
        profile = Profile(reliability="reliable" if topic.is_reliable else "best_effort")
        stream = Stream(topic.name, topic.type, received=topic.received, places=topic.places)
        stream.stamps.extend(UNREADABLE if stamp is None else stamp for stamp in topic.stamps)
        yield Channel(number, topic.name, topic.type, Encoding.CDR, qos=(profile,)), stream


def _what_helps(heard: "Heard") -> str:
    if not (heard.topics or heard.headerless or heard.unusable):
        return "nobody publishes anything that can be used here: start the nodes, or run `syncrelay doctor --live`"
    return "listen longer with --seconds N, or write `stamp: receive` for topics without stamps"
