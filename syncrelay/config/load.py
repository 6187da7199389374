"""From a file to a Config, or to everything that is wrong with it at once."""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from pydantic import ValidationError

from syncrelay.config.checks import check_between
from syncrelay.config.compose import compose
from syncrelay.config.document import Document, plain
from syncrelay.config.drafts import GroupDraft, drafts
from syncrelay.config.errors import ConfigError
from syncrelay.config.file import File, FileKeys
from syncrelay.config.filling import with_defaults
from syncrelay.config.interfaces import Interfaces
from syncrelay.config.names_in_graph import NamesInFile
from syncrelay.config.problems import Problem, Severity
from syncrelay.config.resolved import Config, resolve
from syncrelay.config.source import Source, check_text, read_source
from syncrelay.config.translate import translate
from syncrelay.config.typechecks import check_types

_NO_INDEX = "message types were not checked: there is no ament index here (source ROS 2, or install with '.[ros]')"


def load(
    path: str,
    *,
    environ: Mapping[str, str] = os.environ,
    package_missing: Severity = Severity.ERROR,
) -> Config:
    """Return what a file says, `-` for standard input.

    With `package_missing` as a note, a type whose package isn't installed yet is no fault. Raises ConfigError
    with everything that is wrong.
    """
    return _config(read_source(path), environ, package_missing)


def load_text(
    text: str,
    *,
    name: str = "<text>",
    environ: Mapping[str, str] = os.environ,
    package_missing: Severity = Severity.ERROR,
) -> Config:
    """Return what the text of a file says; as `load`."""
    return _config(check_text(text, name=name), environ, package_missing)


def _config(source: Source, environ: Mapping[str, str], package_missing: Severity) -> Config:
    document, problems = compose(source, environ)
    document = with_defaults(document)
    file, faults = _validate(document)
    problems += faults
    groups = drafts(document)
    problems += check_between(groups, document)
    problems += _types(groups, document, environ, package_missing)
    found = _in_order(problems)
    if file is None or any(problem.severity is Severity.ERROR for problem in found):
        raise ConfigError(found)
    return resolve(file, names=NamesInFile(document), notes=found)


def _validate(document: Document) -> tuple[FileKeys | None, list[Problem]]:
    try:
        return File.model_validate(plain(document.root)), []
    except ValidationError as error:
        return None, translate(error.errors(include_url=False), document)


def _types(
    groups: Sequence[GroupDraft], document: Document, environ: Mapping[str, str], package_missing: Severity
) -> Iterator[Problem]:
    interfaces = Interfaces.find(environ)
    if interfaces is None:
        yield Problem(document.name, "", _NO_INDEX, "not_checked", severity=Severity.NOTE)
        return
    for problem in check_types(groups, document, interfaces):
        yield replace(problem, severity=package_missing) if problem.code == "package_missing" else problem


def _in_order(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    """Sort by place, and show once what one value gives rise to in several groups."""
    by_place = sorted(problems, key=lambda problem: problem.span or (0, 0, 0))
    return tuple({(problem.span, problem.text): problem for problem in reversed(by_place)}.values())[::-1]
