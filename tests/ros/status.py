"""What a running relay says over HTTP."""

import json
import re
from typing import Any
from urllib.request import urlopen

from tests.ros.processes import Process, wait_until

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
    with urlopen(f"{address(relay)}{path}", timeout=30) as answer:  # noqa: S310  the relay's own
        return str(answer.read().decode())


def status(relay: Process) -> dict[str, Any]:
    return dict(json.loads(get(relay, "/status")))


def findings(relay: Process, group: str = "front") -> dict[str, dict[str, Any]]:
    """The findings of a group by their codes, the last of each."""
    groups = {each["name"]: each for each in status(relay)["groups"]}
    return {each["code"]: each for each in groups[group]["findings"]} if group in groups else {}


def wait_for_finding(relay: Process, code: str, group: str = "front") -> dict[str, Any]:
    """A finding, as soon as it is there."""
    wait_until(lambda: code in findings(relay, group), f"the finding {code}")
    return findings(relay, group).get(code) or wait_for_finding(relay, code, group)
