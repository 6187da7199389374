"""Every finding: its code, how bad it is, what it means, and what to do. docs/reference/findings.md is made of this."""

from enum import Enum, IntEnum, auto
from functools import partial
from typing import Final, NamedTuple, Self


class Severity(IntEnum):
    """How bad it is: nothing to mend, sets suffer, no sets come."""

    OK = 0
    WARN = 1
    ERROR = 2


_OK: Final = (Severity.OK,)
_WARN: Final = (Severity.WARN,)
_ERROR: Final = (Severity.ERROR,)
_OK_OR_WARN: Final = (Severity.OK, Severity.WARN)
_ANY: Final = tuple(Severity)
_WARN_OR_ERROR: Final = (Severity.WARN, Severity.ERROR)


class Of(Enum):
    """What a finding is of: the node, what the graph shows, what messages tell, their order, how they match."""

    NODE = auto()
    GRAPH = auto()
    MESSAGES = auto()
    ORDER = auto()
    MATCHING = auto()


class _Kind(NamedTuple):
    code: str
    severities: tuple[Severity, ...]
    meaning: str
    remedy: str | None = None
    of: Of = Of.NODE


_of_node, _of_graph, _of_messages, _of_order, _of_matching = (partial(_Kind, of=each) for each in Of)


class Code(Enum):
    """What a finding is, for programs. In the order in which findings explain a silence.

    `severities` are those that it is found with, `meaning` what is so, `remedy` what to do about it, None for nothing.
    What a finding explains is said by `syncrelay.explain.judge`, as it spans several.
    """

    _value_: str
    severities: tuple[Severity, ...]
    meaning: str
    remedy: str | None
    of: Of

    # The defaults are for type checkers, which take Code("alone") for a call of this.
    def __new__(
        cls,
        code: str,
        severities: tuple[Severity, ...] = (),
        meaning: str = "",
        remedy: str | None = None,
        of: Of = Of.NODE,
    ) -> Self:
        """Return the member whose value is the code alone."""
        member = object.__new__(cls)
        member._value_ = code
        member.severities, member.meaning, member.remedy, member.of = severities, meaning, remedy, of
        return member

    INTERNAL_ERROR = _of_node(
        "internal_error",
        _ERROR,
        "A bug in syncrelay stopped the group; its traceback is in the log once.",
        "Report it with the traceback. A reload starts the group again.",
    )
    INACTIVE = _of_node(
        "inactive",
        _WARN,
        "The node is managed (`lifecycle: true`) and waits to be activated.",
        "Activate it: the finding has the `ros2 lifecycle set` command.",
    )
    PAUSED = _of_node(
        "paused",
        _WARN,
        "Somebody paused the relay, for so long by now. A warning, because a pause is easily forgotten.",
        "Call the service `~/resume`: the finding has the command.",
    )
    REFUSED_BY_DDS = _of_node(
        "refused_by_dds",
        _WARN_OR_ERROR,
        "DDS refuses to publish an output or to subscribe to an input. It is tried again every 5 s, a message with the"
        " next set.",
        "Where the topic's name is in use with another type, give one of the two another name: a process has one type"
        " for each topic. Otherwise check the limits on memory and open files.",
    )
    TYPE_NOT_IMPORTABLE = _of_graph(
        "type_not_importable",
        _WARN_OR_ERROR,
        "A message type is not installed where the relay runs, or has no header, or lacks the field that the file names"
        " at `stamp` or `key`. If the topic is published as another type, the finding says which.",
        "Install the package where the relay runs, or source the workspace that has it; write the type that is"
        " published; or name a field that the type has, or `stamp: receive`.",
    )
    OTHER_TYPE = _of_graph(
        "other_type",
        _WARN_OR_ERROR,
        "A topic is published as another type than the file's, or than the one that was taken from its first"
        " publisher.",
        "Write the `type` that is published, or have that publisher use another topic. Where the type was taken from"
        " the graph, restart the relay, or write the type and reload.",
    )
    SEVERAL_TYPES = _of_graph(
        "several_types",
        _WARN_OR_ERROR,
        "The file leaves a topic's type to its publishers, and they have different ones: none is taken until only one"
        " is left. The finding says who publishes what.",
        "Write the `type` that is meant, or have only one of them publish the topic.",
    )
    ALONE = _of_graph(
        "alone",
        _WARN_OR_ERROR,
        "There is no other node in the graph: another ROS_DOMAIN_ID, discovery limited to this machine, or nothing runs"
        " yet.",
        "Start the robot's nodes. If they are running, compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and"
        " RMW_IMPLEMENTATION on both sides, and run `syncrelay doctor --live`.",
    )
    NO_PUBLISHER = _of_graph(
        "no_publisher",
        _ANY,
        "Nobody publishes a topic, or nobody any more. Nothing to mend once that of an optional input has lasted for a"
        " minute.",
        "Start the node that publishes it, or correct the topic's name: a topic of that type (of any, where the file"
        " has none) and a similar name is suggested, or the namespace in which all that are missing are published.",
    )
    INCOMPATIBLE_QOS = _of_graph(
        "incompatible_qos",
        _WARN_OR_ERROR,
        "A publisher does not offer what `qos` requests: which policy, what is offered and what is requested.",
        "Write `qos: auto`, or have the publisher offer what is requested.",
    )
    NOBODY_LISTENS = _of_graph(
        "nobody_listens",
        _OK,
        "Nobody subscribes to what a lazy group publishes, so it receives nothing, as intended.",
    )
    NO_CLOCK = _of_graph(
        "no_clock",
        _WARN_OR_ERROR,
        "use_sim_time is set, and no /clock has been received: nothing that waits expires.",
        "Start what publishes /clock, such as `ros2 bag play --clock`, or run without use_sim_time.",
    )
    CLOCK_STOPPED = _of_messages(
        "clock_stopped",
        _WARN_OR_ERROR,
        "use_sim_time is set, and /clock stands still: nothing that waits expires.",
        "Start or resume what publishes /clock, or run without use_sim_time.",
    )
    TOO_SLOW = _of_messages(
        "too_slow",
        _WARN,
        "Messages of the group waited for the relay: it gets less CPU than it needs, or stood still.",
        "Check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
        " `--group`.",
    )
    SILENT = _of_messages(
        "silent",
        _ANY,
        "A publisher is there, and sends nothing, or nothing any more; all inputs at once are one finding. Nothing to"
        " mend once that of an optional input has lasted for a minute.",
        "Check with `ros2 topic hz TOPIC` whether the publisher is sending; if so, run"
        " `syncrelay doctor --config FILE --live`. A node that was killed stays in the graph for 20 s.",
    )
    MALFORMED = _of_messages(
        "malformed",
        _WARN_OR_ERROR,
        "Messages are cut short, or not of their type; or more than 20,000 values stand before the field that is read.",
        "Check that the publisher uses the same version of the type as is installed where the relay runs. Name a `key`,"
        " or a `field` for the stamp, that stands before long lists.",
    )
    UNSTAMPED = _of_messages(
        "unstamped",
        _WARN_OR_ERROR,
        "Stamps are zero: the driver does not fill them in.",
        "Have the publisher set header.stamp, or write `stamp: receive` at the topic.",
    )
    SEVERAL_PUBLISHERS = _of_messages(
        "several_publishers",
        _WARN_OR_ERROR,
        "Several nodes publish an input, and their stamps conflict: who, and how far apart.",
        "Give each publisher a topic of its own, or stop all but one.",
    )
    CLOCK_STEP = _of_messages(
        "clock_step",
        _WARN_OR_ERROR,
        "A clock was set: this machine's, or stamps of one input or of all jumped against it.",
        "Check what set the clock; NTP and chrony can be told to slew it instead.",
    )
    CLOCK_DRIFT = _of_messages(
        "clock_drift",
        _WARN,
        "Stamps of an input drift away from those of the others, in ppm.",
        "Synchronize the clocks with PTP or chrony, or have the drivers stamp with the host's time.",
    )
    OTHER_CLOCK = _of_messages(
        "other_clock",
        _ERROR,
        "Stamps of one input are seconds off those of the others, or off the clock that triggers the sets. Boot time,"
        " GPS time, TAI and local time are recognized.",
        "Synchronize the clocks of the machines, have the driver stamp with the host's time, or write the `offset` or"
        " `stamp: receive` that the finding names. With a simulation or a recording, use_sim_time may be missing.",
    )
    NO_COMMON_KEY = _of_messages(
        "no_common_key",
        _ERROR,
        "The inputs of `equal_key` have no key in common; the finding has the newest key of each.",
        "Correct `key`, or write a larger `queue_size` if one input's keys arrive much later.",
    )
    SLOWED = _of_messages(
        "slowed",
        _WARN,
        "The rate of an input is below 0.7 of the steady rate that it had, until it is back at 0.85.",
        "Check the publisher: its settings, its load, and the network to it.",
    )
    BURSTS = _of_messages(
        "bursts",
        _WARN,
        "Messages of an input are held up on their way and arrive at once; several inputs at once are one finding.",
        "Check whether the publisher sends in bursts, and the network to it: after a loss, reliable publishers send"
        " again only every 3 s by default, which configs/fast_heartbeats.xml shortens. Where several inputs are held up"
        " together, check whether this machine, a player or what connects them stood still.",
    )
    TIME_JUMP = _of_order(
        "time_jump",
        _ANY,
        "Stamps jumped back, as those of a looped recording do, and matching restarted: nothing to mend. Worse than ok"
        " if they jump back and forth.",
        "If they jump back and forth, check whether the publisher stamps by two clocks, or two nodes publish the"
        " topic.",
    )
    MESSAGES_LOST = _of_messages(
        "messages_lost",
        _WARN,
        "DDS lost messages on their way here.",
        "Check the network and the CPU load. If the publisher is reliable, `qos: auto` makes it resend them.",
    )
    OVER_SLOP = _of_matching(
        "over_slop",
        _WARN_OR_ERROR,
        "The nearest sets are wider than `slop` allows, or messages older than `max_age`.",
        "Write the `slop` (`max_age`) or the `offset` that is suggested: it was tried on the last messages, and the"
        " finding says how many sets each would give.",
    )
    SHORT_QUEUE = _of_matching(
        "short_queue",
        _WARN_OR_ERROR,
        "Messages overflowed before their partners came, and sets were missed.",
        "Write the `queue_size` that is suggested: it was tried on the last messages.",
    )
    WAITING_FOR_OPTIONAL = _of_matching(
        "waiting_for_optional",
        _OK_OR_WARN,
        "Sets leave without an optional input; why, where that was seen: it is silent, arrives too late, or its stamps"
        " fit no set.",
        "Check the publisher, or write what is suggested: a `max_wait`, a `slop` or an `offset` that was tried.",
    )
    CONSTANT_OFFSET = _of_matching(
        "constant_offset",
        _WARN,
        "Two inputs of one rate have stamps that lie a constant distance apart, so that sets hold messages of different"
        " moments.",
        "Check how the publisher stamps. If both are measured at the same time, write the `offset` that is suggested.",
    )
    OUT_OF_ORDER = _of_order(
        "out_of_order",
        _WARN,
        "Stamps of an input go back: messages arrive after one of a later stamp.",
        "Check how the publisher stamps and sends.",
    )
    DUPLICATES = _of_order(
        "duplicates",
        _WARN,
        "Stamps of an input repeat.",
        "Check how the publisher stamps its messages.",
    )
    FEW_SETS = _of_matching(
        "few_sets",
        _WARN_OR_ERROR,
        "Fewer than 80 % of the possible sets left in the last 10 s (longer where few are possible), until 95 % do"
        " again. One is possible for each message of the slowest required input, those included that it should have"
        " sent at its steady pace. An error after a silence, until half of the possible sets leave.",
        "Write what is suggested, if anything that was tried helps; the finding says what became of the messages, or"
        " whose did not come.",
    )
    SUBSCRIBER_QOS = _of_node(
        "subscriber_qos",
        _WARN,
        "A subscriber of an output requests what the relay cannot offer, and gets nothing.",
        "Have the subscriber request what is offered, or the input's publisher offer what is requested.",
    )
    OUTPUT_TAKEN = _of_node(
        "output_taken",
        _WARN,
        "Another node publishes an output too, as a second relay of the same file or a recording that is played.",
        "Stop all publishers but one, or give the output another name with `output`.",
    )
    UNEXPLAINED = _of_matching(
        "unexplained",
        _ERROR,
        "No set leaves, and none of the above is the reason; the finding says what became of the messages.",
        "Write what is suggested, or run `syncrelay doctor --config FILE --live`, which checks the graph and the"
        " stamps.",
    )
    STARTING = _of_node(
        "starting",
        (Severity.OK, Severity.WARN),
        "No set yet, none since an input came back a moment ago, or too few to judge; a warning after a silence.",
    )
    HEALTHY = _of_node(
        "healthy",
        _OK,
        "All is well: so many of the possible sets a second, with the 95th percentiles of span and latency.",
    )


def codes_of(*kinds: Of) -> frozenset[Code]:
    """Return the codes of the findings of these kinds."""
    return frozenset(code for code in Code if code.of in kinds)


MATCHING: Final = codes_of(Of.MATCHING)
"""What most causes explain: that messages do not match, or not enough of them."""
OF_RELAY: Final = frozenset(
    {Code.INACTIVE, Code.ALONE, Code.NO_CLOCK, Code.CLOCK_STOPPED, Code.TOO_SLOW, Code.CLOCK_STEP}
)
"""Findings that have one cause in all groups, where they are about no input."""
OF_PUBLISHER: Final = codes_of(Of.GRAPH, Of.MESSAGES, Of.ORDER)
"""Findings whose cause is the node that publishes an input, where they are about one: in all groups that use it."""
