"""What a check says: what is so, what follows from it, and what to do."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """MEND keeps messages from flowing, or what the user asked for from being done; KNOW explains and may stay."""

    MEND = "mend"
    KNOW = "know"


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """One thing that was found. `code` names it for programs and stays; the texts may have several lines."""

    code: str
    severity: Severity
    what: str
    so: str
    do: str


def mend(code: str, what: str, *, so: str, do: str) -> Diagnosis:
    """Return a diagnosis that makes the doctor exit with 1."""
    return Diagnosis(code, Severity.MEND, what, so, do)


def know(code: str, what: str, *, so: str, do: str) -> Diagnosis:
    """Return a diagnosis that needs no action where things are meant to be so."""
    return Diagnosis(code, Severity.KNOW, what, so, do)


def worst_first(diagnoses: list[Diagnosis]) -> list[Diagnosis]:
    """Sort what is to mend before what is to know, else in the order of checking."""
    return sorted(diagnoses, key=lambda diagnosis: diagnosis.severity is Severity.KNOW)
