"""Work counted in calls, of Python as of C: what takes hours takes many, however fast the machine is."""

import sys
from typing import Any, Self


class Calls:
    """Counts the calls that are made while it is entered."""

    def __init__(self) -> None:
        self.count = 0

    def __enter__(self) -> Self:
        sys.setprofile(self._note)
        return self

    def __exit__(self, *_error: object) -> None:
        sys.setprofile(None)

    def _note(self, _frame: Any, event: str, _argument: Any) -> None:
        self.count += event in ("call", "c_call")
