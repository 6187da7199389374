"""What a running relay tells of itself."""

from dataclasses import dataclass
from enum import Enum

from syncrelay.explain import Endpoint, GroupReport, InputFacts


class Phase(Enum):
    """Where a relay is in its life. Unconfigured, inactive and finalized are only managed nodes.

    Observing is one that only looks, for as long as it lives.
    """

    UNCONFIGURED = "unconfigured"
    INACTIVE = "inactive"
    STARTING = "starting"
    OBSERVING = "observing"
    RUNNING = "running"
    PAUSED = "paused"
    DRAINING = "draining"
    FINALIZED = "finalized"


@dataclass(frozen=True, slots=True)
class RelayState:
    """A relay at one moment. `turned_s` is how long ago its receive loop last turned, `uptime_s` since its start.

    `receives_by` names the way by which messages are taken and published, `reloads` counts how often the file was
    reloaded, `refused_reloads` how often a reload failed, `reload_error` says why it last did.
    `unjudged` are groups that have no report, as before the first one.
    """

    node: str
    config: str
    phase: Phase
    uptime_s: float
    turned_s: float
    receives_by: str
    groups: tuple[GroupReport, ...]
    reloads: int = 0
    refused_reloads: int = 0
    reload_error: str | None = None
    unjudged: tuple[str, ...] = ()


class Level(Enum):
    """How a group fares, in DiagnosticStatus's words: STALE where nothing comes in at all."""

    OK = "ok"
    WARN = "warn"
    ERROR = "error"
    STALE = "stale"


def level(report: GroupReport) -> Level:
    """Return how a group fares."""
    facts = report.facts
    if facts.is_silent and not any(each.figures.rate_hz for each in facts.inputs):
        return Level.STALE
    return [Level.OK, Level.WARN, Level.ERROR][max(finding.severity for finding in report.findings)]


def advice(phase: Phase, node: str) -> str | None:
    """Say why a managed node gives nothing, and what to do; None where its state is no reason."""
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
    """Whether the relay runs or observes, is not paused, and every required input is served and let through."""
    inputs = [each for report in state.groups for each in report.facts.inputs if each.required]
    return (
        state.phase in (Phase.RUNNING, Phase.OBSERVING)
        and bool(state.groups)
        and not state.unjudged
        and all(report.facts.failure is None for report in state.groups)
        and all(_is_served(each) for each in inputs)
    )


def _is_served(an_input: InputFacts) -> bool:
    return an_input.graph.refusal is None and any(_serves(each, an_input.type) for each in an_input.graph.publishers)


def _serves(publisher: Endpoint, type_name: str | None) -> bool:
    return publisher.type == type_name and publisher.mismatch is None
