"""What a check says: what is wrong, what that leads to, and how to fix it."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """ERROR keeps messages from flowing, or what the user asked for from being done; WARNING costs sets.

    INFO may well be as it was meant.
    """

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing that was found. `code` names it for programs and stays; the texts may have several lines.

    `impact` and `fix` are None where `what` says all there is to say.
    """

    code: str
    severity: Severity
    what: str
    impact: str | None
    fix: str | None


def error(code: str, what: str, *, impact: str, fix: str) -> Diagnosis:
    """Return a diagnosis that makes the doctor exit with 1."""
    return Diagnosis(code, Severity.ERROR, what, impact, fix)


def info(code: str, what: str, *, impact: str, fix: str) -> Diagnosis:
    """Return a diagnosis that needs no action where things are meant to be so."""
    return Diagnosis(code, Severity.INFO, what, impact, fix)


def worst_first(diagnoses: list[Diagnosis]) -> list[Diagnosis]:
    """Sort by severity, else in the order of checking."""
    return sorted(diagnoses, key=lambda diagnosis: list(Severity).index(diagnosis.severity))
