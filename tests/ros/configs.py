"""Configuration files of the tests, as text."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

# No test of matching may lose a message to DDS: every input keeps what the relay has not yet taken.
LOSSLESS: Mapping[str, Any] = {"reliability": "reliable", "history": "keep_all"}
# Nor may a queue overflow: then the sets depend on stamps alone, and not on how far one topic lags behind another on
# a busy machine, or where DDS has to send again (tests/sync/test_interleaving.py).
ROOMY = 10_000


def config(groups: Mapping[str, Mapping[str, Any]], **keys: Any) -> str:
    """A file's text; JSON is YAML."""
    return json.dumps({"version": 1, **keys, "groups": groups}, indent=2)


def inputs(topics: Mapping[str, str], **keys: Any) -> list[dict[str, Any]]:
    """The `topics` of a group: each topic with its type, and all with these keys beside."""
    return [{"topic": topic, "type": type_name, **keys} for topic, type_name in topics.items()]


def outputs(group: str, topics: Iterable[str]) -> list[str]:
    """The default names of a group's outputs, in the order of its inputs."""
    return [f"/{group}{topic}" for topic in topics]
