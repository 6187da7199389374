"""`syncrelay test FILE...`: whether a configuration does what its tests say."""

import os
import stat
from argparse import Namespace
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from syncrelay.cli.boundary import AT_FAULT, DONE, remark
from syncrelay.cli.case_reports import REPORTS, FileResult, Report
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config import ConfigError
from syncrelay.config.source import STDIN, Patience, listed, read_source, shown_name
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.output_files import written_whole
from syncrelay.recordings.cases import Result, Suite, check, load_suite, updated

_WRITABLE: Final = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay test`."""
    parser.refuse_repeated(arguments.files)
    if arguments.update and STDIN in arguments.files:
        parser.error("--update cannot write standard input")
    return test(arguments.files, arguments.format, update=arguments.update)


def test(paths: Sequence[str], output_format: str, *, update: bool) -> int:
    """Run the cases of test files, or of all files of a directory, and print what came of them.

    That is `text`, `junit`, `json` or `github`; 1 if a case fails or a file has an error. `update` has the files expect
    what was found, where they can.
    """
    report = REPORTS[output_format]()
    patience = Patience()
    results = [result for path in paths for result in _run_all(path, report, patience, update=update)]
    report.end(results)
    return AT_FAULT if any(result.failed for result in results) else DONE


def _run_all(path: str, report: Report, patience: Patience, *, update: bool) -> Iterator[FileResult]:
    try:
        files = listed(path)
    except ConfigError as error:
        yield _faulty(path, error, report)
        return
    for file in files:
        yield _run(file, report, patience, update=update)


def _run(file: str, report: Report, patience: Patience, *, update: bool) -> FileResult:
    try:
        suite = load_suite(file, patience=patience)
    except ConfigError as error:
        return _faulty(file, error, report)
    name = shown_name(file)
    report.begin(name)
    results = _updated(suite, tuple(check(suite))) if update else check(suite)
    return FileResult(name, (), tuple(_told(results, report, name)))


def _faulty(file: str, error: ConfigError, report: Report) -> FileResult:
    result = FileResult(shown_name(file), error.problems, ())
    report.fault(result)
    return result


def _told(results: Iterable[Result], report: Report, name: str) -> Iterator[Result]:
    for result in results:
        report.case(name, result)
        yield result


def _updated(suite: Suite, results: Sequence[Result]) -> Sequence[Result]:
    """Write what was found into a test file, and return the results with what is still not as it shall be."""
    renewed = [each for result in results for each in result.mismatches if each.renewed is not None]
    if not renewed:
        return results
    (source,) = suite.document.sources.values()
    try:
        replace_text(suite.name, updated(suite.document, source, renewed), before=source.text)
    except SyncRelayError as error:
        remark(str(error))
        return results
    remark(f"{suite.name}: {counted(len(renewed), 'expectation')} updated")
    return [_as_updated(result) for result in results]


def _as_updated(result: Result) -> Result:
    left = tuple(each for each in result.mismatches if each.renewed is None)
    return replace(result, mismatches=left or result.mismatches, updated=bool(result.mismatches) and not left)


def replace_text(file: str, text: str, *, before: str) -> None:
    """Write a file as a whole or not at all; it keeps its mode, and a link to it stays a link.

    Raises SyncRelayError where it cannot be written, or no longer holds the text `before`.
    """
    path = Path(os.path.realpath(file))
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            raise SyncRelayError(f"{file}: cannot be written: it is not a regular file")
        # To put another in its place takes no leave of the file itself.
        if not mode & _WRITABLE or not os.access(path, os.W_OK):
            raise SyncRelayError(f"{file}: cannot be written: it is read-only")
        if read_source(str(path)).text != before:
            raise SyncRelayError(f"{file}: was changed while its cases ran: run them again to update it")
        with written_whole(path) as written:
            written.write_bytes(text.encode())
            written.chmod(stat.S_IMODE(mode))
    except OSError as error:
        raise SyncRelayError(f"{file}: cannot be written: {error.strerror}") from error
