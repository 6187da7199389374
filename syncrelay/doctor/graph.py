"""The graph held against the file: who publishes what, and whether it arrives."""

from collections.abc import Iterator, Sequence
from typing import Final

from syncrelay.config.wording import all_of, counted, one_of
from syncrelay.doctor.diagnosis import Diagnosis, Severity, know, mend
from syncrelay.doctor.discovery import ports_of
from syncrelay.ros.sighting import SeenPublisher, SeenTopic, Sighting

# Of Fast DDS's shared memory by default, in bytes: a message has to fit into it as a whole.
_SEGMENT: Final = 512 * 1024


def check_company(sighting: Sighting, *, domain: int, discovery_range: str) -> Iterator[Diagnosis]:
    """Yield whether anyone else is there at all, and whether what they say arrives."""
    if sighting.n_nameless:
        ports = ports_of(domain)
        yield mend(
            "unreachable",
            f"{counted(sighting.n_nameless, 'topic')} on domain {domain} are of nodes whose names did not arrive",
            so="these nodes were found, but nothing that they send comes through, not even that",
            do="where they run on this machine, in another container or as another user, on both sides:\n"
            "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4    and start them anew;\n"
            f"on another machine: let UDP ports {ports[0]} to {ports[-1]} through both firewalls",
        )
    elif not sighting.nodes:
        yield mend(
            "alone",
            f"no other node was found on domain {domain} in {sighting.seconds:.0f} s (discovery: {discovery_range})",
            so="whatever is published, nothing of it is received here",
            do="start the robot's nodes; if they run: compare ROS_DOMAIN_ID, RMW_IMPLEMENTATION and\n"
            "ROS_AUTOMATIC_DISCOVERY_RANGE on both sides, and try a larger --seconds",
        )


def check_own_name(sighting: Sighting, node: str) -> Iterator[Diagnosis]:
    """Yield others that have the name of the relay's node."""
    count = sighting.nodes.count(node)
    if count == 1:
        yield know(
            "node_name",
            f"a node of the name {node} is there already",
            so="if that is this relay, all is well; a second one beside it would send every set twice",
            do="nothing; or give this one a name of its own: node: {name: ...} in the file",
        )
    elif count > 1:
        yield mend(
            "node_name",
            f"{count} nodes have the name {node}",
            so="each set is sent as often, and what is asked of the node reaches any of them",
            do="end all but one, or give each a name of its own: node: {name: ...} in the file",
        )


def check_outputs(sighting: Sighting, node: str) -> Iterator[Diagnosis]:
    """Yield outputs of the file that others publish already; what has the relay's name is told by `check_own_name`."""
    for output in sighting.outputs:
        others = dict.fromkeys(each for each in output.nodes if each != node)
        if others:
            yield mend(
                "output_taken",
                f"{output.name}, an output of the file, is published by {all_of(others)}",
                so="beside the relay, whoever subscribes to it gets the messages of both",
                do=f"end {all_of(others)}, or give the output another name in the file: output: /...",
            )


def check_clock(sighting: Sighting, *, use_sim_time: bool) -> Iterator[Diagnosis]:
    """Yield whether /clock is what the file expects."""
    if use_sim_time and not sighting.clocks:
        yield mend(
            "no_clock",
            "use_sim_time is set, and nobody publishes /clock",
            so="time stands still: max_wait never ends, and stamps cannot be held against the clock",
            do="start the simulation, play the bag with --clock, or write use_sim_time: false",
        )
    elif use_sim_time and not sighting.ticks:
        yield mend(
            "clock_silent",
            f"use_sim_time is set, and /clock was silent for {sighting.seconds:.0f} s",
            so="time stands still: max_wait never ends",
            do="resume the simulation or the bag",
        )
    elif sighting.clocks and not use_sim_time:
        yield know(
            "clock_unused",
            "somebody publishes /clock, and use_sim_time is not set",
            so="stamps are matched all the same; only max_wait goes by this machine's clock",
            do="with a simulation or a bag, write into the file: node: {use_sim_time: true}",
        )


def _is_reached(sighting: Sighting) -> bool:
    return bool(sighting.nodes or sighting.n_nameless)


def check_topics(sighting: Sighting, *, optional: frozenset[str]) -> Iterator[Diagnosis]:
    """Yield topics that bring nothing; those that are optional everywhere need no action."""
    if not _is_reached(sighting):
        return
    for topic in sighting.topics:
        for found in _check_topic(topic, sighting.seconds):
            yield _eased(found) if topic.name in optional else found


