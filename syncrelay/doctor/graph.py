"""The graph: who is there, who has the relay's name, and what the relay's own judge finds in the groups of the file."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from syncrelay.config.wording import all_of
from syncrelay.doctor.diagnosis import Diagnosis, Severity, error, info
from syncrelay.environment.domain import ports_of
from syncrelay.explain import RUN_DOCTOR, Code, Finding, GraphSnapshot, GroupReport, no_other_node
from syncrelay.explain import Severity as Judged

_SEVERITIES: Final = {Judged.WARN: Severity.WARNING, Judged.ERROR: Severity.ERROR}
# In place of the end of advice that leads here.
_NEXT: Final = (
    ", on its own machine, in its own container and as its own user;\nif so, messages get lost on the way: export"
    " FASTDDS_BUILTIN_TRANSPORTS=UDPv4 on both sides, and restart both"
)
_AGAIN: Final = "run it again with a larger --seconds"
# Fast DDS's shared memory by default, in bytes: a message has to fit into it as a whole.
_SEGMENT: Final = 512 * 1024


def check_graph(graph: GraphSnapshot) -> Iterator[Diagnosis]:
    """Yield that nobody is there, or that nothing arrives from some who are."""
    if graph.n_unreached:
        ports = ports_of(graph.domain)
        yield error(
            "unreachable",
            f"1 topic on domain {graph.domain} has a publisher whose node is not known"
            if graph.n_unreached == 1
            else f"{graph.n_unreached} topics on domain {graph.domain} have publishers whose nodes are not known",
            impact="discovery found these publishers, but nothing that they send arrives, not even their nodes' names",
            fix="if they run on this machine, in another container or as another user, on both sides:\n"
            "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4    and restart them;\n"
            f"if on another machine: let UDP ports {ports[0]} to {ports[-1]} through both firewalls",
        )
    elif not graph.nodes:
        yield error(
            "alone",
            no_other_node(graph),
            impact="nothing can be received here",
            fix="start the robot's nodes; if they are running, compare ROS_DOMAIN_ID, RMW_IMPLEMENTATION and\n"
            "ROS_AUTOMATIC_DISCOVERY_RANGE on both sides, and try a larger --seconds",
        )


def check_domains(graph: GraphSnapshot, reports: Iterable[GroupReport], in_use: Iterable[int]) -> Iterator[Diagnosis]:
    """Yield that nodes of this machine are on other domains, where somebody is missing on this one."""
    others = [str(each) for each in sorted({*in_use} - {graph.domain})]
    is_missing = not graph.nodes or any(not each.graph.publishers for one in reports for each in one.facts.inputs)
    if others and is_missing:
        yield info(
            "other_domain",
            f"nodes of this machine are on {'domain' if len(others) == 1 else 'domains'} {all_of(others)}",
            impact=f"whoever looks on domain {graph.domain} does not find them",
            fix="if one of them should be found here, start it with the same ROS_DOMAIN_ID",
        )


def check_own_name(graph: GraphSnapshot, node: str) -> Iterator[Diagnosis]:
    """Yield that others have the name of the relay's node."""
    count = graph.nodes.count(node)
    if count == 1:
        yield info(
            "node_name",
            f"a node named {node} is already running",
            impact="if that is this relay, all is well; a second one beside it would send every set twice",
            fix="nothing; or give this one a name of its own: node: {name: ...} in the file",
        )
    elif count > 1:
        yield error(
            "node_name",
            f"{count} nodes are named {node}",
            impact="each of them sends every set, and a request to the node reaches any one of them",
            fix="stop all but one, or give each a name of its own: node: {name: ...} in the file",
        )


def check_state(state: str | None, node: str) -> Iterator[Diagnosis]:
    """Yield that a managed node of the relay's name is not active; `state` is what it says, None where it is none."""
    # It brings what serves HTTP, which an installation that is examined may lack.
    from syncrelay.status import Phase, advice  # noqa: PLC0415

    phase = next((each for each in Phase if each.value == state), None)
    if phase is not None and (what := advice(phase, node)) is not None:
        text, _, fix = what.partition(": ")
        yield Diagnosis("inactive", Severity.WARNING, f"{node}: {text}", "no set leaves", fix)


def check_clock(graph: GraphSnapshot, *, use_sim_time: bool) -> Iterator[Diagnosis]:
    """Yield that there is a /clock that the file does not use."""
    if graph.has_clock and not use_sim_time:
        yield info(
            "clock_unused",
            "/clock is published, and use_sim_time is not set",
            impact="stamps are matched all the same; only max_wait and a `trigger: 30 Hz` go by this machine's clock",
            fix="with a simulation or a bag, write into the file: node: {use_sim_time: true}",
        )


def check_groups(reports: Sequence[GroupReport], unjudged: Sequence[str]) -> Iterator[Diagnosis]:
    """Yield the problems of all groups, those that several groups share once.

    That a group has sent no set yet is one too. `unjudged` are groups without a report. Left out is what `check_graph`
    says of the whole graph, and `check_types` of types.
    """
    found: dict[tuple[Code, str, str | None], list[tuple[GroupReport, Finding]]] = {}
    for report in reports:
        for finding in report.findings:
            if finding.severity in _SEVERITIES or finding.code is Code.STARTING:
                found.setdefault((finding.code, finding.text, finding.suggestion), []).append((report, finding))
    for shared in found.values():
        if not any(_is_said_elsewhere(report, finding) for report, finding in shared):
            yield _diagnosis(shared)
    for name in unjudged:
        yield Diagnosis(
            "internal_error",
            Severity.ERROR,
            f"{name}: a bug in syncrelay keeps this group from being judged",
            None,
            "report it with what `syncrelay observe --config FILE --seconds 5` prints",
        )


def _is_said_elsewhere(report: GroupReport, finding: Finding) -> bool:
    if finding.code is Code.SILENT and finding.input is not None:
        return not any(each.is_named for each in report.facts.inputs[finding.input].graph.publishers)
    return finding.code in (Code.ALONE, Code.TYPE_NOT_IMPORTABLE)


def _diagnosis(shared: Sequence[tuple[GroupReport, Finding]]) -> Diagnosis:
    finding = max((each for _, each in shared), key=lambda each: each.severity)
    names = all_of(report.facts.name for report, _ in shared)
    is_fatal = finding.severity is Judged.ERROR and all(report.facts.is_silent for report, _ in shared)
    return Diagnosis(
        finding.code.value,
        _SEVERITIES.get(finding.severity, Severity.WARNING),
        f"{names}: {finding.text}",
        f"no sets from {names}" if is_fatal else None,
        _AGAIN if finding.code is Code.STARTING else (finding.suggestion or "").replace(RUN_DOCTOR, _NEXT) or None,
    )


def check_sizes(reports: Iterable[GroupReport]) -> Iterator[Diagnosis]:
    """Yield the topics whose messages do not fit into the shared memory that Fast DDS takes by default."""
    sizes = {each.name: each.graph.largest for report in reports for each in report.facts.inputs}
    large = {name: size for name, size in sizes.items() if size > _SEGMENT}
    if large:
        yield info(
            "large_messages",
            f"messages of {all_of(f'{name} ({size / 1e6:.1f} MB)' for name, size in large.items())} are larger than"
            " Fast DDS's default shared memory of 0.5 MB",
            impact="on one machine they take ten times as long as they could, and some are lost",
            fix="for the relay, write into the file: node: {transport: large_messages}\n"
            "for every other process: export FASTRTPS_DEFAULT_PROFILES_FILE=.../configs/large_messages.xml",
        )
