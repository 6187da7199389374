"""What every page of ours is made of: a template that escapes all it is given, and nothing from elsewhere."""

import hashlib
from base64 import b64encode
from datetime import UTC, datetime
from importlib.resources import files
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

MARK: Final = '<meta name="generator" content="syncrelay">'
"""Stands near the begin of every page, and in no other file."""

_SECOND: Final = 1_000_000_000


def template(package: str, name: str) -> Any:
    """Return a template in the folder `page` of a package.

    What a recording names comes from strangers: all is escaped, and a name that the template has wrong is an error.
    """
    environment = Environment(
        loader=PackageLoader(package, "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["coded"] = _coded
    return environment.get_template(name)


def joined(package: str, names: tuple[str, ...]) -> str:
    """Return the text of files, by their paths from a package."""
    folder = files(package)
    return "\n" + "\n".join(folder.joinpath(name).read_text(encoding="utf-8").strip() for name in names) + "\n"


def content_hash(text: str) -> str:
    """Return what a page's policy knows a style or a script by, so that no other one counts."""
    return f"sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}"


def when(nanoseconds: int) -> str:
    """Return a time, UTC, to the second."""
    try:
        return f"{datetime.fromtimestamp(nanoseconds / _SECOND, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (OverflowError, ValueError):
        return f"{nanoseconds} ns"


def _coded(text: str) -> Markup:
    """Return a sentence, escaped, with what stands between backticks as code."""
    parts = text.split("`")
    wrapped = (Markup("<code>{}</code>").format(part) if at % 2 else escape(part) for at, part in enumerate(parts))
    return Markup("").join(wrapped)
