"""The graph as a whole: whether anyone is there, whether their messages arrive, and who has the relay's name."""

from collections.abc import Iterator

from syncrelay.doctor.diagnosis import Diagnosis, Severity, error, info
from syncrelay.doctor.discovery import ports_of
from syncrelay.explain import GraphSnapshot, no_other_node


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
