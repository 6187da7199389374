"""The page for browsers at the relay's root: files of this folder, and nothing from anywhere else.

It asks /status once a second, as `top` does. Each answer is short and complete, so pages that are left open occupy no
thread of the server.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

from syncrelay.status.fates import FATES
from syncrelay.sync import DropReason

_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
HEADERS: Final = (
    ("Content-Security-Policy", _POLICY),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
)
_FOLDER: Final = files("syncrelay.status.page")
_JAVASCRIPT: Final = "text/javascript; charset=utf-8"
_CSS: Final = "text/css; charset=utf-8"


class File(NamedTuple):
    """A file of the page: its type, for a browser, and its bytes."""

    content_type: str
    content: bytes


PATHS: Final = ("/", "/colours.css", "/page.css", "/draw.js", "/page.js")


@cache
def page_file(path: str) -> File:
    """Return the file of the page at one of PATHS."""
    if path == "/":
        text = _FOLDER.joinpath("index.html").read_text(encoding="utf-8")
        return File("text/html; charset=utf-8", text.replace("FATES", json.dumps(_fates())).encode())
    return File(_CSS if path.endswith(".css") else _JAVASCRIPT, _FOLDER.joinpath(path[1:]).read_bytes())


def _fates() -> list[dict[str, object]]:
    meanings = {reason.value: f"{reason.value}: {reason.meaning}" for reason in DropReason}
    return [
        {"name": fate.name, "path": fate.path, "filled": fate.is_filled, "meaning": meanings.get(fate.name, fate.word)}
        for fate in FATES
    ]
