"""`syncrelay --config FILE`: run the relay until SIGINT or SIGTERM."""

import os
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from syncrelay import own_version
from syncrelay.cli.boundary import DONE, EXIT_CODES, put
from syncrelay.cli.healthcheck import VARIABLE, Heartbeat
from syncrelay.cli.parser import Parser, folded
from syncrelay.cli.stop import StopRequest
from syncrelay.collector import resting_collector
from syncrelay.errors import ListenError, UsageError

if TYPE_CHECKING:
    from syncrelay.config import Config, Listen
    from syncrelay.relay.ports import Outcome
    from syncrelay.relay.relay import Relay
    from syncrelay.status.server import Server


def parser(*, with_all_commands: bool = False) -> Parser:
    from syncrelay.cli.commands import commands_help

    exit_codes = f"exit codes: {', '.join(f'{code} {means}' for code, means in EXIT_CODES.items())}"
    parser = Parser(
        "syncrelay",
        example="syncrelay --config fusion.yaml",
        description="Matches ROS 2 messages by time, as a YAML file says, and republishes the sets.",
        usage="syncrelay --config FILE [option ...] | syncrelay COMMAND ...",
        epilog=f"{commands_help(are_all=with_all_commands)}\n\n{folded(exit_codes)}",
    )
    parser.add_repeatable("--config", metavar="FILE", help="run groups of FILE, or a directory")
    parser.add_repeatable("--group", metavar="NAME", help="run this group only")
    add = parser.add_argument
    add("--watch", action="store_true", help="read FILE again when it changes, not only at SIGHUP")
    add(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="info",
        metavar="LEVEL",
        help="debug, info (default), warning or error",
    )
    add("--log-format", choices=("text", "json"), default="text", metavar="FORMAT", help="text (default) or json")
    add("--ros-args", action="store_true", help="pass what follows to ROS, such as -r __ns:=/robot1")
    add("--version", action="store_true", help="print the version")
    add("--all", action="store_true", help="with --help: name all commands")
    return parser


def command(parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay --config FILE`: relay its groups until stopped, reading it again at SIGHUP; or answer --version.

    Returns 0 after an orderly end. Raises ConfigError for a faulty file, UsageError for a group that it lacks,
    RosUnavailableError where ROS cannot be used.
    """
    if arguments.version:
        put(f"syncrelay {own_version()}")
        return DONE
    if arguments.all:
        parser.error("--all goes with --help")
    if not arguments.config:
        parser.error("--config FILE is missing")
    parser.refuse_repeated(arguments.config)
    config_paths, groups = arguments.config, arguments.group
    with resting_collector():
        from syncrelay.config.rereading import ConfigFiles
        from syncrelay.logs import LOGGER, configure
        from syncrelay.ros.environment import require_rclpy

    configure(arguments.log_level, arguments.log_format)
    # Made before the files are read, so that changes during the start of the relay are seen.
    files = ConfigFiles(config_paths, watched=arguments.watch)
    config = loaded(config_paths, groups)
    require_rclpy()
    with resting_collector():
        from syncrelay.explain.summary import log_summary
        from syncrelay.relay.relay import Relay
        from syncrelay.relay.running import run, services
        from syncrelay.ros.joining import joined

    def require(config: "Config") -> None:
        require_groups(groups, config, config_paths)

    def managed(relay: Relay) -> "Callable[[str], Outcome]":
        from syncrelay.relay.transitions import Transitions

        return Transitions(relay, paths=config_paths, require=require, is_stopped=lambda: stop.requested).carry_out

    stop.defer()
    with (
        _heartbeat(os.environ.get(VARIABLE)) as heartbeat,
        listening(config.listen) as server,
        Relay(
            config,
            *joined(config, ros_args=arguments.ros_args, is_managed=config.node.lifecycle),
            config_paths=config_paths,
            groups=groups or None,
            on_turn=heartbeat.beat if heartbeat else None,
            manage=managed if config.node.lifecycle else None,
        ) as relay,
        files,
    ):
        stop.wake_with(relay.wake)
        files.call_when_read(relay.wake)
        if server is not None:
            server.serve(relay.state, relay.taps)
            LOGGER.info(
                "status and metrics: http://%s/; open that in a browser, or watch with `syncrelay top --url %s`",
                server.place,
                server.place.url,
            )
        if config.node.services:
            relay.offer(services(relay, files, lambda: _status(relay)))
        run(relay, files, stop, require=require)
        log_summary(relay.drain())
    return DONE


def loaded(config_paths: Sequence[str], groups: Sequence[str]) -> "Config":
    """Read files as the relay does, log warnings about them, and return their configuration.

    Raises ConfigError for a faulty file, UsageError where they lack one of these groups.
    """
    with resting_collector():
        from syncrelay.config import Severity, load, where
        from syncrelay.logs import LOGGER

    config = load(*config_paths)
    for note in config.notes:
        if note.severity is Severity.WARNING:
            LOGGER.warning("%s: %s: %s", where(note), note.path, note.text)
    require_groups(groups, config, config_paths)
    return config


def _status(relay: "Relay") -> str:
    # Imported when it is first asked for, which may be never.
    from syncrelay.status.as_document import status_of
    from syncrelay.top.plain import summary

    return summary(status_of(relay.state()))


def _heartbeat(named: str | None) -> AbstractContextManager[Heartbeat | None]:
    from syncrelay.logs import LOGGER

    if not named:
        return nullcontext()
    try:
        return Heartbeat(Path(named))
    except OSError as error:
        LOGGER.warning("%s=%s cannot be written, so there is no heartbeat: %s", VARIABLE, named, error.strerror)
        return nullcontext()


def listening(listen: "Listen | None") -> "AbstractContextManager[Server | None]":
    """Return a server on the file's port; None if the file names none and the default ports are taken.

    Raises ListenError if the port that the file names cannot be used.
    """
    if listen is None:
        return nullcontext()
    from syncrelay.logs import LOGGER
    from syncrelay.status.server import Server

    try:
        return Server(listen)
    except ListenError as error:
        if listen.is_asked_for:
            raise
        LOGGER.warning("not serving /status and /metrics: %s", error)
        return nullcontext()


def require_groups(asked: Sequence[str], config: "Config", config_paths: Sequence[str]) -> None:
    """Raise UsageError if files lack one of these groups."""
    from syncrelay.config.wording import did_you_mean

    there = [group.name for group in config.groups]
    for name in asked:
        if name not in there:
            hint, files = did_you_mean(name, there) or f"; it has {', '.join(there)}", ", ".join(config_paths)
            raise UsageError(f"--group {name}: {files} has no such group{hint}")
