"""The results of tests, for people and for programs: text, JUnit's XML, JSON, GitHub's annotations."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Any, Final, NamedTuple, Protocol
from xml.sax.saxutils import escape, quoteattr

from syncrelay.config import Problem, render
from syncrelay.config.annotations import inert, problem_as_json, problem_command, workflow_command
from syncrelay.config.problems import dotted
from syncrelay.printable import one_entry, printable, printable_lines
from syncrelay.recordings.cases.checking import Mismatch, Result
from syncrelay.recordings.cases.drawing import lanes

_BOLD, _RED, _RESET = "\033[1m", "\033[31m", "\033[0m"


@dataclass(frozen=True, slots=True)
class FileResult:
    """A test file: its problems, or the results of its cases."""

    name: str
    problems: Sequence[Problem]
    cases: Sequence[Result]

    @property
    def failed(self) -> bool:
        """Whether the file has a problem or a case failed."""
        return bool(self.problems) or any(case.failed for case in self.cases)


class Talk(NamedTuple):
    """Where a report goes: `put` prints data, `say` lines of talk and `remark` a sentence, coloured or not."""

    put: Callable[[str], None]
    say: Callable[[str], None]
    remark: Callable[[str], None]
    data_is_coloured: bool
    talk_is_coloured: bool


class Report(Protocol):
    """Reports test files while they run, and a summary at the end."""

    def begin(self, name: str) -> None:
        """Report that the cases of a file run next."""
        ...

    def fault(self, result: FileResult) -> None:
        """Report a file that cannot be run."""
        ...

    def case(self, name: str, result: Result) -> None:
        """Report the result of a case."""
        ...

    def end(self, results: Sequence[FileResult]) -> None:
        """Report the summary."""
        ...


class Text:
    """For people: a line for each case, the differences of those that fail or were updated, and a summary."""

    def __init__(self, talk: Talk) -> None:
        self._talk = talk
        self._bold, self._red, self._reset = (_BOLD, _RED, _RESET) if talk.data_is_coloured else ("", "", "")

    def begin(self, name: str) -> None:
        """See Report."""
        self._talk.put(f"{self._bold}{printable(name)}{self._reset}")

    def fault(self, result: FileResult) -> None:
        """See Report."""
        self._talk.say(render(result.problems, colour=self._talk.talk_is_coloured))

    def case(self, name: str, result: Result) -> None:
        """See Report."""
        self._talk.put(f"  {self._status(result)}  {printable(result.case.name)}")
        for line in what_differs(result):
            self._talk.put(f"        {printable(line)}")
        for sentence in _remarks(name, result):
            self._talk.remark(sentence)

    def _status(self, result: Result) -> str:
        if result.failed:
            return f"{self._red}FAIL{self._reset}"
        return "updated" if result.updated else "ok  "

    def end(self, results: Sequence[FileResult]) -> None:
        """See Report."""
        self._talk.put(summary(results))


class Github(Text):
    """Workflow annotations at the lines of failed cases, beside the text."""

    def begin(self, name: str) -> None:
        """See Report."""
        self._talk.put(inert(printable(name)))

    def fault(self, result: FileResult) -> None:
        """See Report."""
        for problem in result.problems:
            self._talk.put(problem_command(problem))

    def case(self, name: str, result: Result) -> None:
        """See Report."""
        if result.failed:
            text = "\n".join([result.case.name, *what_differs(result)])
            self._talk.put(workflow_command("error", text, file=name, span=result.case.span))
        else:
            self._talk.put(inert(f"  {self._status(result)}  {printable(result.case.name)}"))
        for sentence in _remarks(name, result):
            self._talk.remark(inert(sentence))


def _remarks(name: str, result: Result) -> Iterator[str]:
    """Yield the remarks on a case with its file and name, for stderr."""
    for sentence in result.remarks:
        yield printable(f"{name}: {result.case.name}: {sentence}")


class Json:
    """One JSON document at the end."""

    def __init__(self, talk: Talk) -> None:
        self._put = talk.put

    def begin(self, _name: str) -> None:
        """See Report."""

    def fault(self, _result: FileResult) -> None:
        """See Report."""

    def case(self, _name: str, _result: Result) -> None:
        """See Report."""

    def end(self, results: Sequence[FileResult]) -> None:
        """See Report."""
        passed, updated, failed = counts(results)
        figures = {"passed": passed, "updated": updated, "failed": failed}
        self._put(json.dumps({**figures, "files": [_file(each) for each in results]}, indent=2))


class Junit(Json):
    """JUnit's XML at the end, as GitLab, Jenkins and others read it."""

    def end(self, results: Sequence[FileResult]) -> None:
        """See Report."""
        self._put("\n".join(_junit(results)))


