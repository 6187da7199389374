"""`syncrelay --config FILE`: run the relay until SIGINT or SIGTERM."""

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from syncrelay.cli.heartbeat import VARIABLE, Heartbeat
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import UsageError


def run(
    config_path: str,
    groups: Sequence[str],
    log_level: str,
    log_format: str,
    ros_args: Sequence[str],
    *,
    stop: StopRequest,
) -> int:
    """Relay the groups of a file, all of them if `groups` is empty; 0 after an orderly end.

    Raises ConfigError for a faulty file, UsageError for a group that it lacks, RosUnavailableError where ROS
    cannot be used.
    """
    from syncrelay.config import Severity, load
    from syncrelay.ros.environment import require_rclpy
    from syncrelay.ros.logs import LOGGER, configure

    configure(log_level, log_format)
    config = load(config_path, package_missing=Severity.NOTE)
    _require_groups(groups, [group.name for group in config.groups], config_path)
    require_rclpy()
    from syncrelay.cli.summary import summarize
    from syncrelay.ros.relay import Relay

    stop.defer()
    with (
        _heartbeat(os.environ.get(VARIABLE)) as heartbeat,
        Relay(config, groups=groups or None, ros_args=ros_args, beat=heartbeat.beat if heartbeat else None) as relay,
    ):
        stop.wake_with(relay.wake)
        while not stop.requested:
            relay.step()
        for group in relay.drain().groups:
            for line in summarize(group):
                LOGGER.info(line, extra={"group": group.name})
    return 0


def _heartbeat(named: str | None) -> AbstractContextManager[Heartbeat | None]:
    from syncrelay.ros.logs import LOGGER

    if not named:
        return nullcontext()
    try:
        return Heartbeat(Path(named))
    except OSError as error:
        LOGGER.warning("%s=%s cannot be written, so there is no heartbeat: %s", VARIABLE, named, error.strerror)
        return nullcontext()


def _require_groups(asked: Sequence[str], there: Sequence[str], config_path: str) -> None:
    from syncrelay.config.wording import did_you_mean

    for name in asked:
        if name not in there:
            hint = did_you_mean(name, there)
            raise UsageError(f"--group {name}: {config_path} has no such group{hint}; it has {', '.join(there)}")
