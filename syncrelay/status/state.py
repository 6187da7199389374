"""What a running relay knows of itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from syncrelay.explain import GroupFacts, GroupReport, InputFacts


class Phase(Enum):
    """Where a relay is in its life. Only managed nodes are unconfigured, inactive or finalized.

    `observing` is a process that publishes nothing, for as long as it runs.
    """

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    STARTING = "starting"
    OBSERVING = "observing"
    RUNNING = "running"
    PAUSED = "paused"
    DRAINING = "draining"
    FINALIZED = "finalized"


class Level(Enum):
    """The state of a group in DiagnosticStatus's words: STALE where nothing comes in at all."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"
    STALE = "stale"


@dataclass(frozen=True, slots=True)
class RelayState:
    """A relay at one moment; fields that the status has too are documented there."""

    node: str
    config: str
    phase: Phase
    uptime_s: float
    turned_s: float
    """How long ago the receive loop last turned."""
    receives_by: str
    groups: tuple[GroupReport, ...]
    reloads: int = 0
    refused_reloads: int = 0
    reload_error: str | None = None
    unjudged: tuple[str, ...] = ()
    """Groups without a report, as all are before the first one."""
    ready_share: float | None = None
    """The share of its possible sets that each group gives where the relay is ready; None if that does not matter."""
    published_by: Mapping[str, str] = field(default_factory=dict)
    """Which node publishes a topic, or did when it was last seen."""


def level(report: GroupReport) -> Level:
    """Return the state of a group."""
    facts = report.facts
    if facts.is_silent and not any(each.figures.rate_hz for each in facts.inputs):
        return Level.STALE
    return [Level.OK, Level.WARN, Level.ERROR][max(finding.severity for finding in report.findings)]


def advice(phase: Phase, node: str) -> str | None:
    """Say why a managed node publishes nothing and what to do; None in phases in which it should."""
    match phase:
        case Phase.UNCONFIGURED:
            return f"the node is unconfigured: configure it with `ros2 lifecycle set {node} configure`"
        case Phase.INACTIVE:
            return f"the node is inactive: activate it with `ros2 lifecycle set {node} activate`"
        case Phase.FINALIZED:
            return "the node is finalized: only a restart of its process brings it back"
        case _:
            return None


def is_ready(state: RelayState) -> bool:
    """Whether the relay runs or observes, is not paused, every required input is served, and all is let through.

    Where the file asks for it, also whether every group that is awake gives its share of the possible sets.
    """
    inputs = [each for report in state.groups for each in report.facts.inputs if each.required]
    return (
        state.phase in (Phase.RUNNING, Phase.OBSERVING)
        and bool(state.groups)
        and not state.unjudged
        and not any(report.facts.failure or _is_unbundled(report.facts) for report in state.groups)
        and all(_is_served(each) for each in inputs)
        and (state.ready_share is None or all(_gives(report, state.ready_share) for report in state.groups))
    )


def _is_unbundled(facts: GroupFacts) -> bool:
    return facts.bundle is not None and facts.bundle.refusal is not None


def _gives(report: GroupReport, least: float) -> bool:
    share = report.facts.figures.share.value
    return report.facts.asleep or (share is not None and share >= least)


def _is_served(an_input: InputFacts) -> bool:
    publishers = an_input.graph.publishers
    fits = any(each.type == an_input.type and each.mismatch is None for each in publishers)
    return fits and an_input.graph.refusal is None
