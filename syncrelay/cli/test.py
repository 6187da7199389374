"""`syncrelay test FILE...`: whether a configuration does what its tests say."""

import os
import stat
import tempfile
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path

from syncrelay.cases import Result, Suite, check, load_suite, updated
from syncrelay.cli.boundary import AT_FAULT, DONE, remark
from syncrelay.cli.case_reports import REPORTS, FileResult, Report
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config import ConfigError
from syncrelay.config.source import STDIN, shown_name
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay test`."""
    parser.refuse_repeated(arguments.files)
    if arguments.update and STDIN in arguments.files:
        parser.error("--update cannot write standard input")
    return test(arguments.files, arguments.format, update=arguments.update)


def test(files: Sequence[str], output_format: str, *, update: bool) -> int:
    """Run the cases of test files and print what came of them as `text`, `junit`, `json` or `github`.

    1 if a case fails or a file has an error. `update` has the files expect what is, where they can.
    """
    report = REPORTS[output_format]()
    runs = [_run(file, report) for file in files]
    report.end([result for _, result in runs])
    results = [_updated(*run) if update else run[1] for run in runs]
    return DONE if all(result.passed for result in results) else AT_FAULT


def _run(file: str, report: Report) -> tuple[Suite | None, FileResult]:
    name = shown_name(file)
    try:
        suite = load_suite(file)
    except ConfigError as error:
        result = FileResult(name, error.problems, ())
        report.fault(result)
        return None, result
    report.begin(name)
    return suite, FileResult(name, (), tuple(_told(check(suite), report, name)))


def _told(results: Iterator[Result], report: Report, name: str) -> Iterator[Result]:
    for result in results:
        report.case(name, result)
        yield result


def _updated(suite: Suite | None, result: FileResult) -> FileResult:
    """Write what was found into a test file; return what is still not as it shall be."""
    if suite is None:
        return result
    mismatches = [each for case in result.cases for each in case.mismatches]
    renewed = [each for each in mismatches if each.renewed is not None]
    if renewed:
        (source,) = suite.document.sources.values()
        _replace(suite.name, updated(suite.document, source, renewed))
        remark(f"{result.name}: {counted(len(renewed), 'expectation')} updated")
    cases = (case for case in result.cases if case.error or any(each.renewed is None for each in case.mismatches))
    return FileResult(result.name, result.problems, tuple(cases))


def _replace(file: str, text: str) -> None:
    """Write a file as a whole or not at all; it keeps its mode, and a link to it stays a link."""
    path = Path(os.path.realpath(file))
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".syncrelay-") as folder:
            written = Path(folder, path.name)
            written.write_bytes(text.encode())
            written.chmod(stat.S_IMODE(path.stat().st_mode))
            written.replace(path)
    except OSError as error:
        raise SyncRelayError(f"{file}: cannot be written: {error.strerror}") from error
