"""Every finding as its page shows it."""

from collections.abc import Iterable
from dataclasses import dataclass

from docs.generate.markdown import linked
from syncrelay.explain import Code, Severity
from syncrelay.explain.codes import MATCHING
from syncrelay.explain.judge import EXPLAINS

# As programs get them: in /status, in the metrics, in `analyze --json`.
_OK, _WARN, _ERROR = (f"`{severity.name.lower()}`" for severity in Severity)
_SAID_AS = {
    (Severity.OK,): _OK,
    (Severity.WARN,): _WARN,
    (Severity.ERROR,): _ERROR,
    (Severity.OK, Severity.WARN): f"{_OK} or {_WARN}",
    (Severity.WARN, Severity.ERROR): f"{_ERROR} where it keeps sets from leaving, otherwise {_WARN}",
    tuple(Severity): f"{_OK}, {_WARN} or {_ERROR}",
}


@dataclass(frozen=True, slots=True)
class _Finding:
    code: str
    severity: str
    meaning: str
    remedy: str
    explains: str
    explains_of_input: str


def findings() -> tuple[_Finding, ...]:
    """Return all, in the order in which they explain a silence."""
    return tuple(_finding(code) for code in Code)


def _finding(code: Code) -> _Finding:
    explained = EXPLAINS.get(code)
    in_group = explained.in_group if explained else frozenset()
    of_input = explained.of_input - in_group if explained else frozenset()
    return _Finding(
        code.value,
        _SAID_AS[code.severities],
        code.meaning,
        linked(code.remedy or ""),
        _named(code, in_group),
        _named(code, of_input),
    )


def _named(cause: Code, codes: frozenset[Code]) -> str:
    """Return findings by their links, those about matching as one; of nearly all, those that are left."""
    codes = codes - {cause}
    others = [code for code in Code if code not in codes and code is not cause]
    if codes and len(others) < len(codes) / 4:
        return f"all but {_links(others)}"
    if codes >= MATCHING:
        rest = _links(code for code in Code if code in codes - MATCHING)
        return f"the findings about matching{f', {rest}' if rest else ''}"
    return _links(code for code in Code if code in codes)


def _links(codes: Iterable[Code]) -> str:
    return ", ".join(f"[`{code.value}`](#{code.value})" for code in codes)


def matching() -> str:
    """Return links to the findings about matching."""
    return _links(code for code in Code if code in MATCHING)
