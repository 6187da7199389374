"""Counts the calls of Python and C functions: a measure of work that does not depend on the machine."""

import sys
from typing import Any, Self


class Calls:
    """Counts the calls within its context."""

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> Self:
        sys.setprofile(self._note)
        return self

    def __exit__(self, *_error: object) -> None:
        sys.setprofile(None)

    def _note(self, _frame: Any, event: str, _argument: Any) -> None:
        self.count += event in ("call", "c_call")
