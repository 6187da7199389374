"""`syncrelay doctor`: what can go wrong before a message flows."""

import json
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import asdict
from logging import NullHandler
from typing import Any, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say, wants_colour
from syncrelay.cli.heartbeat import VARIABLE
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.examine import Examination, Observed, Request, examine
from syncrelay.doctor.text import diagnosis_lines, observed_lines, verdict
from syncrelay.logs import LOGGER
from syncrelay.printable import printable

_THROUGH: Final = {"compiled": "librcl in compiled code", "direct": "librcl", "rclpy": "rclpy"}


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay doctor`."""
    if arguments.seconds and not arguments.live:
        parser.error("--seconds N needs --live: it is how long to observe the graph")
    parser.refuse_repeated(arguments.config)
    live_s = (arguments.seconds or 5.0) if arguments.live else None
    return doctor(arguments.config, live_s, "json" if arguments.json else "text", arguments.ros_args)


def doctor(
    config_paths: Sequence[str],
    live_s: float | None,
    output_format: str,
    ros_args: Sequence[str],
) -> int:
    """Examine, print what was found as `text` or `json`; 1 if there are errors or warnings, else 0."""
    request = Request(dict(os.environ), VARIABLE, tuple(config_paths), tuple(ros_args), live_s)
    if live_s is not None and sys.stderr.isatty():
        say(f"observing the graph for {live_s:g} s ...")
    # What it logs, the relay that observes gives as findings too.
    LOGGER.addHandler(NullHandler())
    examination = examine(request)
    if output_format == "json":
        put(json.dumps(_as_json(examination), indent=2))
    else:
        _print_text(examination)
    return DONE if _is_ok(examination) else AT_FAULT


def _is_ok(examination: Examination) -> bool:
    return all(each.severity is Severity.INFO for each in examination.diagnoses)


def _print_text(examination: Examination) -> None:
    colour = wants_colour(sys.stdout.isatty())
    put(printable(heading(examination)))
    if examination.observed is not None:
        put("\n".join(observed_lines(examination.observed)))
    for diagnosis in examination.diagnoses:
        put("")
        put("\n".join(diagnosis_lines(diagnosis, colour=colour)))
    put("")
    put(verdict(examination.diagnoses))


def heading(examination: Examination) -> str:
    """Return the first line: what is installed, how nodes find each other, and how messages would pass."""
    installation = examination.installation
    rclpy = f"rclpy {installation.version or '(version unknown)'}" if installation.rclpy else "no rclpy"
    return ", ".join(
        [
            f"Python {installation.python[0]}.{installation.python[1]}",
            rclpy,
            examination.middleware or "no middleware",
            "no valid domain" if examination.domain is None else f"domain {examination.domain}",
            f"discovery {examination.discovery_range}",
            *([f"messages through {_THROUGH[examination.path]}"] if examination.path else []),
        ]
    )


def _as_json(examination: Examination) -> dict[str, Any]:
    installation = examination.installation
    return {
        "ok": _is_ok(examination),
        "python": f"{installation.python[0]}.{installation.python[1]}",
        "rclpy": installation.version,
        "middleware": examination.middleware or None,
        "domain": examination.domain,
        "discovery_range": examination.discovery_range,
        "receives_by": examination.path or None,
        "diagnoses": [{**asdict(each), "severity": each.severity.value} for each in examination.diagnoses],
        **_observed_as_json(examination.observed),
    }


def _observed_as_json(observed: Observed | None) -> dict[str, Any]:
    if observed is None:
        return {"graph": None, "groups": []}
    from syncrelay.status import group_of

    graph = {"seconds": observed.seconds, **asdict(observed.graph)}
    return {"graph": graph, "groups": [group_of(report).as_dict() for report in observed.reports]}
