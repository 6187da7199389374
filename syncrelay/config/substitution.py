"""`${NAME}` and `${NAME:-default}`, filled in on one scalar at a time: a value can't add keys or lines."""

import re
from collections.abc import Mapping

from syncrelay.config.wording import quoted

_DOLLAR = re.compile(
    r"\$(?:(?P<escaped>\$)|\{(?P<name>[A-Za-z_]\w*)(?P<default>:-[^{}$]*)?\}|(?P<other>\{[^}]*\}?|\w*))"
)


def substitute(text: str, environ: Mapping[str, str]) -> str:
    """Return the text with its variables filled in; `$$` is a dollar sign.

    A default stands for a variable that is unset or empty, as in a shell. Raises ValueError for an unset
    variable without a default and for what only looks like a variable.
    """
    return _DOLLAR.sub(lambda found: _value(found, environ), text)


def _value(found: re.Match[str], environ: Mapping[str, str]) -> str:
    if found["escaped"]:
        return "$"
    name, default = found["name"], found["default"]
    if name is None:
        raise ValueError(
            f"{quoted(found.group())}: expected ${{NAME}} or ${{NAME:-default}}; a dollar sign itself is written $$"
        )
    value = environ.get(name)
    if default is not None:
        return value or default.removeprefix(":-")
    if value is None:
        raise ValueError(
            f"the environment variable {name} is not set; ${{{name}:-default}} gives it a value for that case"
        )
    return value
