"""Problems of files for programs: as JSON, and as the workflow commands that GitHub makes annotations of."""

from typing import Any

from syncrelay.config import Problem, Severity, Span
from syncrelay.printable import printable_lines


def problem_as_json(problem: Problem) -> dict[str, Any]:
    """Return a problem as JSON has it; line and columns from 1, None where the file as a whole is meant."""
    span = problem.span
    return {
        "severity": problem.severity.value,
        "code": problem.code,
        "path": problem.path,
        "message": problem.text,
        "line": span.line if span else None,
        "column": span.column if span else None,
        "end_column": span.column + span.width if span else None,
    }


def problem_command(problem: Problem) -> str:
    """Return a command that GitHub turns into an annotation (workflow commands: ::error, ::warning, ::notice)."""
    command = "notice" if problem.severity is Severity.NOTE else problem.severity.value
    text = f"{problem.path}: {problem.text}" if problem.path else problem.text
    return workflow_command(command, text, file=problem.file, span=problem.span)


def workflow_command(command: str, text: str, *, file: str, span: Span | None) -> str:
    """Return a command of GitHub's about a place in a file, `error` for one."""
    properties = {"file": file}
    if span is not None:
        properties |= {"line": str(span.line), "col": str(span.column), "endColumn": str(span.column + span.width)}
    written = ",".join(f"{key}={_escaped_property(value)}" for key, value in properties.items())
    return f"::{command} {written}::{_escaped(text)}"


def inert(line: str) -> str:
    """Return a line that GitHub does not take for a command, whatever names it has."""
    return line.replace("::", "%3A%3A").replace("##[", "##%5B")


def _escaped(text: str) -> str:
    return printable_lines(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escaped_property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")
