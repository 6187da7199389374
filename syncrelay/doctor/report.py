"""An examination as a whole: as lines of text, and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, Final

from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.examine import Examination, Observed
from syncrelay.doctor.text import diagnosis_lines, observed_lines, verdict
from syncrelay.printable import printable
from syncrelay.status import group_of

_THROUGH: Final = {"compiled": "librcl in compiled code", "rclpy": "rclpy"}


def is_ok(examination: Examination) -> bool:
    """Tell whether nothing has to be fixed."""
    return all(each.severity is Severity.INFO for each in examination.diagnoses)


def lines(examination: Examination, *, colour: bool) -> Iterator[str]:
    """Yield what is installed, what was observed, each diagnosis, and the verdict."""
    yield printable(heading(examination))
    if examination.observed is not None:
        yield from observed_lines(examination.observed)
    for diagnosis in examination.diagnoses:
        yield ""
        yield from diagnosis_lines(diagnosis, colour=colour)
    yield from ("", verdict(examination.diagnoses))


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


def as_json(examination: Examination) -> dict[str, Any]:
    """Return what json.dumps takes."""
    installation = examination.installation
    return {
        "ok": is_ok(examination),
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
    graph = {"seconds": observed.seconds, **asdict(observed.graph)}
    return {"graph": graph, "groups": [group_of(report).as_dict() for report in observed.reports]}
