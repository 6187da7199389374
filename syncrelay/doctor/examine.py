"""The whole examination, from the environment to the graph: each step rests on those before."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config import Config, ConfigError, Problem, load
from syncrelay.config.interfaces import Interfaces
from syncrelay.doctor.config_file import check_files, check_listen, check_remaps, check_types
from syncrelay.doctor.container import check_isolation, look_at_isolation
from syncrelay.doctor.diagnosis import Diagnosis, info, worst_first
from syncrelay.doctor.discovery import check_discovery
from syncrelay.doctor.folders import check_folders
from syncrelay.doctor.graph import (
    check_clock,
    check_domains,
    check_graph,
    check_groups,
    check_own_name,
    check_sizes,
    check_state,
)
from syncrelay.doctor.installation import Installation, check_installation, look_at_installation, middleware_of
from syncrelay.doctor.network import check_network, look_at_interfaces
from syncrelay.doctor.shared_memory import check_shared_memory, look_at_shared_memory
from syncrelay.doctor.start import Plan, StartResult, check_start, start_node
from syncrelay.doctor.transport import check_transport, uses_defaults, uses_shared_memory
from syncrelay.environment.domain import domain_of, domains_in_use, range_of
from syncrelay.explain import GraphSnapshot, GroupReport

# Of a managed node that does not answer nothing is known.
_PATIENCE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Observed:
    """What a look at the graph gave; `unjudged` are groups without a report.

    `state` is that of the managed node that has the relay's name, None where there is none.
    """

    seconds: float
    graph: GraphSnapshot
    reports: tuple[GroupReport, ...] = ()
    unjudged: tuple[str, ...] = ()
    state: str | None = None


@dataclass(frozen=True, slots=True)
class Examination:
    """What was found, the worst first.

    `domain` is None where the environment names none that ROS takes; `path` is how messages would pass, a
    BackendName, empty where no node starts or that cannot be had.
    """

    installation: Installation
    middleware: str
    domain: int | None
    discovery_range: str
    diagnoses: tuple[Diagnosis, ...]
    observed: Observed | None
    path: str = ""


def examine(
    environ: Mapping[str, str], *, files: Sequence[str] = (), ros_args: Sequence[str] = (), live_s: float | None = None
) -> Examination:
    """Look at everything once: files that run together, with the relay's ROS arguments, and the graph for a while."""
    installation = look_at_installation(environ)
    found = list(check_installation(installation))
    middleware = middleware_of(installation)
    found += _surroundings(environ, middleware)
    environment = tuple(found)
    config, problems = _load(files, environ) if files else (None, ())
    found += check_files(files, problems)
    started = start_node(_plan(config, environ, ros_args), environ) if installation.rclpy else None
    if started is not None:
        found += check_start(started, before=environment)
        found += _of_file(config, started)
    observed = None
    if live_s is not None:
        if started is not None and started.failed is None:
            observed = _observe(config, ros_args, started.node, seconds=live_s)
        if started is None or observed is None:
            found.append(
                info(
                    "not_looked",
                    "--live did not look at the graph, because the relay cannot start here",
                    impact="problems in the graph are not shown",
                    fix="fix the errors above first",
                )
            )
        else:
            found += _of_graph(observed, config, started, environ)
    return Examination(
        installation,
        middleware,
        domain_of(environ),
        range_of(environ),
        tuple(worst_first(found)),
        observed,
        started.path if started is not None else "",
    )


def _surroundings(environ: Mapping[str, str], middleware: str) -> Iterator[Diagnosis]:
    interfaces = look_at_interfaces()
    yield from check_folders(environ)
    yield from check_discovery(environ)
    yield from check_network(interfaces, discovery_range=range_of(environ), middleware=middleware)
    if "fastrtps" in middleware:
        yield from check_transport(environ)
        yield from check_isolation(look_at_isolation(interfaces), environ)
        if uses_shared_memory(environ):
            yield from check_shared_memory(look_at_shared_memory(), domain=domain_of(environ))


def _load(files: Sequence[str], environ: Mapping[str, str]) -> tuple[Config | None, Sequence[Problem]]:
    try:
        config = load(*files, environ=environ)
    except ConfigError as error:
        return None, error.problems
    return config, config.notes


def _plan(config: Config | None, environ: Mapping[str, str], ros_args: Sequence[str]) -> Plan:
    if config is None:
        return Plan(ros_args=tuple(ros_args))
    installed = Interfaces.find(environ)
    types = dict.fromkeys(topic.type for group in config.groups for topic in group.topics)
    return Plan(
        node=config.node.name,
        namespace=config.node.namespace,
        # What lacks its package is the file check's to say.
        types=tuple(
            each for each in types if each and (installed is None or each.partition("/")[0] in installed.packages)
        ),
        names=config.names.written,
        ros_args=tuple(ros_args),
        use_sim_time=config.node.use_sim_time,
    )


def _of_file(config: Config | None, started: StartResult) -> Iterator[Diagnosis]:
    if config is not None:
        yield from check_listen(config.listen)
        yield from check_types(config, started.unusable)
        if started.names:
            yield from check_remaps(config, started.names)


def _observe(config: Config | None, ros_args: Sequence[str], node: str, *, seconds: float) -> Observed | None:
    """Observe the groups as `observe` does, or the graph alone; None where remaps make names of the file meet."""
    from syncrelay.ros.environment import require_rclpy  # noqa: PLC0415  rclpy is imported where the graph is wanted

    require_rclpy()
    from syncrelay.relay.graph import snapshot  # noqa: PLC0415
    from syncrelay.relay.look import look  # noqa: PLC0415
    from syncrelay.relay.ports import Purpose  # noqa: PLC0415
    from syncrelay.relay.relay import Relay  # noqa: PLC0415
    from syncrelay.ros.joining import joined, watch_graph  # noqa: PLC0415
    from syncrelay.ros.lifecycle import state_of  # noqa: PLC0415

    if config is None:
        return Observed(seconds, watch_graph(seconds=seconds))
    try:
        own, backend = joined(config, ros_args=ros_args, purpose=Purpose.OBSERVE)
        relay = Relay(config, own, backend, purpose=Purpose.OBSERVE)
    except ConfigError:
        return None
    with relay:
        reports = look(relay, seconds)
        graph = snapshot(own)
        is_there = config.node.lifecycle and node in graph.nodes
        state = state_of(own.raw, node, patience_s=_PATIENCE_S) if is_there else None
        return Observed(seconds, graph, reports, relay.monitor.unjudged, state)


def _of_graph(
    observed: Observed, config: Config | None, started: StartResult, environ: Mapping[str, str]
) -> Iterator[Diagnosis]:
    yield from check_graph(observed.graph)
    yield from check_domains(observed.graph, observed.reports, domains_in_use())
    if config is None:
        return
    yield from check_clock(observed.graph, use_sim_time=started.use_sim_time)
    yield from check_own_name(observed.graph, started.node)
    yield from check_state(observed.state, started.node)
    yield from check_groups(observed.reports, observed.unjudged)
    if config.node.transport == "default" and uses_defaults(environ):
        yield from check_sizes(observed.reports)
