"""Findings about the graph and what we have there: publishers, subscribers, types, QoS, and who has gone silent."""

from collections.abc import Sequence
from typing import Final

from syncrelay.config.installed import suspects
from syncrelay.config.wording import all_of, one_of
from syncrelay.explain import words
from syncrelay.explain.codes import Severity
from syncrelay.explain.facts import NO_SECOND, GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found, absence, blocks
from syncrelay.explain.graph_facts import Endpoint, GraphSnapshot, Refusal, serving
from syncrelay.sync.messages import DropReason

_NO_MESSAGE: Final = 5 * SECOND
# Fast DDS's lease: a killed node stays in the graph this long.
_LEASE: Final = 20 * SECOND
# Sets stopped with an input that has been silent for this share of the time without a set, and for more periods than
# the second number.
_AS_LONG: Final = 0.8
_MISSED_PERIODS: Final = 2
# Inputs that fell silent within this time did so together.
_TOGETHER: Final = 2 * SECOND
# The graph shows a publisher no longer after its first message.
_SHOWN: Final = 2 * SECOND
# So many names are read in a sentence.
_FEW: Final = 3
# A pause is reported if it is this many times the longest before.
_PAUSES: Final = 3

RUN_DOCTOR: Final = "; if so, run `syncrelay doctor --config FILE --live`"
"""How advice ends that leads to the doctor, who says in place of it what is next."""


def internal_error(facts: GroupFacts) -> Found:
    """Find that an exception has stopped the group."""
    if facts.failure is not None:
        yield Fault(
            f"a bug in {suspects(facts.policy)} stopped this group: {facts.failure}",
            "report it with the traceback in the log; `syncrelay reload` starts the group again",
            Severity.ERROR,
        )


def inactive(facts: GroupFacts) -> Found:
    """Find that the group belongs to a managed node that waits to be activated."""
    if facts.inactive is not None:
        yield Fault(
            "the node is inactive: it receives and publishes nothing",
            f"activate it with `ros2 lifecycle set {facts.inactive} activate`",
        )


