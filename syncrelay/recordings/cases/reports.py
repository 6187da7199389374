"""The results of tests, for people and for programs: text, JUnit's XML, JSON, GitHub's annotations."""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from difflib import SequenceMatcher
from itertools import groupby
from operator import attrgetter
from typing import Any, Final, NamedTuple, TypeAlias
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from syncrelay.config import render
from syncrelay.config.annotations import inert, problem_as_json, problem_command, workflow_command
from syncrelay.config.problems import dotted
from syncrelay.printable import one_entry, printable, printable_lines
from syncrelay.recordings.cases.checking import Mismatch, Ran, Result
from syncrelay.recordings.cases.drawing import lanes

_BOLD, _RED, _RESET = "\033[1m", "\033[31m", "\033[0m"


class Talk(NamedTuple):
    """Where a report goes: `put` prints data, `say` lines of talk and `remark` a sentence, coloured or not."""

    put: Callable[[str], None]
    say: Callable[[str], None]
    remark: Callable[[str], None]
    data_is_coloured: bool
    talk_is_coloured: bool


Report: TypeAlias = Callable[[Iterable[Ran], Talk], Sequence[Ran]]
"""Reports what comes of test files, and returns it."""


class Counts(NamedTuple):
    """How many cases passed, how many failed, and how many files could not be run."""

    passed: int
    failed: int
    errors: int


def counts(ran: Sequence[Ran]) -> Counts:
    """Count the cases and faulty files of a run."""
    passed = [each.outcome.passed for each in ran if isinstance(each.outcome, Result)]
    return Counts(sum(passed), len(passed) - sum(passed), len(ran) - len(passed))


def report_text(ran: Iterable[Ran], talk: Talk) -> Sequence[Ran]:
    """Print a line for each case, the differences of those that fail, and a summary."""
    bold, red, reset = (_BOLD, _RED, _RESET) if talk.data_is_coloured else ("", "", "")
    all_ran: list[Ran] = []
    for file, of_file in groupby(ran, attrgetter("file")):
        for number, each in enumerate(of_file):
            all_ran.append(each)
            if not isinstance(each.outcome, Result):
                talk.say(render(each.outcome, colour=talk.talk_is_coloured))
                continue
            if not number:
                talk.put(f"{bold}{printable(file)}{reset}")
            status = "ok  " if each.outcome.passed else f"{red}FAIL{reset}"
            talk.put(f"  {status}  {printable(each.outcome.case.name)}")
            for line in what_differs(each.outcome):
                talk.put(f"        {printable(line)}")
            for sentence in _remarks(file, each.outcome):
                talk.remark(sentence)
    talk.put(summary(all_ran))
    return all_ran


def report_to_github(ran: Iterable[Ran], talk: Talk) -> Sequence[Ran]:
    """Print workflow annotations at the lines of failed cases, and lines of text for the others."""
    all_ran: list[Ran] = []
    for file, of_file in groupby(ran, attrgetter("file")):
        for number, each in enumerate(of_file):
            all_ran.append(each)
            result = each.outcome
            if not isinstance(result, Result):
                for problem in result:
                    talk.put(problem_command(problem))
                continue
            if not number:
                talk.put(inert(printable(file)))
            if result.passed:
                talk.put(inert(f"  ok    {printable(result.case.name)}"))
            else:
                text = "\n".join([result.case.name, *what_differs(result)])
                talk.put(workflow_command("error", text, file=file, span=result.case.span))
            for sentence in _remarks(file, result):
                talk.remark(inert(sentence))
    talk.put(summary(all_ran))
    return all_ran


def report_json(ran: Iterable[Ran], talk: Talk) -> Sequence[Ran]:
    """Print one JSON document at the end."""
    all_ran = list(ran)
    found = counts(all_ran)
    files = [_file(name, list(of_file)) for name, of_file in groupby(all_ran, attrgetter("file"))]
    talk.put(json.dumps({"passed": found.passed, "failed": found.failed, "files": files}, indent=2))
    return all_ran


