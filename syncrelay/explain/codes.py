"""Every finding: its code, what it is of, and how bad it is."""

from enum import Enum, IntEnum, auto
from typing import Final, Self


class Severity(IntEnum):
    """How bad it is: nothing to mend, sets suffer, no sets come."""

    OK = 0
    WARN = 1
    ERROR = 2


_OK: Final = (Severity.OK,)
_WARN: Final = (Severity.WARN,)
_ERROR: Final = (Severity.ERROR,)
_OK_OR_WARN: Final = (Severity.OK, Severity.WARN)
_WARN_OR_ERROR: Final = (Severity.WARN, Severity.ERROR)
_ANY: Final = tuple(Severity)


class Of(Enum):
    """What a finding is of: the node, what the graph shows, what messages tell, their order, how they match."""

    NODE = auto()
    GRAPH = auto()
    MESSAGES = auto()
    ORDER = auto()
    MATCHING = auto()


class Code(Enum):
    """What a finding is, for programs. In the order in which findings explain a silence.

    `of` is its kind, `severities` are those that it is found with. What a finding explains is said by
    `syncrelay.explain.judge`, as it spans several, and what it means by its section in
    docs/generate/templates/findings.md.jinja.
    """

    # As that of DropReason: Enum's own hash is Python code.
    __hash__ = object.__hash__

    _value_: str
    of: Of
    severities: tuple[Severity, ...]

    # The defaults are for type checkers, which take Code("alone") for a call of this.
    def __new__(cls, code: str, of: Of = Of.NODE, severities: tuple[Severity, ...] = ()) -> Self:
        """Return the member whose value is the code alone."""
        member = object.__new__(cls)
        member._value_ = code
        member.of, member.severities = of, severities
        return member

    INTERNAL_ERROR = "internal_error", Of.NODE, _ERROR
    INACTIVE = "inactive", Of.NODE, _WARN
    PAUSED = "paused", Of.NODE, _WARN
    REFUSED_BY_DDS = "refused_by_dds", Of.NODE, _WARN_OR_ERROR
    NO_BUNDLE = "no_bundle", Of.NODE, _WARN_OR_ERROR
    TYPE_NOT_IMPORTABLE = "type_not_importable", Of.GRAPH, _WARN_OR_ERROR
    OTHER_TYPE = "other_type", Of.GRAPH, _WARN_OR_ERROR
    SEVERAL_TYPES = "several_types", Of.GRAPH, _WARN_OR_ERROR
    ALONE = "alone", Of.GRAPH, _WARN_OR_ERROR
    NO_PUBLISHER = "no_publisher", Of.GRAPH, _ANY
    INCOMPATIBLE_QOS = "incompatible_qos", Of.GRAPH, _WARN_OR_ERROR
    NOBODY_LISTENS = "nobody_listens", Of.GRAPH, _OK
    NO_CLOCK = "no_clock", Of.GRAPH, _WARN_OR_ERROR
    CLOCK_STOPPED = "clock_stopped", Of.MESSAGES, _WARN_OR_ERROR
    TOO_SLOW = "too_slow", Of.MESSAGES, _WARN
    SILENT = "silent", Of.MESSAGES, _ANY
    MALFORMED = "malformed", Of.MESSAGES, _WARN_OR_ERROR
    UNSTAMPED = "unstamped", Of.MESSAGES, _WARN_OR_ERROR
    SEVERAL_PUBLISHERS = "several_publishers", Of.MESSAGES, _WARN_OR_ERROR
    CLOCK_STEP = "clock_step", Of.MESSAGES, _WARN_OR_ERROR
    CLOCK_DRIFT = "clock_drift", Of.MESSAGES, _WARN
    OTHER_CLOCK = "other_clock", Of.MESSAGES, _WARN_OR_ERROR
    NO_COMMON_KEY = "no_common_key", Of.MATCHING, _ERROR
    SLOWED = "slowed", Of.MESSAGES, _WARN
    BURSTS = "bursts", Of.MESSAGES, _WARN
    TIME_JUMP = "time_jump", Of.ORDER, _ANY
    MESSAGES_LOST = "messages_lost", Of.MESSAGES, _WARN
    OVER_SLOP = "over_slop", Of.MATCHING, _WARN_OR_ERROR
    SHORT_QUEUE = "short_queue", Of.MATCHING, _WARN_OR_ERROR
    WAITING_FOR_OPTIONAL = "waiting_for_optional", Of.MATCHING, _OK_OR_WARN
    NO_TRANSFORM = "no_transform", Of.MATCHING, _WARN_OR_ERROR
    CONSTANT_OFFSET = "constant_offset", Of.MATCHING, _WARN
    OUT_OF_ORDER = "out_of_order", Of.ORDER, _WARN
    DUPLICATES = "duplicates", Of.ORDER, _WARN
    FEW_SETS = "few_sets", Of.MATCHING, _WARN_OR_ERROR
    SUBSCRIBER_QOS = "subscriber_qos", Of.NODE, _WARN
    OUTPUT_TAKEN = "output_taken", Of.NODE, _WARN
    UNEXPLAINED = "unexplained", Of.MATCHING, _ERROR
    STARTING = "starting", Of.NODE, _OK_OR_WARN
    HEALTHY = "healthy", Of.NODE, _OK


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
