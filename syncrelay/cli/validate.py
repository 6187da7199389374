"""`syncrelay validate FILE...`: everything that is wrong with files."""

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say, wants_colour
from syncrelay.cli.parser import Parser
from syncrelay.cli.problems import inert, problem_as_json, problem_command
from syncrelay.cli.stop import StopRequest
from syncrelay.config import Config, ConfigError, Problem, Severity, load, render
from syncrelay.config.source import listed, shown_name
from syncrelay.config.wording import counted
from syncrelay.printable import printable


@dataclass(frozen=True, slots=True)
class Finding:
    """What files that run together came to: a config if they are in order, and their problems, notes among them."""

    files: tuple[str, ...]
    config: Config | None
    problems: tuple[Problem, ...]


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay validate`."""
    files = arguments.files
    parser.refuse_repeated(files if arguments.together else [each for each in files if each == "-"])
    return validate([files] if arguments.together else [[file] for file in files], arguments.format)


def validate(sets: Sequence[Sequence[str]], output_format: str) -> int:
    """Check sets of files, each as one, and print what was found as `text`, `json` or `github`; 1 for any error."""
    findings = [_check(files) for files in sets]
    _PRINT[output_format](findings)
    return DONE if all(finding.config for finding in findings) else AT_FAULT


def _check(files: Sequence[str]) -> Finding:
    names = tuple(shown_name(each) for file in files for each in _listed(file))
    try:
        config = load(*files)
    except ConfigError as error:
        return Finding(names, None, error.problems)
    return Finding(names, config, config.notes)


def _listed(file: str) -> tuple[str, ...]:
    """Return the files of a directory; what is no directory, or has none, is itself what something is wrong with."""
    try:
        return listed(file)
    except ConfigError:
        return (file,)


def _print_text(findings: Sequence[Finding]) -> None:
    for finding in findings:
        if finding.config is None:
            say(render(finding.problems, colour=wants_colour(sys.stderr.isatty())))
            continue
        put(_ok(finding.files, finding.config))
        if finding.problems:
            put(render(finding.problems, colour=wants_colour(sys.stdout.isatty())))


def _print_json(findings: Sequence[Finding]) -> None:
    listed = [_as_json(file, finding) for finding in findings for file in finding.files]
    put(json.dumps(listed, indent=2))


def _print_github(findings: Sequence[Finding]) -> None:
    for finding in findings:
        for problem in finding.problems:
            put(problem_command(problem))
        if finding.config is not None:
            put(inert(_ok(finding.files, finding.config)))


_PRINT: Final[dict[str, Callable[[Sequence[Finding]], None]]] = {
    "text": _print_text,
    "json": _print_json,
    "github": _print_github,
}


def _ok(files: Sequence[str], config: Config) -> str:
    n_topics = len({topic.topic for group in config.groups for topic in group.topics})
    together = "ok together" if len(files) > 1 else "ok"
    counts = f"{counted(len(config.groups), 'group')}, {counted(n_topics, 'topic')}"
    return f"{printable(', '.join(files))}: {together}, {counts}"


def _as_json(file: str, finding: Finding) -> dict[str, Any]:
    problems = [problem for problem in finding.problems if problem.file == file]
    return {
        "file": file,
        "ok": all(problem.severity is not Severity.ERROR for problem in problems),
        "problems": [problem_as_json(problem) for problem in problems],
    }