def report_junit(ran: Iterable[Ran], talk: Talk) -> Sequence[Ran]:
    """Print JUnit's XML at the end, as GitLab, Jenkins and others read it."""
    all_ran = list(ran)
    root = Element("testsuites", {"name": "syncrelay test", **_totals(all_ran)})
    for name, of_file in groupby(all_ran, attrgetter("file")):
        group, file = list(of_file), printable(name)
        seconds = sum(each.outcome.seconds for each in group if isinstance(each.outcome, Result))
        suite = SubElement(root, "testsuite", {"name": file, **_totals(group), "time": f"{seconds:.3f}"})
        for each in group:
            if isinstance(each.outcome, Result):
                _add_junit_case(suite, file, each.outcome)
            else:
                error = SubElement(SubElement(suite, "testcase", name=file), "error")
                error.set("message", printable(each.outcome[0].text))
                error.text = printable_lines(render(each.outcome))
    indent(root)
    talk.put(f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}')
    return all_ran


REPORTS: Final[dict[str, Report]] = {
    "text": report_text,
    "junit": report_junit,
    "json": report_json,
    "github": report_to_github,
}


def summary(ran: Sequence[Ran]) -> str:
    """Return the closing line."""
    passed, failed, faulty = counts(ran)
    errors = f", {faulty} {'file' if faulty == 1 else 'files'} with errors" if faulty else ""
    return f"{passed} passed, {failed} failed{errors}"


def what_differs(result: Result) -> Iterator[str]:
    """Yield the differences as lines: `-` was expected, `+` was found."""
    if result.error is not None:
        yield from one_entry(result.error).split("\n")
    for mismatch in result.mismatches:
        if mismatch.is_drawn:
            yield from lanes(result.case.case.drawing or "")
            yield from _diff(mismatch)
        else:
            label = dotted(mismatch.path[3:])
            yield f"{label}: expected {', '.join(mismatch.expected)}, found {', '.join(mismatch.found)}"


def _remarks(file: str, result: Result) -> Iterator[str]:
    """Yield the remarks on a case with its file and name, for stderr."""
    for sentence in result.remarks:
        yield printable(f"{file}: {result.case.name}: {sentence}")


def _headline(result: Result) -> str:
    """Return the differences in a few words."""
    if result.error is not None:
        return result.error.splitlines()[0]
    if any(each.is_drawn for each in result.mismatches):
        return "not what was drawn"
    return f"not as expected: {', '.join(dotted(each.path[3:]) for each in result.mismatches)}"


def _diff(mismatch: Mismatch) -> Iterator[str]:
    expected, found = mismatch.expected, mismatch.found
    for kind, begin, end, other_begin, other_end in SequenceMatcher(None, expected, found).get_opcodes():
        if kind == "equal":
            yield from (f"  -> {line}" for line in expected[begin:end])
        else:
            yield from (f"- -> {line}" for line in expected[begin:end])
            yield from (f"+ -> {line}" for line in found[other_begin:other_end])


def _file(name: str, ran: Sequence[Ran]) -> dict[str, Any]:
    results = [each.outcome for each in ran if isinstance(each.outcome, Result)]
    problems = [problem for each in ran if not isinstance(each.outcome, Result) for problem in each.outcome]
    return {
        "file": name,
        "problems": [problem_as_json(problem) for problem in problems],
        "cases": [
            {
                "name": result.case.name,
                "line": result.case.span.line,
                "group": result.case.group.name,
                "passed": result.passed,
                "seconds": round(result.seconds, 6),
                "error": result.error,
                "mismatches": [
                    {"path": dotted(each.path), "expected": each.expected, "found": each.found}
                    for each in result.mismatches
                ],
                "remarks": result.remarks,
            }
            for result in results
        ],
    }


def _totals(ran: Sequence[Ran]) -> dict[str, str]:
    found = counts(ran)
    return {"tests": str(sum(found)), "failures": str(found.failed), "errors": str(found.errors)}


def _add_junit_case(suite: Element, file: str, result: Result) -> None:
    case = SubElement(suite, "testcase", classname=file, name=printable(result.case.name), file=file)
    case.attrib |= {"line": str(result.case.span.line), "time": f"{result.seconds:.3f}"}
    if not result.passed:
        failure = SubElement(case, "failure", message=printable(_headline(result)))
        failure.text = printable_lines("\n".join(what_differs(result)))
    if result.remarks:
        SubElement(case, "system-err").text = "\n".join(map(printable, result.remarks))
