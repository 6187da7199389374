"""What errors of a test file are told by."""

from collections.abc import Iterator

from pydantic import BaseModel

from syncrelay.config.problems import Path
from syncrelay.config.translate import Location
from syncrelay.recordings.cases.models import Case, CasesFile, Expectation, InputExpectation, InputSource

_EXAMPLES = {
    "version": "expected `version: 1`",
    "config": "expected the file that is tested, for example `config: fusion.yaml`",
    "cases": "expected one case or more",
}


class CasesForm:
    """A test file; see syncrelay.config.translate.Form."""

    def path(self, loc: Location) -> Path:
        """See Form: there are no unions, so no tags."""
        return tuple(step for step in loc if step != "[key]")

    def model(self, loc: Location) -> type[BaseModel]:
        """See Form."""
        match loc:
            case ("cases", _, "inputs", _):
                return InputSource
            case ("cases", _, "expect", "inputs", _):
                return InputExpectation
            case ("cases", _, "expect"):
                return Expectation
            case ("cases", _):
                return Case
            case _:
                return CasesFile

    def levels(self) -> Iterator[tuple[str, type[BaseModel]]]:
        """See Form."""
        yield "the file", CasesFile
        yield "a case", Case
        yield "a case's `expect`", Expectation
        yield "a case's `inputs`", InputSource

    def owners(self, _loc: Location) -> str | None:
        """See Form: all mappings of a kind have the same keys."""
        return None

    def missing(self, loc: Location) -> str:
        """See Form."""
        return _EXAMPLES[str(loc[-1])]
