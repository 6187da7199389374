"""`syncrelay validate FILE...`: everything that is wrong with files."""

import json
import sys
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say, wants_colour
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.printable import printable

if TYPE_CHECKING:
    from syncrelay.config import Config, Problem


def parser() -> Parser:
    parser = Parser(
        "syncrelay validate",
        example="syncrelay validate fusion.yaml",
        description="Checks files without ROS and shows every error at once, each at its line, with the nearest valid "
        "word. Message types are checked where ROS is installed; a package that is missing there is only a note. "
        "Exit code 1 if a file has an error.",
    )
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="a YAML file, a directory of files that run together, or - for standard input",
    )
    parser.add_argument(
        "--together", action="store_true", help="check the files as one, as the relay does: --config FILE ..."
    )
    parser.add_argument(
        "--format",
        choices=("text", "json", "github"),
        default="text",
        metavar="FORMAT",
        help="text (default), json, or github: annotations for a workflow",
    )
    return parser


@dataclass(frozen=True, slots=True)
class Checked:
    """Files that run together: what they say if they are in order, and their problems, notes among them."""

    files: tuple[str, ...]
    config: "Config | None"
    problems: "tuple[Problem, ...]"


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    files = arguments.files
    parser.refuse_repeated(files if arguments.together else [each for each in files if each == "-"])
    found = [_check(each) for each in ([files] if arguments.together else [[file] for file in files])]
    {"text": _print_text, "json": _print_json, "github": _print_github}[arguments.format](found)
    return DONE if all(each.config for each in found) else AT_FAULT


def _check(files: Sequence[str]) -> Checked:
    from syncrelay.config import ConfigError, load
    from syncrelay.config.source import shown_name
    from syncrelay.yaml_files import yaml_files

    names = tuple(shown_name(file) for path in files for file in yaml_files(path))
    try:
        config = load(*files)
    except ConfigError as error:
        return Checked(names, None, error.problems)
    return Checked(names, config, config.notes)


def _print_text(found: Sequence[Checked]) -> None:
    from syncrelay.config import render

    for each in found:
        if each.config is None:
            say(render(each.problems, colour=wants_colour(sys.stderr.isatty())))
            continue
        put(_summary(each.files, each.config))
        if each.problems:
            put(render(each.problems, colour=wants_colour(sys.stdout.isatty())))


def _print_json(found: Sequence[Checked]) -> None:
    from syncrelay.config import Severity
    from syncrelay.config.annotations import problem_as_json

    documents = []
    for each in found:
        for file in each.files:
            problems = [problem for problem in each.problems if problem.file == file]
            is_ok = all(problem.severity is not Severity.ERROR for problem in problems)
            documents.append({"file": file, "ok": is_ok, "problems": list(map(problem_as_json, problems))})
    put(json.dumps(documents, indent=2))


def _print_github(found: Sequence[Checked]) -> None:
    from syncrelay.config.annotations import inert, problem_command

    for each in found:
        for problem in each.problems:
            put(problem_command(problem))
        if each.config is not None:
            put(inert(_summary(each.files, each.config)))


def _summary(files: Sequence[str], config: "Config") -> str:
    from syncrelay.config.wording import counted

    n_topics = len({topic.topic for group in config.groups for topic in group.topics})
    together = "ok together" if len(files) > 1 else "ok"
    counts = f"{counted(len(config.groups), 'group')}, {counted(n_topics, 'topic')}"
    return f"{printable(', '.join(files))}: {together}, {counts}"
