"""The relay's talk: on stderr as text or JSON, and on /rosout for those who watch there."""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Any

LOGGER = logging.getLogger("syncrelay")


_ROS_LEVELS = {"WARNING": "WARN", "CRITICAL": "FATAL"}


class _TextFormatter(logging.Formatter):
    """As ROS prints it, so that it reads on in a launch's output."""

    def format(self, record: logging.LogRecord) -> str:
        level = _ROS_LEVELS.get(record.levelname, record.levelname)
        source = getattr(record, "node", record.name)
        text = f"[{level}] [{record.created:.3f}] [{source}]: {record.getMessage()}"
        return f"{text}\n{self.formatException(record.exc_info)}" if record.exc_info else text


class _JsonFormatter(logging.Formatter):
    """One object a line: time (ISO 8601, UTC), level, logger, message; group and finding where one is meant."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, tz=UTC).isoformat(),
            "level": record.levelname.lower(),
            "logger": getattr(record, "node", record.name),
            "message": record.getMessage(),
        }
        for key in ("group", "finding"):
            if value := getattr(record, key, None):
                line[key] = value
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


class RosoutHandler(logging.Handler):
    """Passes records on to a node's logger, which publishes them on /rosout and writes ROS's log file."""

    def __init__(self, node_logger: Any) -> None:
        super().__init__()
        # rclpy refuses two severities from one line of code, hence a line for each.
        self._emit_at = {
            logging.DEBUG: lambda text: node_logger.debug(text),  # noqa: PLW0108
            logging.INFO: lambda text: node_logger.info(text),  # noqa: PLW0108
            logging.WARNING: lambda text: node_logger.warning(text),  # noqa: PLW0108
            logging.ERROR: lambda text: node_logger.error(text),  # noqa: PLW0108
            logging.CRITICAL: lambda text: node_logger.fatal(text),  # noqa: PLW0108
        }

    def emit(self, record: logging.LogRecord) -> None:
        try:
            self._emit_at.get(record.levelno, self._emit_at[logging.INFO])(record.getMessage())
        except Exception:  # noqa: BLE001  whoever logs goes on, as with every handler of logging
            self.handleError(record)


def name_after(node_name: str) -> None:
    """Have all lines from now on bear a node's name, which tells two relays of a launch apart."""

    def name(record: logging.LogRecord) -> bool:
        record.node = node_name
        return True

    for handler in LOGGER.handlers:
        handler.addFilter(name)


def configure(level: str, log_format: str) -> None:
    """Send the relay's log to stderr; `level` as in logging, `log_format` is `text` or `json`."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_JsonFormatter() if log_format == "json" else _TextFormatter())
    LOGGER.handlers = [handler]
    LOGGER.setLevel(level.upper())
    LOGGER.propagate = False
