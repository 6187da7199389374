"""Test files run one after another, told to a report as they end, and updated where that is wanted."""

import os
import stat
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from syncrelay.config import ConfigError
from syncrelay.config.source import Patience, listed, read_source, shown_name
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.output_files import written_whole
from syncrelay.recordings.cases.checking import Result, check
from syncrelay.recordings.cases.load import Suite, load_suite
from syncrelay.recordings.cases.reports import FileResult, Report
from syncrelay.recordings.cases.update import updated

_WRITABLE: Final = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def run_files(paths: Sequence[str], report: Report, *, update: bool, remark: Callable[[str], None]) -> bool:
    """Run the cases of test files, or of all files of a directory; tell whether all of them passed.

    With `update`, files expect what was found, where they can; `remark` is told which do and why others do not.
    """
    patience = Patience()
    results: list[FileResult] = []
    for path in paths:
        try:
            files = listed(path)
        except ConfigError as error:
            results.append(_faulty(path, error, report))
            continue
        for file in files:
            try:
                suite = load_suite(file, patience=patience)
            except ConfigError as error:
                results.append(_faulty(file, error, report))
                continue
            name = shown_name(file)
            report.begin(name)
            cases: list[Result] = []
            for case in _updated(suite, tuple(check(suite)), remark) if update else check(suite):
                report.case(name, case)
                cases.append(case)
            results.append(FileResult(name, (), cases))
    report.end(results)
    return not any(result.failed for result in results)


def _faulty(file: str, error: ConfigError, report: Report) -> FileResult:
    result = FileResult(shown_name(file), error.problems, ())
    report.fault(result)
    return result


def _updated(suite: Suite, results: Sequence[Result], remark: Callable[[str], None]) -> Iterator[Result]:
    """Write what was found into a test file, and yield the results with what could not be updated."""
    renewed = [each for result in results for each in result.mismatches if each.renewed is not None]
    if not renewed:
        yield from results
        return
    (source,) = suite.document.sources.values()
    try:
        replace_text(suite.name, updated(suite.document, source, renewed), before=source.text)
    except SyncRelayError as error:
        remark(str(error))
        yield from results
        return
    remark(f"{suite.name}: {counted(len(renewed), 'expectation')} updated")
    for result in results:
        left = tuple(each for each in result.mismatches if each.renewed is None)
        is_updated = bool(result.mismatches) and not left
        yield replace(result, mismatches=left or result.mismatches, updated=is_updated)


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
