"""The whole examination, from the environment to the graph, in the order in which one thing rests on the other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from syncrelay.config import Config, ConfigError, Problem, TopicConfig, load
from syncrelay.doctor.config_file import check_files, check_remaps, check_types
from syncrelay.doctor.container import check_isolation
from syncrelay.doctor.diagnosis import Diagnosis, know, worst_first
from syncrelay.doctor.discovery import check_discovery, range_of
from syncrelay.doctor.folders import check_folders
from syncrelay.doctor.graph import check_clock, check_company, check_outputs, check_own_name, check_sizes, check_topics
from syncrelay.doctor.installation import Installation, check_installation, middleware_of
from syncrelay.doctor.listen import check_listen
from syncrelay.doctor.machine.discovery import look_at_discovery, look_at_transport
from syncrelay.doctor.machine.folders import look_at_folders
from syncrelay.doctor.machine.installation import look_at_installation
from syncrelay.doctor.machine.isolation import look_at_isolation
from syncrelay.doctor.machine.network import look_at_interfaces
from syncrelay.doctor.machine.shared_memory import look_at_shared_memory
from syncrelay.doctor.network import check_network
from syncrelay.doctor.shared_memory import check_shared_memory
from syncrelay.doctor.stamps import Matched, check_stamps
from syncrelay.doctor.start import check_start
from syncrelay.doctor.transport import check_transport, uses_defaults, uses_shared_memory
from syncrelay.environment.domain import domain_of
from syncrelay.ros.sighting import Sighting
from syncrelay.ros.trial import Plan, Trial, try_out


@dataclass(frozen=True, slots=True)
class Request:
    """What to examine: files that run together or none, ROS arguments as the relay's, how long to look at the graph."""

    environ: Mapping[str, str]
    heartbeat_variable: str
    files: tuple[str, ...] = ()
    ros_args: tuple[str, ...] = ()
    live_s: float | None = None


@dataclass(frozen=True, slots=True)
class Examination:
    """What was found, the worst first.

    `domain` is None where the environment names none that ROS takes; `path` is how messages would pass, direct or
    rclpy, empty where no node starts.
    """

    installation: Installation
    middleware: str
    domain: int | None
    discovery_range: str
    diagnoses: tuple[Diagnosis, ...]
    sighting: Sighting | None
    path: str = ""


def examine(request: Request) -> Examination:
    """Look at everything once."""
    environ = request.environ
    installation = look_at_installation(environ)
    found = list(check_installation(installation))
    middleware = middleware_of(installation)
    found += _surroundings(request, middleware)
    environment = tuple(found)
    config, problems = _load(request) if request.files else (None, ())
    found += check_files(request.files, problems)
    trial = try_out(_plan(config, problems, request.ros_args), environ) if installation.rclpy else None
    if trial is not None:
        found += check_start(trial, before=environment)
        found += _of_file(config, trial)
    sighting = None
    if request.live_s is not None:
        if trial is None or trial.failed is not None:
            found.append(_not_looked())
        else:
            sighting = _look(config, trial, seconds=request.live_s)
            found += _of_graph(sighting, config, trial, environ)
    return Examination(
        installation,
        middleware,
        domain_of(environ),
        range_of(environ),
        tuple(worst_first(found)),
        sighting,
        trial.path if trial is not None else "",
    )


def _surroundings(request: Request, middleware: str) -> Iterator[Diagnosis]:
    environ = request.environ
    interfaces = look_at_interfaces()
    yield from check_folders(look_at_folders(environ, heartbeat_variable=request.heartbeat_variable))
    yield from check_discovery(look_at_discovery(environ))
    yield from check_network(interfaces, discovery_range=range_of(environ), middleware=middleware)
    if "fastrtps" in middleware:
        yield from check_transport(look_at_transport(environ))
        yield from check_isolation(look_at_isolation(interfaces), environ)
        if uses_shared_memory(environ):
            yield from check_shared_memory(look_at_shared_memory(), domain=domain_of(environ))


def _load(request: Request) -> tuple[Config | None, Sequence[Problem]]:
    try:
        config = load(*request.files, environ=request.environ)
    except ConfigError as error:
        return None, error.problems
    return config, config.notes


def _plan(config: Config | None, problems: Sequence[Problem], ros_args: Sequence[str]) -> Plan:
    if config is None:
        return Plan(ros_args=tuple(ros_args))
    topics = [topic for group in config.groups for topic in group.topics]
    missing = {problem.text for problem in problems if problem.code == "package_missing"}
    types = dict.fromkeys(
        topic.type for topic in topics if not any(f"`{topic.type.partition('/')[0]}`" in text for text in missing)
    )
    return Plan(
        node=config.node.name,
        namespace=config.node.namespace,
        types=tuple(types),
        names=config.names.written,
        ros_args=tuple(ros_args),
        use_sim_time=config.node.use_sim_time,
    )


def _of_file(config: Config | None, trial: Trial) -> Iterator[Diagnosis]:
    if config is not None:
        yield from check_listen(config.listen)
        yield from check_types(config, trial.unusable)
        if trial.names:
            yield from check_remaps(config, trial.names)


def _not_looked() -> Diagnosis:
    return know(
        "not_looked",
        "the graph was not looked at, because no node starts here",
        so="--live could find nothing",
        do="mend what is above first",
    )


def _look(config: Config | None, trial: Trial, *, seconds: float) -> Sighting:
    from syncrelay.ros.environment import require_rclpy  # noqa: PLC0415  rclpy is imported where the graph is wanted

    require_rclpy()
    from syncrelay.ros.look import look  # noqa: PLC0415

    topics = [topic for group in (config.groups if config else ()) for topic in group.topics]
    outputs = [trial.names[topic.output] for topic in topics]
    return look(_topics(config, trial), outputs=outputs, seconds=seconds, use_sim_time=trial.use_sim_time)


def _of_graph(
    sighting: Sighting, config: Config | None, trial: Trial, environ: Mapping[str, str]
) -> Iterator[Diagnosis]:
    yield from check_company(sighting, domain=domain_of(environ) or 0, discovery_range=range_of(environ))
    if config is None:
        return
    yield from check_clock(sighting, use_sim_time=trial.use_sim_time)
    yield from check_own_name(sighting, trial.node)
    yield from check_outputs(sighting, trial.node)
    yield from check_topics(sighting, optional=_optional(config, trial))
    if config.node.transport == "default" and uses_defaults(environ):
        yield from check_sizes(sighting)
    yield from check_stamps(sighting.topics, _matched(config, trial))


def _topics(config: Config | None, trial: Trial) -> dict[str, TopicConfig]:
    groups = config.groups if config else ()
    topics: dict[str, TopicConfig] = {}
    for group in groups:
        for topic in group.topics:
            topics.setdefault(trial.names[topic.topic], topic)
    return topics


def _optional(config: Config, trial: Trial) -> frozenset[str]:
    topics = [topic for group in config.groups for topic in group.topics]
    required = {trial.names[topic.topic] for topic in topics if topic.required}
    return frozenset(trial.names[topic.topic] for topic in topics) - required


def _matched(config: Config, trial: Trial) -> list[Matched]:
    return [
        Matched(
            group.name,
            {trial.names[topic.topic]: topic.offset_ns for topic in group.topics if topic.stamp != "receive"},
        )
        for group in config.groups
        if all(topic.key is None for topic in group.topics)
    ]