REPORTS: Final[dict[str, Callable[[Talk], Report]]] = {"text": Text, "junit": Junit, "json": Json, "github": Github}


def counts(results: Sequence[FileResult]) -> tuple[int, int, int]:
    """Return how many cases passed, were updated and failed."""
    cases = [case for result in results for case in result.cases]
    updated, failed = sum(case.updated for case in cases), sum(case.failed for case in cases)
    return len(cases) - updated - failed, updated, failed


def summary(results: Sequence[FileResult]) -> str:
    """Return the closing line."""
    passed, updated, failed = counts(results)
    faulty = sum(bool(result.problems) for result in results)
    errors = f", {faulty} {'file' if faulty == 1 else 'files'} with errors" if faulty else ""
    renewed = f"{updated} updated, " if updated else ""
    return f"{passed} passed, {renewed}{failed} failed{errors}"


def what_differs(result: Result) -> Iterator[str]:
    """Yield the differences as lines: `-` was expected, `+` was found."""
    if result.error is not None:
        yield from one_entry(result.error).split("\n")
    for mismatch in result.mismatches:
        if isinstance(mismatch.renewed, tuple):
            yield from lanes(result.case.case.drawing or "")
            yield from _diff(mismatch)
        else:
            label = dotted(mismatch.path[3:])
            yield f"{label}: expected {', '.join(mismatch.expected)}, found {', '.join(mismatch.found)}"


def _headline(result: Result) -> str:
    """Return the differences in a few words."""
    if result.error is not None:
        return result.error.splitlines()[0]
    is_drawn = [isinstance(each.renewed, tuple) for each in result.mismatches]
    if any(is_drawn):
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


def _file(result: FileResult) -> dict[str, Any]:
    return {
        "file": result.name,
        "problems": [problem_as_json(problem) for problem in result.problems],
        "cases": [_case(case) for case in result.cases],
    }


def _case(result: Result) -> dict[str, Any]:
    return {
        "name": result.case.name,
        "line": result.case.span.line,
        "group": result.case.group.name,
        "passed": result.passed,
        "updated": result.updated,
        "seconds": round(result.seconds, 6),
        "error": result.error,
        "mismatches": [
            {"path": dotted(each.path), "expected": each.expected, "found": each.found} for each in result.mismatches
        ],
        "remarks": result.remarks,
    }


def _junit(results: Sequence[FileResult]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    *others, failed = counts(results)
    errors = sum(bool(result.problems) for result in results)
    tests = sum(others) + failed + errors
    yield f'<testsuites name="syncrelay test" tests="{tests}" failures="{failed}" errors="{errors}">'
    for result in results:
        of_file = counts([result])
        faulty = bool(result.problems)
        seconds = sum(case.seconds for case in result.cases)
        yield (
            f'  <testsuite name={_attribute(result.name)} tests="{sum(of_file) + faulty}" failures="{of_file[-1]}"'
            f' errors="{int(faulty)}" time="{seconds:.3f}">'
        )
        if faulty:
            yield f"    <testcase name={_attribute(result.name)}>"
            yield f"      <error message={_attribute(result.problems[0].text)}>{_text(render(result.problems))}</error>"
            yield "    </testcase>"
        for case in result.cases:
            yield from _junit_case(result.name, case)
        yield "  </testsuite>"
    yield "</testsuites>"


def _junit_case(file: str, result: Result) -> Iterator[str]:
    head = (
        f"    <testcase classname={_attribute(file)} name={_attribute(result.case.name)}"
        f' file={_attribute(file)} line="{result.case.span.line}" time="{result.seconds:.3f}"'
    )
    if not result.failed and not result.remarks:
        yield f"{head}/>"
        return
    yield f"{head}>"
    if result.failed:
        lines = "\n".join(what_differs(result))
        yield f"      <failure message={_attribute(_headline(result))}>{_text(lines)}</failure>"
    if result.remarks:
        yield f"      <system-err>{_text(chr(10).join(map(printable, result.remarks)))}</system-err>"
    yield "    </testcase>"


def _attribute(text: str) -> str:
    return quoteattr(printable(text))


def _text(text: str) -> str:
    return escape(printable_lines(text))