def refused_by_dds(_facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find a topic that DDS lets the group not subscribe to or publish."""
    if (refusal := an_input.graph.refusal) is not None:
        yield Fault(refusal.text, _what_helps(refusal), Severity.ERROR if an_input.required else Severity.WARN)


def _what_helps(refusal: Refusal) -> str:
    if refusal.held_as:
        return "give one of the two another name: a process has one type for each topic"
    if refusal.is_unfit:
        return "build its package from the definitions that the publishers use, and source it where the relay runs"
    return "the relay tries again every 5 s; if this goes on, check the limits on memory and open files"


def no_bundle(facts: GroupFacts) -> Found:
    """Find that the sets do not leave as one message each, as they should."""
    if facts.bundle is not None and (refusal := facts.bundle.refusal) is not None:
        severity = Severity.ERROR if facts.bundle.is_alone else Severity.WARN
        yield Fault(refusal.text.splitlines()[0], _what_helps(refusal), severity)


def type_not_importable(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find a type that cannot be used here, or not as the file asks."""
    severity = Severity.ERROR if an_input.required else Severity.WARN
    if an_input.graph.not_importable:
        text = f"{an_input.name}: {an_input.graph.not_importable.splitlines()[0]}"
        suggestion = "install the package where the relay runs, or source the workspace that has it"
        if others := _of_another_type(an_input):
            text += f"; {others[0].node} publishes it as {others[0].type}"
            suggestion = f"write `type: {others[0].type}`, or leave `type` out"
        yield Fault(text, suggestion, severity)
    elif an_input.graph.not_readable:
        needs_stamps = facts.tolerance is not None and not facts.tolerance.takes_times_of_arrival
        by_arrival = "" if needs_stamps else ", or write `stamp: receive`"
        yield Fault(
            f"{an_input.name}: {an_input.graph.not_readable.splitlines()[0]}",
            f"name a field that it has at `stamp` or `key`{by_arrival}, then `syncrelay reload`",
            severity,
        )


def other_type(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find publishers of another type than the file's, or than the one that was taken from the graph."""
    others = _of_another_type(an_input)
    # Of a type that cannot be used at all, it says who publishes another.
    if an_input.graph.not_importable:
        return
    alone = len(others) == len(an_input.graph.publishers)
    origin = an_input.graph.type_from
    expected = f"the relay took {an_input.type} from {origin.node}" if origin else f"the file says {an_input.type}"
    for publisher in others:
        yield Fault(
            f"{publisher.node} publishes {an_input.name} as {publisher.type}, {expected}",
            (f"write `type: {publisher.type}`" if origin is None else f"restart the relay, or {_write(publisher)}")
            if alone
            else f"have {publisher.node} use another topic",
            blocks(facts, an_input) if alone else Severity.WARN,
            explains=alone,
        )


def _of_another_type(an_input: InputFacts) -> list[Endpoint]:
    """Return its publishers of another type than its own, none as long as it has none."""
    return [each for each in an_input.graph.publishers if an_input.type not in (None, each.type)]


def _write(publisher: Endpoint) -> str:
    return f"write `type: {publisher.type}` and `syncrelay reload`"


def several_types(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find a topic whose type the file leaves to its publishers, and these do not agree."""
    by_type = {each.type: each for each in reversed(an_input.graph.publishers)}
    if an_input.type is None and len(by_type) > 1:
        types = all_of(f"{each.type} by {each.node}" for each in reversed(by_type.values()))
        yield Fault(
            f"{an_input.name} is published with {len(by_type)} types: {types}",
            "write the `type` that is meant, or have only one of them publish it",
            blocks(facts, an_input),
        )


def alone(facts: GroupFacts) -> Found:
    """Find that there is no other node in the graph, of a group to which nothing has come yet."""
    graph = facts.empty_graph
    if graph is None or facts.is_discovering or any(each.figures.last_received for each in facts.inputs):
        return
    yield Fault(
        no_other_node(graph),
        "start the robot's nodes; if they are running, compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and"
        " RMW_IMPLEMENTATION on both sides, and run `syncrelay doctor --live`",
    )


def no_other_node(graph: GraphSnapshot) -> str:
    """Say that a graph is empty, and which one it is."""
    return f"no other node was found on domain {graph.domain} (discovery range {graph.discovery_range})"


def no_publisher(facts: GroupFacts) -> Found:
    """Find the topics that nobody publishes, and those that nobody publishes any more."""
    missing = [index for index in facts.required_first if not facts.inputs[index].graph.publishers]
    gone = [index for index in missing if facts.inputs[index].figures.last_received is not None]
    never = [index for index in missing if index not in gone]
    if never and not facts.is_discovering:
        yield _without_publisher(facts, never, _never_published(facts, [facts.inputs[index] for index in never]))
    if gone:
        yield _without_publisher(facts, gone, _no_longer_published(facts, [facts.inputs[index] for index in gone]))


def _without_publisher(facts: GroupFacts, indices: Sequence[int], words_of_it: tuple[str, str]) -> Fault:
    severity = max(absence(facts, facts.inputs[index]) for index in indices)
    one = indices[0] if len(indices) == 1 else None
    return Fault(*words_of_it, severity, one, inputs=tuple(indices))


def _never_published(facts: GroupFacts, missing: Sequence[InputFacts]) -> tuple[str, str]:
    meant = _meant(facts, missing)
    if len(missing) == 1:
        (only,) = missing
        text = f"nobody publishes {only.name}{_of_type(only)}"
        if meant:
            published = f" It is published as {only.type}" if only.type else ""
            return text, f"did you mean `topic: {meant[only.name]}`?{published}"
        return text, f"start the node that publishes {only.name}, or correct the topic's name{_or_configure(only)}"
    text = f"nobody publishes {one_of(each.name for each in missing)}"
    if (moved := _in_another_namespace(missing)) is not None:
        namespace, names = moved
        return text, f"{all_of(names)} are published; did you mean namespace {namespace}?"
    pairs = [f"{there} for {name}" for name, there in meant.items()]
    hint = f"did you mean {all_of(pairs)}? Otherwise " if pairs else ""
    return text, f"{hint}start the nodes that publish them, or correct the topics' names{_or_configure(missing[0])}"


def _or_configure(an_input: InputFacts) -> str:
    if not (managed := an_input.graph.managed):
        return ""
    some = all_of(managed) if len(managed) <= _FEW else f"{len(managed)} managed nodes, such as {managed[0]},"
    verb = "publishes" if len(managed) == 1 else "publish"
    return (
        f"; {some} {verb} nothing yet, and may have to be configured and activated: `ros2 lifecycle get {managed[0]}`"
    )


def _of_type(an_input: InputFacts) -> str:
    return f" ({an_input.type})" if an_input.type else ""


def _meant(facts: GroupFacts, missing: Sequence[InputFacts]) -> dict[str, str]:
    """Find for each topic the one that may have been meant: not another input's, and none twice."""
    taken = {each.name for each in facts.inputs}
    meant: dict[str, str] = {}
    for each in missing:
        if (there := next((name for name in each.graph.alike if name not in taken), None)) is not None:
            meant[each.name] = there
            taken.add(there)
    return meant


def _in_another_namespace(missing: Sequence[InputFacts]) -> tuple[str, list[str]] | None:
    """Find the namespace in which all of these are published, and their names there."""
    first = missing[0]
    for name in first.graph.alike:
        ours, theirs = _namespaces(first.name, name)
        moved = [theirs + each.name.removeprefix(ours) for each in missing]
        pairs = zip(moved, missing, strict=True)
        if all(each.name.startswith(f"{ours}/") and there in each.graph.alike for there, each in pairs):
            return theirs or "/", moved
    return None


def _namespaces(ours: str, theirs: str) -> tuple[str, str]:
    """Return what two names begin with before the words that both end with."""
    own_words, their_words = ours.split("/"), theirs.split("/")
    while own_words and their_words and own_words[-1] == their_words[-1]:
        own_words.pop()
        their_words.pop()
    return "/".join(own_words), "/".join(their_words)


def _no_longer_published(facts: GroupFacts, gone: Sequence[InputFacts]) -> tuple[str, str]:
    last = words.seconds(facts.figures.now - max(each.figures.last_received or 0 for each in gone))
    if len(gone) == 1:
        (only,) = gone
        text = f"nobody publishes {only.name}{_of_type(only)} any more; its last message arrived {last} ago"
        return text, f"restart the node that published {only.name}"
    text = f"nobody publishes {one_of(each.name for each in gone)} any more; the last message arrived {last} ago"
    return text, "restart the nodes that published them"


def incompatible_qos(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find publishers that cannot serve the QoS that the group requests."""
    of_type = [each for each in an_input.graph.publishers if each.type == an_input.type]
    alone = all(each.mismatch for each in of_type)
    for publisher in of_type:
        if (why := publisher.mismatch) is not None:
            yield Fault(
                f"{publisher.node} offers {an_input.name} with {why.policy} {why.offered}, the group requests"
                f" {why.requested}",
                f"write `qos: auto` at {an_input.name}, or have {publisher.node} offer {why.requested}",
                blocks(facts, an_input) if alone else Severity.WARN,
                explains=alone,
            )


def no_clock(facts: GroupFacts) -> Found:
    """Find that time is simulated and that nobody has told it."""
    if facts.clock is not None and not facts.clock.received and facts.clock.stopped is not None:
        yield Fault(
            f"no /clock has been received for {words.seconds(facts.clock.stopped)}, and the relay runs with"
            " use_sim_time: nothing that waits expires",
            "start what publishes /clock, such as `ros2 bag play --clock`, or run without use_sim_time",
            Severity.ERROR if facts.is_silent else Severity.WARN,
        )


def clock_stopped(facts: GroupFacts) -> Found:
    """Find that simulated time does not pass any more."""
    if facts.clock is not None and facts.clock.received and facts.clock.stopped is not None:
        yield Fault(
            f"/clock has stood still for {words.seconds(facts.clock.stopped)}: nothing that waits expires",
            "start or resume what publishes /clock, or run without use_sim_time",
            Severity.ERROR if facts.is_silent else Severity.WARN,
        )


def silent(facts: GroupFacts) -> Found:
    """Find publishers that send nothing, or nothing any more; one finding where all inputs stopped together."""
    found = [
        finding for index in facts.required_first if (finding := _silent(facts, index, facts.inputs[index])) is not None
    ]
    quiet = [facts.figures.now - each.figures.last_received for each in facts.inputs if each.figures.last_received]
    if 1 < len(found) == len(quiet) == len(facts.inputs) and max(quiet) - min(quiet) < _TOGETHER:
        yield Fault(
            f"all inputs have been silent for {words.seconds(min(quiet))}",
            "check whether recording was paused"
            if facts.is_recorded
            else "check whether their publishers are still running, and the network to them",
            max(each.severity for each in found),
            inputs=tuple(range(len(facts.inputs))),
        )
    else:
        yield from found


def _silent(facts: GroupFacts, index: int, an_input: InputFacts) -> Fault | None:
    fitting = serving(an_input.graph, an_input.type)
    now, figures = facts.figures.now, an_input.figures
    if not fitting or now - max(facts.figures.began, an_input.served_since or 0) < _NO_MESSAGE:
        # It may be about to send.
        return None
    node, quiet = fitting[0].node, now - (figures.last_received or now)
    is_managed = node in an_input.graph.managed
    state = f"check with `ros2 lifecycle get {node}` whether it is active; if so, " if is_managed else ""
    if figures.last_received is None and not figures.fed:
        lately = " lately" if an_input.counts.fed else ""
        return Fault(
            f"{node} publishes {an_input.name}, but no message has arrived{lately}",
            f"{state}check with `ros2 topic hz {an_input.name}` whether {node} is sending{RUN_DOCTOR}",
            absence(facts, an_input),
            input=index,
        )
    if not _is_silent(facts, an_input, quiet) or (facts.is_held(index) and _is_enough(facts, an_input, quiet)):
        return None
    if DropReason.MALFORMED in figures.dropped:
        # Messages come, of which none can be read.
        return None
    until_then = f"; before that its rate was {words.rate(figures.usual_hz)}" if figures.usual_hz else ""
    return Fault(
        f"{an_input.name} has been silent for {words.seconds(quiet)}{until_then}",
        f"check whether recording of {an_input.name} stopped"
        if facts.is_recorded
        else f"{state}check {node}, which {_is_there(facts, an_input, quiet)}{_or_hold_longer(facts, index)}",
        absence(facts, an_input),
        input=index,
    )


def _is_silent(facts: GroupFacts, an_input: InputFacts, quiet: int) -> bool:
    """Whether nothing comes, by this input's rate, or for about as long as no set has left."""
    figures = an_input.figures
    if len(figures.received) == 1 and quiet < NO_SECOND and not facts.figures.last_set:
        return False
    usual = figures.usual_hz
    if (
        facts.is_silent
        and quiet >= _AS_LONG * facts.silent_for
        and (not usual or quiet * usual > _MISSED_PERIODS * SECOND)
    ):
        return True
    return quiet >= _NO_MESSAGE and not figures.rate_hz


def _is_there(facts: GroupFacts, an_input: InputFacts, quiet: int) -> str:
    if (served_since := an_input.served_since) is not None and facts.figures.now - served_since < quiet - _SHOWN:
        return f"has published it again for {words.seconds(facts.figures.now - served_since)}"
    return (
        "still publishes it" if quiet > _LEASE else "publishes it or has died: a dead node stays in the graph for 20 s"
    )


def _is_enough(facts: GroupFacts, an_input: InputFacts, quiet: int) -> bool:
    """Whether an input whose latest message serves on sends when it has something to say, as a map: once, or at odds.

    One that has always come more often than that has died, and what is held of it is old.
    """
    figures = an_input.figures
    return not facts.is_silent and (not figures.usual_hz or quiet < _PAUSES * figures.longest_pause)


def _or_hold_longer(facts: GroupFacts, index: int) -> str:
    rarely = "; if it is meant to be sent this rarely, write"
    if facts.is_held(index):
        tolerance = facts.tolerance_of(index)
        key = tolerance and f"a `{tolerance.key}` larger than {words.duration(tolerance.ns)} for it"
        return f"{rarely} {key}" if key else ""
    others = [each for at, each in enumerate(facts.inputs) if at != index]
    # What has ever had a rate has died.
    if not others or not facts.by_stamp or index == facts.trigger or facts.inputs[index].figures.usual_hz:
        return ""
    trigger = max(others, key=lambda each: each.figures.rate_hz)
    return f"{rarely} `policy: latest_time` and `trigger: {trigger.name}`, so that its last message is held"
