"""What `observe` prints at its end, and which groups are not healthy."""

from collections.abc import Iterator, Mapping, Sequence

from syncrelay.config.wording import counted
from syncrelay.explain import Code, GroupReport, Severity, words
from syncrelay.status import RelayState
from syncrelay.status.as_document import status_of
from syncrelay.top.plain import WIDTH, group_lines, wrapped


def observed_lines(
    state: RelayState, seconds: float, suggested: Mapping[str, Sequence[str]], columns: float
) -> Iterator[str]:
    """Yield what came of each group, with the lines of what is suggested for it, in lines of so many columns."""
    lasting = words.seconds(round(seconds * 1e9))
    yield from fitted(f"observed for {lasting} with {state.config}; nothing was published", columns)
    for report, group in zip(state.groups, status_of(state).groups, strict=True):
        yield ""
        yield from group_lines(group, width=int(min(WIDTH, columns)))
        yield from fitted(f"  {_would_have_left(report)}", columns)
        for line in suggested.get(group.name, ()):
            # Lines of the file are indented by four, and stay as they are to be copied.
            yield from [line] if line.startswith("    ") else fitted(line, columns)


def fitted(text: str, columns: float) -> list[str]:
    """Return a line, broken where it is longer than so many columns."""
    content = text.lstrip()
    return [text] if len(text) <= columns else wrapped(content, indent=text.removesuffix(content), width=int(columns))


def _would_have_left(report: GroupReport) -> str:
    """Say how many sets there were, and the share of the messages that set the pace that are in them."""
    pace, sets = report.facts.pacemaker, counted(report.facts.figures.sets, "set")
    came = pace.counts.fed - pace.counts.buffered
    if not came:
        return f"would have left: {sets}"
    share = round(100 * pace.counts.matched / came)
    return (
        f"would have left: {sets}, with {pace.counts.matched} of {counted(came, 'message')} of {pace.name} ({share} %)"
    )


def unhealthy(reports: Sequence[GroupReport], looked_s: float, *, unjudged: Sequence[str] = ()) -> list[str]:
    """Return why each group that is not healthy is not; of `unjudged` groups there is no report."""
    faults = [f"{report.facts.name} {fault}" for report in reports if (fault := _fault(report, looked_s))]
    return [*faults, *(f"{name} could not be evaluated: see the log" for name in unjudged)]


def _fault(report: GroupReport, looked_s: float) -> str | None:
    for severity, word in ((Severity.ERROR, "error"), (Severity.WARN, "warning")):
        if count := sum(finding.severity is severity for finding in report.findings):
            return f"has {counted(count, word)}"
    if report.facts.figures.last_set is None:
        return f"produced no set in {looked_s:.0f} s, which is too short to tell why: observe it for longer"
    # Doctor warns of it too.
    if (said := report.findings[-1]).code is Code.STARTING:
        return f"produced {said.text}: observe it for longer"
    return None
