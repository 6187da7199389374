"""`syncrelay init`: a first file, from what a recording or the ROS graph shows."""

import sys
from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING

from syncrelay.bag import Channel, Encoding, open_recording
from syncrelay.bag.analysis import propose, propose_for
from syncrelay.bag.analysis.streams import UNREADABLE, Stream
from syncrelay.bag.qos import Profile
from syncrelay.cli.boundary import DONE, put, remark, say
from syncrelay.cli.new_file import write_new
from syncrelay.cli.reading import reading
from syncrelay.errors import NothingToMatchError
from syncrelay.printable import printable

if TYPE_CHECKING:
    from syncrelay.ros.listening import Heard


def init_from_bag(bag: str, output: str | None) -> int:
    """Print a file that gives sets of a recording, or write it where `output` says; 0.

    Raises BagError for a recording that cannot be read, NothingToMatchError where it holds too little.
    """
    with closing(open_recording([bag])) as recording:
        with reading(recording):
            text = propose(recording)
        for fault in recording.faults:
            remark(printable(fault))
    return _give(text, output)


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
        remark(f"left out, as outputs of a relay that runs: {', '.join(heard.relayed)}")
    for why in heard.unusable:
        remark(printable(why))
    try:
        text = propose_for(list(_streams(heard)), source=f"{seconds:g} s of the graph")
    except NothingToMatchError as error:
        raise NothingToMatchError("\n  ".join([str(error), *_what_was_heard(heard)])) from error
    return _give(text, output)


def _give(text: str, output: str | None) -> int:
    if output is None:
        put(text.rstrip())
    else:
        write_new(output, text)
    return DONE


def _streams(heard: "Heard") -> Iterator[tuple[Channel, Stream]]:
    for number, topic in enumerate(heard.topics):
        profile = Profile(reliability="reliable" if topic.is_reliable else "best_effort")
        stream = Stream(topic.name, topic.type, received=topic.received, places=topic.places)
        stream.stamps.extend(UNREADABLE if stamp is None else stamp for stamp in topic.stamps)
        yield Channel(number, topic.name, topic.type, Encoding.CDR, qos=(profile,)), stream


def _what_was_heard(heard: "Heard") -> Iterator[str]:
    """Yield what there is, and what may help."""
    for topic in heard.topics:
        unset = topic.stamps.count(0)
        yield f"{topic.name} ({topic.type}): {len(topic.stamps)} messages{f', {unset} with stamp 0' if unset else ''}"
    for name, type_name in heard.headerless.items():
        yield f"{name} ({type_name}): its type has no header, and so no stamp to match by"
    if not heard.topics and not heard.headerless:
        yield "nobody publishes anything that can be used here: start the nodes; `syncrelay doctor --live` tells more"
    else:
        yield "with --seconds N it listens longer; a topic of a group may go by `stamp: receive`"
