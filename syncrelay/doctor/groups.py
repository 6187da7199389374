"""The groups of the file as the relay's own judge sees them, as diagnoses."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from syncrelay.config.wording import all_of
from syncrelay.doctor.diagnosis import Diagnosis, Severity, info
from syncrelay.explain import Code, Finding, GroupReport
from syncrelay.explain import Severity as Judged

_SEVERITIES: Final = {Judged.WARN: Severity.WARNING, Judged.ERROR: Severity.ERROR}
# Advice of the relay that leads here, and what it leads to.
_NEXT: Final = {
    Code.SILENT: "check with `ros2 topic hz` whether it is sending, on its own machine, in its own container and as its"
    " own user;\nif it is, messages get lost on the way: export FASTDDS_BUILTIN_TRANSPORTS=UDPv4 on both sides, and"
    " restart both",
    Code.STARTING: "run it again with a larger --seconds",
}
# Fast DDS's shared memory by default, in bytes: a message has to fit into it as a whole.
_SEGMENT: Final = 512 * 1024


def check_groups(reports: Sequence[GroupReport], unjudged: Sequence[str]) -> Iterator[Diagnosis]:
    """Yield the problems of all groups, those that several groups share once.

    That a group has sent no set yet is one too. `unjudged` are groups without a report. Left out is what `check_graph`
    says of the whole graph, and `check_types` of types.
    """
    found: dict[tuple[Code, str, str | None], list[tuple[GroupReport, Finding]]] = {}
    for report in reports:
        for finding in report.findings:
            if finding.severity in _SEVERITIES or finding.code is Code.STARTING:
                found.setdefault((finding.code, finding.text, finding.suggestion), []).append((report, finding))
    for shared in found.values():
        if not any(_is_said_elsewhere(report, finding) for report, finding in shared):
            yield _diagnosis(shared)
    for name in unjudged:
        yield Diagnosis(
            "internal_error",
            Severity.ERROR,
            f"{name}: a bug in syncrelay keeps this group from being judged",
            None,
            "report it with what `syncrelay observe --config FILE --seconds 5` prints",
        )


def _is_said_elsewhere(report: GroupReport, finding: Finding) -> bool:
    if finding.code is Code.SILENT and finding.input is not None:
        return not any(each.is_named for each in report.facts.inputs[finding.input].graph.publishers)
    return finding.code in (Code.ALONE, Code.TYPE_NOT_IMPORTABLE)


def _diagnosis(shared: Sequence[tuple[GroupReport, Finding]]) -> Diagnosis:
    finding = max((each for _, each in shared), key=lambda each: each.severity)
    names = all_of(report.facts.name for report, _ in shared)
    is_fatal = finding.severity is Judged.ERROR and all(report.facts.is_silent for report, _ in shared)
    return Diagnosis(
        finding.code.value,
        _SEVERITIES.get(finding.severity, Severity.WARNING),
        f"{names}: {finding.text}",
        f"no sets from {names}" if is_fatal else None,
        _NEXT.get(finding.code, finding.suggestion),
    )


def check_sizes(reports: Iterable[GroupReport]) -> Iterator[Diagnosis]:
    """Yield the topics whose messages do not fit into the shared memory that Fast DDS takes by default."""
    sizes = {each.name: each.graph.largest for report in reports for each in report.facts.inputs}
    large = {name: size for name, size in sizes.items() if size > _SEGMENT}
    if large:
        yield info(
            "large_messages",
            f"messages of {all_of(f'{name} ({size / 1e6:.1f} MB)' for name, size in large.items())} are larger than"
            " Fast DDS's default shared memory of 0.5 MB",
            impact="on one machine they take ten times as long as they could, and some are lost",
            fix="for the relay, write into the file: node: {transport: large_messages}\n"
            "for every other process: export FASTRTPS_DEFAULT_PROFILES_FILE=.../configs/large_messages.xml",
        )
