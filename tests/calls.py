"""Counts the calls of Python and C functions: a measure of work that does not depend on the machine."""

import sys
from collections.abc import Callable
from typing import Any, Self


class Calls:
    """Counts the calls within its context, perhaps those `of` one Python function only."""

    def __init__(self, of: Callable[..., Any] | None = None) -> None:
        self.count = 0
        self._code = of and of.__code__

    def __enter__(self) -> Self:
        sys.setprofile(self._note)
        return self

    def __exit__(self, *_error: object) -> None:
        sys.setprofile(None)

    def _note(self, frame: Any, event: str, _argument: Any) -> None:
        self.count += event in ("call", "c_call") and (
            self._code is None or (event == "call" and frame.f_code is self._code)
        )
