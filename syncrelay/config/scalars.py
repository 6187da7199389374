"""What a scalar of YAML 1.2 is, with the variables that it names filled in."""

import re
from collections.abc import Mapping
from typing import Final

from syncrelay.config.document import Scalar
from syncrelay.config.wording import quoted

# YAML 1.2's core schema (10.3.2), so that editors and syncrelay agree.
_CONSTANTS: Final[dict[str, Scalar]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
}
_DECIMAL = re.compile(r"[-+]?[0-9]+")
_OCTAL_OR_HEXADECIMAL = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
# Python limits the digits of an int, and no key needs so many.
_LONGEST_NUMBER = 400

_DOLLAR = re.compile(
    r"\$(?:(?P<escaped>\$)|\{(?P<name>[A-Za-z_]\w*)(?P<default>:-[^{}$]*)?\}|(?P<other>\{[^}]*\}?|\w*))"
)


def read_plain(text: str) -> Scalar:
    """Return the value of an unquoted scalar, as YAML 1.2 has it."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if len(text) > _LONGEST_NUMBER:
        return text
    if _DECIMAL.fullmatch(text):
        return int(text)
    if _OCTAL_OR_HEXADECIMAL.fullmatch(text):
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    return text


def substitute(text: str, environ: Mapping[str, str]) -> str:
    """Return the text with its variables filled in; `$$` is a dollar sign.

    A default stands for a variable that is unset or empty, as in a shell. Raises ValueError for an unset
    variable without a default and for what only looks like a variable.
    """
    return _DOLLAR.sub(lambda found: _value(found, environ), text)


def variables_in(text: str, environ: Mapping[str, str]) -> dict[str, str]:
    """Return the values that variables in a text have in the environment, each with what stands for it."""
    named = ((found["name"], found.group()) for found in _DOLLAR.finditer(text))
    return {environ[name]: written for name, written in named if name and environ.get(name)}


def _value(found: re.Match[str], environ: Mapping[str, str]) -> str:
    if found["escaped"]:
        return "$"
    name, default = found["name"], found["default"]
    if name is None:
        raise ValueError(
            f"{quoted(found.group())}: expected ${{NAME}} or ${{NAME:-default}}; write $$ for a dollar sign"
        )
    value = environ.get(name)
    if default is not None:
        return value or default.removeprefix(":-")
    if value is None:
        raise ValueError(f"the environment variable {name} is not set; write ${{{name}:-default}} to give it a default")
    return value
