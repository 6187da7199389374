"""The relay's log on stderr, as text or JSON."""

import json
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from logging.handlers import MemoryHandler

from syncrelay.printable import one_entry

LOGGER = logging.getLogger("syncrelay")

_ROS_LEVELS = {"WARNING": "WARN", "CRITICAL": "FATAL"}
# Lines; more than that, and something else is wrong.
_MOST_HELD = 1000


class _TextFormatter(logging.Formatter):
    """As ROS prints it, so that it reads on in a launch's output; no line but the first of a record looks like that."""

    def format(self, record: logging.LogRecord) -> str:
        level = _ROS_LEVELS.get(record.levelname, record.levelname)
        source = getattr(record, "node", record.name)
        text = f"[{level}] [{record.created:.3f}] [{source}]: {record.getMessage()}"
        return one_entry(f"{text}\n{self.formatException(record.exc_info)}" if record.exc_info else text)


class _JsonFormatter(logging.Formatter):
    """One object a line: time (ISO 8601, UTC), level, logger, message; group, groups and finding where meant."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, tz=UTC).isoformat(),
            "level": record.levelname.lower(),
            "logger": getattr(record, "node", record.name),
            "message": record.getMessage(),
        }
        for key in ("group", "groups", "finding"):
            if value := getattr(record, key, None):
                line[key] = value
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


def name_after(node_name: str) -> None:
    """Name the node in all lines from now on, to distinguish two relays of a launch."""

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


@contextmanager
def held_back() -> Iterator[None]:
    """Keep the log off a picture; it comes out at the end."""
    shown = list(LOGGER.handlers)
    held = [MemoryHandler(_MOST_HELD, flushLevel=sys.maxsize, target=handler) for handler in shown]
    LOGGER.handlers[:] = held
    try:
        yield
    finally:
        LOGGER.handlers[:] = shown
        for handler in held:
            handler.close()
