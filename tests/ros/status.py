"""What a running relay says over HTTP."""

import json
import re
from collections.abc import Collection
from typing import Any
from urllib.request import urlopen

from tests.ros.processes import DEADLINE_S, Process, wait_until

ANY_PORT = {"listen": "127.0.0.1:0"}
_ADDRESS = re.compile(r"status and metrics: (http://\S+)/")


def address(relay: Process) -> str:
    """The base URL of a relay."""
    relay.wait_for_log("status and metrics: ")
    found = _ADDRESS.search(relay.stderr)
    assert found is not None
    return found[1]


def get(relay: Process, path: str) -> str:
    """The body of a page that must be there."""
    with urlopen(f"{address(relay)}{path}", timeout=DEADLINE_S) as answer:  # noqa: S310  the relay's own
        return str(answer.read().decode())


def status(relay: Process) -> dict[str, Any]:
    return dict(json.loads(get(relay, "/status")))


def first_group(relay: Process) -> dict[str, Any]:
    """What is told of the file's first group, as soon as it was looked at once."""
    groups: list[dict[str, Any]] = []

    def looked_at() -> bool:
        groups.extend(status(relay)["groups"])
        return bool(groups)

    wait_until(looked_at, "the first look")
    return groups[0]


def groups_of(relay: Process) -> dict[str, dict[str, Any]]:
    """What is told of the groups that were looked at, by their names."""
    return {each["name"]: each for each in status(relay)["groups"]}


def findings(relay: Process, group: str = "front") -> dict[str, dict[str, Any]]:
    """The findings of a group by their codes, the last of each."""
    groups = groups_of(relay)
    return {each["code"]: each for each in groups[group]["findings"]} if group in groups else {}


def problems(relay: Process, group: str = "front") -> set[str]:
    """The codes of what is wrong with a group."""
    return {code for code, each in findings(relay, group).items() if each["severity"] != "ok"}


def wait_for_finding(
    relay: Process, code: str, group: str = "front", *, naming: Collection[str] = ()
) -> dict[str, Any]:
    """A finding, as soon as it is there and names all of these; a node's name may be known later than its publisher."""
    found: dict[str, Any] = {}

    def is_there() -> bool:
        found.update(findings(relay, group).get(code, {}))
        return bool(found) and all(name in f"{found['text']} {found['suggestion']}" for name in naming)

    try:
        wait_until(is_there, f"the finding {code}")
    except AssertionError as error:
        raise AssertionError(f"{error}; the last was {found}") from None
    return found