def _check_topic(topic: SeenTopic, seconds: float) -> Iterator[Diagnosis]:
    fitting = [each for each in topic.publishers if each.type == topic.type]
    strangers = [each for each in topic.publishers if each.type != topic.type]
    mismatched = [each for each in fitting if each.mismatch]
    if not topic.publishers:
        yield _no_publisher(topic, seconds)
    if strangers:
        yield _other_type(topic, strangers, alone=not fitting)
    if mismatched:
        yield _incompatible(topic, mismatched)
    elif any(each.node for each in fitting) and not topic.received:
        yield _silent(topic, fitting, seconds)
    if len(fitting) > 1:
        yield _several(topic, fitting)


def _no_publisher(topic: SeenTopic, seconds: float) -> Diagnosis:
    hint = f"did you mean {one_of(topic.alike)}? Else:\n" if topic.alike else ""
    return mend(
        "no_publisher",
        f"nobody publishes {topic.name} (looked for {seconds:.0f} s)",
        so="its group waits for it and gives no set",
        do=f"{hint}start its driver, or mend the name, in the file or by a remap (ros2 topic list shows all there are)",
    )


def _other_type(topic: SeenTopic, strangers: Sequence[SeenPublisher], *, alone: bool) -> Diagnosis:
    they = all_of(f"{_name(each)} ({each.type})" for each in strangers)
    make = mend if alone else know
    return make(
        "other_type",
        f"{topic.name} is published as another type by {they};\nthe file says {topic.type}",
        so="nothing of theirs is received" + ("" if alone else ", only what the others publish"),
        do=f"write their type into the file if it is what you want: type: {strangers[0].type}",
    )


def _incompatible(topic: SeenTopic, mismatched: Sequence[SeenPublisher]) -> Diagnosis:
    they = all_of(f"{_name(each)} (offers {each.offers})" for each in mismatched)
    reasons = all_of(dict.fromkeys(str(each.mismatch) for each in mismatched))
    return mend(
        "qos",
        f"{topic.name}: the file's QoS does not fit {they}:\n{reasons}",
        so="nothing of theirs is received",
        do="take `qos` away from this topic in the file, or write `qos: auto`: it takes what publishers offer",
    )


def _silent(topic: SeenTopic, fitting: Sequence[SeenPublisher], seconds: float) -> Diagnosis:
    they = all_of(_name(each) for each in fitting)
    return mend(
        "silent",
        f"{topic.name} is published by {they}, but no message came in {seconds:.0f} s",
        so="its group waits for it and gives no set",
        do="see whether the driver sends: ros2 topic hz on its own machine, in its own container, as its own user.\n"
        "If it does, data get lost on the way: export FASTDDS_BUILTIN_TRANSPORTS=UDPv4 on both sides, and start anew",
    )


def _several(topic: SeenTopic, fitting: Sequence[SeenPublisher]) -> Diagnosis:
    return know(
        "several_publishers",
        f"{topic.name} is published by {all_of(_name(each) for each in fitting)}",
        so="where their stamps are not in one order, messages are dropped as late or repeated",
        do="nothing if they take turns; else give each a topic of its own",
    )


def check_sizes(sighting: Sighting) -> Iterator[Diagnosis]:
    """Yield topics whose messages do not fit into the shared memory that Fast DDS takes by itself."""
    large = [topic for topic in sighting.topics if topic.largest > _SEGMENT]
    if large:
        yield know(
            "large_messages",
            f"messages of {all_of(f'{topic.name} ({topic.largest / 1e6:.1f} MB)' for topic in large)} are larger than"
            " the 0.5 MB of shared memory that Fast DDS takes",
            so="on one machine they take ten times as long as they could, and some are lost",
            do="for the relay write into the file: node: {transport: large_messages}\n"
            "for every other process: export FASTRTPS_DEFAULT_PROFILES_FILE=.../configs/large_messages.xml",
        )


def _name(publisher: SeenPublisher) -> str:
    return publisher.node or "a node whose name did not arrive"


def _eased(found: Diagnosis) -> Diagnosis:
    return Diagnosis(
        found.code,
        Severity.KNOW,
        found.what,
        "it is optional: its group's sets leave without it, after max_wait",
        found.do,
    )


def summary(sighting: Sighting) -> str:
    """Return what is there, in a line."""
    return f"{counted(len(sighting.nodes), 'other node')}, {counted(sighting.n_topics, 'topic')} published"
