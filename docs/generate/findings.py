"""What the page of findings shows of each that the judge knows: how bad it is, and what it explains."""

from collections.abc import Iterable, Iterator

from syncrelay.explain import Code, Severity
from syncrelay.explain.causes import EXPLAINS
from syncrelay.explain.codes import MATCHING

# As programs get them: in /status, in the metrics, in `analyze --json`.
_OK, _WARN, _ERROR = (f"`{severity.name.lower()}`" for severity in Severity)
_SAID_AS = {
    (Severity.OK,): _OK,
    (Severity.WARN,): _WARN,
    (Severity.ERROR,): _ERROR,
    (Severity.OK, Severity.WARN): f"{_OK} or {_WARN}",
    (Severity.WARN, Severity.ERROR): f"{_ERROR} or {_WARN}",
    tuple(Severity): f"{_OK}, {_WARN} or {_ERROR}",
}


def findings() -> dict[str, str]:
    """Return the severities of each finding and what it explains, as the last lines of its section."""
    return {code.value: "\n".join(_lines(code)) for code in Code}


def _lines(code: Code) -> Iterator[str]:
    yield f"- Severity: {_SAID_AS[code.severities]}."
    if (explained := EXPLAINS.get(code)) is None:
        return
    in_group, of_input = _named(code, explained.in_group), _named(code, explained.of_input - explained.in_group)
    if in_group:
        yield f"- Explains {in_group}."
    if of_input:
        yield f"- Of the same input, explains {'also ' if in_group else ''}{of_input}."


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
