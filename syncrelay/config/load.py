"""From a file to a Config, or to everything that is wrong with it at once."""

import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from syncrelay.config.checks import check_groups, check_node
from syncrelay.config.defaults import merged_documents, merged_files, with_defaults
from syncrelay.config.document import Document, as_written, flow, plain
from syncrelay.config.export import LerobotConfig, resolve_lerobot
from syncrelay.config.export_checks import check_export
from syncrelay.config.file import FileKeys, file_format, relay_form
from syncrelay.config.interfaces import Interfaces
from syncrelay.config.listen import Listen
from syncrelay.config.names_in_graph import NamesInFile
from syncrelay.config.partial import partial_file
from syncrelay.config.problems import ConfigError, Path, Problem, Severity
from syncrelay.config.resolved import GroupConfig, resolve_groups, resolve_listen
from syncrelay.config.sections import DiagnosticsConfig, NodeConfig
from syncrelay.config.source import PATIENCE_S, Source, check_text, read_source
from syncrelay.config.translate import translate
from syncrelay.config.typechecks import TypeChecks
from syncrelay.config.yaml_tree import compose
from syncrelay.yaml_files import yaml_files

_LEAST: Final = "at least `version: 1` and `groups:`"
_TESTS: Final = "this looks like a test file, which `syncrelay test` runs: expected a file with `groups:`"
_NO_INDEX = "message types were not checked: there is no ament index here (source ROS 2, or install with '.[ros]')"


@dataclass(frozen=True, slots=True)
class Config:
    """A valid file. `notes` are what could not be checked, and warnings.

    `names` finds conflicts that remaps of its topics' names cause.
    `listen` is None without HTTP, `diagnostics` if nothing about the relay is published. `sources` are its files
    as they were read. `lerobot` is for `export` alone.
    """

    node: NodeConfig
    groups: tuple[GroupConfig, ...]
    listen: Listen | None
    diagnostics: DiagnosticsConfig | None
    names: NamesInFile = field(compare=False, repr=False)
    notes: tuple[Problem, ...] = ()
    sources: tuple[Source, ...] = field(default=(), compare=False, repr=False)
    lerobot: LerobotConfig | None = None

    def written(self, path: Path) -> str | None:
        """Return the value at a path as the file or its `defaults` have it, on one line; None if neither has."""
        node = self.names.document.find(path)
        return None if node is None else flow(as_written(node))


def load(
    *paths: str,
    environ: Mapping[str, str] = os.environ,
    patience_s: float = PATIENCE_S,
) -> Config:
    """Read a file (`-` is standard input), or several files or directories as one configuration.

    Together they have the groups of all and one `node`; `defaults` are for the groups of their own file. All pipes
    together are waited for so many seconds. Raises ConfigError with everything that is wrong.
    """
    files = (file for path in paths for file in yaml_files(path))
    read = partial(read_source, patience_s=patience_s, since=time.monotonic())
    reads = [partial(read, file) for file in files]
    return _config(_parts(reads, environ), environ)


def load_text(
    text: str,
    *,
    name: str = "<text>",
    environ: Mapping[str, str] = os.environ,
) -> Config:
    """Read the text of a file, as `load` does."""
    return _config(_parts([lambda: check_text(text, name=name)], environ), environ)


def spelt_out(text: str, *, environ: Mapping[str, str] = os.environ) -> str:
    """Return the text of a valid file with its aliases and merge keys expanded."""
    if "*" not in text and "<<" not in text:
        return text
    document, _ = compose(check_text(text, name="<text>"), environ, expected=_LEAST)
    # Variables have been filled in, so every remaining $ is literal.
    return json.dumps(plain(document.root)).replace("$", "$$")


@dataclass(frozen=True, slots=True)
class _Part:
    """One file: its tree with defaults filled in, the keys that are in order, and what is wrong with the others."""

    document: Document
    file: FileKeys
    problems: Sequence[Problem]


def _config(parts: Sequence[_Part], environ: Mapping[str, str]) -> Config:
    """Resolve and check what could be read of all files. Without errors, the relay runs exactly that."""
    document, repeated = merged_documents([part.document for part in parts])
    file = merged_files([part.file for part in parts])
    groups = resolve_groups(file)
    names = NamesInFile(file.node, groups, file.diagnostics, document)
    problems = [*(problem for part in parts for problem in part.problems), *repeated]
    problems += check_node(file.node, document)
    problems += check_groups(groups, document)
    problems += names.problems(file.node.absolute, groups=file.groups)
    interfaces = Interfaces.find(environ)
    types = TypeChecks(document, interfaces) if interfaces is not None else None
    if types is not None:
        problems += types.of_groups(groups)
    else:
        first = document.sources[0]
        problems.append(first.problem(_NO_INDEX, code="not_checked", span=None, severity=Severity.NOTE))
    problems += check_export(file.export, file.node, groups, document, types)
    found = _in_order(problems, files=[source.name for source in document.sources.values()])
    if document.faulty or any(problem.severity is Severity.ERROR for problem in found):
        raise ConfigError(found)
    sources = tuple(document.sources.values())
    lerobot = resolve_lerobot(file.export, file.node, [group.name for group in groups])
    return Config(file.node, groups, resolve_listen(file.metrics), file.diagnostics, names, found, sources, lerobot)


def _parts(reads: Sequence[Callable[[], Source]], environ: Mapping[str, str]) -> list[_Part]:
    """Read every file. Raises ConfigError, with what is wrong in the others too, where one has no tree."""
    parts: list[_Part] = []
    problems: list[Problem] = []
    for index, read in enumerate(reads):
        try:
            parts.append(_part(replace(read(), index=index), environ, is_alone=len(reads) == 1))
            problems += parts[-1].problems
        except ConfigError as error:
            problems += error.problems
    if len(parts) < len(reads):
        raise ConfigError(_in_order(problems, files=[problem.file for problem in problems]))
    return parts


def _part(source: Source, environ: Mapping[str, str], *, is_alone: bool) -> _Part:
    document, problems = compose(source, environ, expected=_LEAST)
    document.refuse_other_kind("cases", own="groups", text=_TESTS)
    document = with_defaults(document)
    keys = plain(document.root)
    if isinstance(keys, dict) and not is_alone:
        # Its groups may all be in the other files.
        keys = {"groups": {}, **keys}
    try:
        return _Part(document, file_format().file.model_validate(keys), problems)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        return _Part(*partial_file(document, faults), problems + translate(_known(faults), document, relay_form()))


def _known(faults: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Leave out unknown keys of groups whose policy is refused: they may be those of its broken package."""
    refused = {
        fault["loc"][:2] for fault in faults if fault["type"] == "value_error" and fault["loc"][3:] == ("policy",)
    }
    return [fault for fault in faults if fault["type"] != "extra_forbidden" or fault["loc"][:2] not in refused]


def _in_order(problems: Iterable[Problem], *, files: Iterable[str]) -> tuple[Problem, ...]:
    """Sort by file and place, without repeats: a value in `defaults` may be wrong in several groups."""
    order = {name: number for number, name in enumerate(dict.fromkeys(files))}
    by_place = sorted(problems, key=lambda problem: (order[problem.file], problem.span or (0, 0, 0)))
    return tuple({(each.file, each.span, each.text): each for each in reversed(by_place)}.values())[::-1]
