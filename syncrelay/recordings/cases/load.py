"""Reads a test file into cases, or reports everything that is wrong with it at once."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from syncrelay.config import Config, ConfigError, GroupConfig, Problem, Severity, Span, load
from syncrelay.config.document import Document, plain
from syncrelay.config.problems import Path as Place
from syncrelay.config.source import STDIN, Source, check_text, read_source
from syncrelay.config.translate import Form, translate
from syncrelay.config.wording import all_of, describe, one_of, quoted
from syncrelay.config.yaml_tree import MOST_PROBLEMS, compose, too_many
from syncrelay.recordings.bag import is_url
from syncrelay.recordings.bag.bindings import full_name
from syncrelay.recordings.cases import drawing as drawings
from syncrelay.recordings.cases.drawing import DidYouMean, Drawing
from syncrelay.recordings.cases.models import LONGEST, MOST_SECONDS, Case, CasesFile, Expectation, InputSource
from syncrelay.rig.what_if import Fault

_LEAST: Final = "at least `version: 1`, `config:` and `cases:`"
_GROUPS: Final = (
    "this looks like a file of groups, which `syncrelay validate` checks: expected a test file with `config:` and"
    " `cases:`"
)
_MOST_MESSAGES: Final = 1_000_000
_FORM: Final = Form(
    CasesFile,
    levels={"the file": CasesFile, "a case": Case, "a case's `expect`": Expectation, "a case's `inputs`": InputSource},
    missing={
        "version": "expected `version: 1`",
        "config": "expected the file that is tested, for example `config: fusion.yaml`",
        "cases": "expected one case or more",
    },
)
_ONLY_WITH_RATE: Final = ("phase", "jitter", "latency_jitter", "drop")


@dataclass(frozen=True, slots=True)
class LoadedCase:
    """A case whose names are resolved: `places` maps those that it uses to inputs. `span` is that of its own name."""

    name: str
    span: Span
    group: GroupConfig
    case: Case
    drawing: Drawing | None
    recording: str | None
    places: Mapping[str, int]
    what_if: tuple[Fault, ...]


@dataclass(frozen=True, slots=True)
class Suite:
    """A valid test file: the file that it tests, and its cases."""

    name: str
    document: Document
    config: Config
    cases: tuple[LoadedCase, ...]


def load_suite(path: str, *, environ: Mapping[str, str] = os.environ) -> Suite:
    """Read a test file, `-` for standard input. Raises ConfigError with everything that is wrong.

    A pipe is read as by read_source.
    """
    return _suite(read_source(path), Path(path).parent if path != "-" else Path(), environ)


def load_suite_text(text: str, *, name: str, environ: Mapping[str, str] = os.environ) -> Suite:
    """Read the text of a test file of this name, as `load_suite` does."""
    return _suite(check_text(text, name=name), Path(name).parent, environ)


def _suite(source: Source, folder: Path, environ: Mapping[str, str]) -> Suite:
    document, problems = compose(source, environ, expected=_LEAST)
    document.refuse_other_kind("groups", own="cases", text=_GROUPS)
    try:
        file = CasesFile.model_validate(plain(document.root))
    except ValidationError as error:
        raise _refusal([*problems, *translate(error.errors(include_url=False), document, _FORM)]) from error
    config = _tested(file.config, folder, document, environ)
    reader = _Reader(document, config, folder)
    if not file.cases:
        reader.report(("cases",), "expected one case or more", code="missing_key")
    cases = [reader.read(name, case) for name, case in file.cases.items()]
    problems += reader.problems
    if problems:
        raise _refusal(problems)
    return Suite(source.name, document, config, tuple(case for case in cases if case is not None))


def _refusal(problems: list[Problem]) -> ConfigError:
    return ConfigError(sorted(problems, key=lambda problem: problem.span or (0, 0, 0)))


def _tested(name: str, folder: Path, document: Document, environ: Mapping[str, str]) -> Config:
    """Load the file that is tested. If it cannot be read, the error is at its name."""
    if name in ("", STDIN):
        raise ConfigError(
            [document.problem(("config",), f"expected a file name, found {describe(name)}", code="bad_value")]
        )
    path = str(folder / name)
    try:
        return load(path, environ=environ)
    except ConfigError as error:
        if [problem.code for problem in error.problems] == ["other_kind"]:
            itself = Path(path).resolve() == Path(document.sources[0].name).resolve()
            kind = "this test file itself" if itself else "a test file"
            text = f"{path} is {kind}: expected the syncrelay file that is tested, relative to this one"
            raise ConfigError([document.problem(("config",), text, code="other_kind")]) from error
        if any(problem.code != "unreadable" or problem.severity is not Severity.ERROR for problem in error.problems):
            raise
        texts = [f"{path}: {problem.text}" for problem in error.problems]
        raise ConfigError([document.problem(("config",), text, code="unreadable") for text in texts]) from error


class _Reader:
    """Resolves the names in cases, and gathers problems."""

    def __init__(self, document: Document, config: Config, folder: Path) -> None:
        self.problems: list[Problem] = []
        self._document = document
        self._config = config
        self._groups = {group.name: group for group in config.groups}
        self._folder = folder

    def report(self, path: Place, text: str, *, code: str = "bad_value", span: Span | None = None) -> None:
        if filled_in := self._document.filled_in(path):
            text = f"expected another value, found {filled_in}"
        problem = self._document.problem(path, text, code=code, span=span)
        self.problems.append(problem)
        if len(self.problems) == MOST_PROBLEMS:
            raise _refusal([*self.problems, too_many(self._document.sources[0], problem.span)])

    def read(self, name: str, case: Case) -> LoadedCase | None:
        path: Place = ("cases", name)
        group = self._group(path, case)
        if group is None:
            return None
        drawing = self._drawing((*path, "drawing"), case)
        places: dict[str, int] = {}
        lines = (case.drawing or "").splitlines()
        labels = {} if drawing is None else drawing.label_lines
        for label, line in labels.items():
            if label:
                fault = drawings.Fault(line, max(0, lines[line].find(label)), len(label), "")
                self._place(label, group, places, (*path, "drawing"), self._span((*path, "drawing"), lines, fault))
        for section, names in (("inputs", case.inputs), ("expect", case.expect.inputs if case.expect else {})):
            for each in names:
                at = (*path, section, *(("inputs",) if section == "expect" else ()), each)
                self._place(each, group, places, at, self._document.key_span(at))
        if drawing is not None and drawing.keys and not drawing.faults and not any(topic.key for topic in group.topics):
            self.report((*path, "drawing"), f"{group.name} does not match by keys: `keys:` changes nothing")
        self._check_sources(path, case, group, {places[label] for label in labels if label in places}, places)
        what_if = tuple(self._faults(path, case, group))
        has_rates = any(source.rate is not None for source in case.inputs.values())
        if case.expect is None and case.drawing is None and (has_rates or case.recording is not None):
            self.report(
                path,
                "missing, expected what should come of these messages, for example `expect: {sets: 100}`",
                code="missing_key",
                span=self._document.key_span(path),
            )
        recording = case.recording
        if recording is not None and not is_url(recording):
            recording = str(self._folder / recording)
        span = self._document.key_span(path)
        return LoadedCase(name, span, group, case, drawing, recording, places, what_if)

    def _group(self, path: Place, case: Case) -> GroupConfig | None:
        if case.group is None and len(self._groups) == 1:
            return next(iter(self._groups.values()))
        if case.group is None:
            text = f"missing, expected the group that is tested: `group: {next(iter(self._groups))}`"
            self.report((*path, "group"), text, code="missing_key", span=self._document.key_span(path))
        elif case.group not in self._groups:
            close = self._document.did_you_mean(case.group, self._groups)
            text = f"the file has no group {quoted(case.group)}{close or f', expected {one_of(self._groups)}'}"
            self.report((*path, "group"), text)
        return self._groups.get(case.group or "")

    def _drawing(self, path: Place, case: Case) -> Drawing | None:
        if case.drawing is None:
            return None
        drawing = drawings.parse(case.drawing, did_you_mean=self._document.did_you_mean)
        lines = case.drawing.splitlines()
        for fault in drawing.faults:
            self.report(path, fault.text, span=self._span(path, lines, fault))
        if not drawing.marks and not drawing.faults:
            self.report(path, "no message is drawn, expected lanes such as `lidar |a.bc`")
        if drawing.width * case.period > LONGEST:
            self.report(path, f"the drawing lasts longer than {MOST_SECONDS}s, at {case.period / 1e9:g}s a column")
        return drawing

    def _span(self, path: Place, lines: Sequence[str], fault: drawings.Fault) -> Span:
        """Return the place of a token in a block of text; of the whole value if it is not written as a block."""
        span, shown = self._document.value_span(path), lines[fault.line]
        at = span.line + 1 + fault.line
        written = self._document.sources[span.source].line(at)
        if not shown or not written.endswith(shown):
            return span
        return Span(at, len(written) - len(shown) + fault.column + 1, fault.width, span.source)

    def _place(self, name: str, group: GroupConfig, places: dict[str, int], path: Place, span: Span) -> None:
        try:
            places[name] = input_named(name, group, did_you_mean=self._document.did_you_mean)
        except ValueError as error:
            self.report(path, str(error), code="unknown_input", span=span)

    def _check_sources(
        self, path: Place, case: Case, group: GroupConfig, drawn: set[int], places: Mapping[str, int]
    ) -> None:
        if case.recording is not None:
            for key in ("drawing", "inputs", "lasts", "period"):
                if key in case.model_fields_set:
                    self._refuse_key((*path, key), "cannot be used with a recording")
            return
        rates = [source.rate for source in case.inputs.values() if source.rate is not None]
        if case.drawing is None and not rates:
            text = "no messages: expected a `drawing`, a `recording`, or `inputs` with a `rate`"
            self.report(path, text, code="missing_key", span=self._document.key_span(path))
        self._check_times(path, case, rates)
        first: dict[int, str] = {}
        for name, source in case.inputs.items():
            at = (*path, "inputs", name)
            if name in places and first.setdefault(places[name], name) != name:
                text = f"is the same input as {quoted(first[places[name]])}: name it once"
                self.report(at, text, span=self._document.key_span(at))
            self._check_source(at, source, is_drawn=places.get(name) in drawn)
            if source.field is not None and name in places and group.topics[places[name]].key is None:
                self._refuse_key((*at, "field"), f"{group.name} does not match by keys: this changes nothing")

    def _check_times(self, path: Place, case: Case, rates: Sequence[int]) -> None:
        if "period" in case.model_fields_set and case.drawing is None:
            self._refuse_key((*path, "period"), "works only with a `drawing`: it is the time of its columns")
        if case.lasts is not None and not rates:
            self._refuse_key((*path, "lasts"), "works only with an input that has a `rate`")
        if rates and case.lasts is None:
            text = "missing, expected how long the inputs with a rate send, for example `lasts: 30s`"
            self.report((*path, "lasts"), text, code="missing_key", span=self._document.key_span((*path, "inputs")))
        if case.lasts is not None and sum(case.lasts // rate for rate in rates) > _MOST_MESSAGES:
            self.report((*path, "lasts"), f"more than {_MOST_MESSAGES} messages: shorten `lasts` or lower a `rate`")

    def _refuse_key(self, path: Place, text: str) -> None:
        self.report(path, text, span=self._document.key_span(path))

    def _check_source(self, path: Place, source: InputSource, *, is_drawn: bool) -> None:
        if source.rate is not None:
            if is_drawn:
                self.report((*path, "rate"), "this input is drawn: use a drawing or a `rate`, not both")
            return
        for key in _ONLY_WITH_RATE:
            if key in source.model_fields_set:
                self._refuse_key((*path, key), "works only on an input with a `rate`")

    def _faults(self, path: Place, case: Case, group: GroupConfig) -> Iterator[Fault]:
        """Yield faults with full topic names; with a recording they may be of any of its topics."""
        for index, fault in enumerate(case.what_if):
            if case.recording is not None and fault.topic.startswith("/"):
                yield fault
                continue
            try:
                place = input_named(fault.topic, group, did_you_mean=self._document.did_you_mean)
            except ValueError as error:
                self.report((*path, "what_if", index), str(error), code="unknown_input")
            else:
                recorded = full_name(group.topics[place].topic, self._config)
                yield fault.of_topic(group.inputs.names[place] if case.recording is None else recorded)


def input_named(name: str, group: GroupConfig, *, did_you_mean: DidYouMean) -> int:
    """Return the index of an input by a name: `left` names /left/image_raw if no other topic has that part.

    Raises ValueError if no input or several have it.
    """
    topics = [topic.topic for topic in group.topics]
    for known in (group.inputs.names, topics):
        if name in known:
            return known.index(name)
    wanted = _parts(name)
    spelt = f"/{'/'.join(wanted)}/"
    found = [index for index, topic in enumerate(topics) if wanted and spelt in f"/{'/'.join(_parts(topic))}/"]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{quoted(name)} is a part of {all_of(topics[index] for index in found)}: write more of it")
    hint = did_you_mean(
        name, [*topics, *(_parts(topic)[-1] for topic in topics), *(_parts(topic)[0] for topic in topics)]
    )
    raise ValueError(f"{quoted(name)} is not an input of {group.name}{hint or f', expected {one_of(topics)}'}")


def _parts(name: str) -> Sequence[str]:
    return [part for part in name.split("/") if part]
