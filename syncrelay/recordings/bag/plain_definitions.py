"""Definitions without comments and annotations, and of bounded size: rosbags' parser backtracks over all of them."""

import re
from collections.abc import Iterator
from typing import Final

# Far more than any real message has; the parser takes about a second for each of these.
_LONGEST_RECORDED: Final = 1_000_000
_LONGEST: Final = 100_000
_MOST_LINES: Final = 5_000
_MOST_EXPRESSIONS: Final = 500

_IDL_RULE: Final = "=" * 80 + "\n"
_NO_LINE: Final = re.compile(r"^[ \t\r]*(?:#[^\n]*)?(?:\n|\Z)", re.MULTILINE)
_STRING: Final = r'"(?:\\[\s\S]?|[^"\\])*(?:"|\Z)'
# Of annotations only the value of an enumerator matters. A line with # is `#include`: all types follow in the text.
_TOKEN: Final = re.compile(
    rf"""  # An unclosed string or comment extends to the end, so that nothing is scanned twice.
    (?P<kept>{_STRING}|@value\s*\(\s*-?\w+\s*\))
    |(?P<gap>(?:\s|//[^\n]*|\#[^\n]*|/\*[\s\S]*?(?:\*/|\Z)|@(?!value\b)[\w:]+(?:\s*\((?:{_STRING}|[^"()])*\))?)+)""",
    re.VERBOSE,
)
# Each bracket in a constant makes the parser 50 times slower, and `<<` may ask for gigabytes.
_UNBEARABLE: Final = re.compile(r"\(|<<|(?:sequence\s*<\s*){3}")
_EXPRESSION: Final = re.compile(r'["=@\[|^&+*/%~-]|>>')

# In `sequence<string<7>>` the parser takes the end for a shift.
_BOUND: Final = re.compile(r"(string\s*<[^<>]*>)(?=>)")


def plain_msg(text: str) -> str:
    """Return .msg text without comments and empty lines; raises ValueError if it is too large."""
    _require(len(text) <= _LONGEST_RECORDED)
    plain = _NO_LINE.sub("", text)
    _require(len(plain) <= _LONGEST and plain.count("\n") <= _MOST_LINES)
    return plain


def plain_idl(text: str) -> Iterator[str]:
    """Yield the IDL text of each type, without comments and annotations.

    Raises ValueError if it is too large, or nests what takes the parser exponential time.
    """
    _require(len(text) <= _LONGEST_RECORDED)
    expressions = 0
    for part in text.split(_IDL_RULE):
        body = part.partition("\n")[2] if part.startswith(("IDL: ", "MSG: ")) else part
        plain = _TOKEN.sub(lambda token: token["kept"] or " ", body).strip()
        code = _TOKEN.sub(lambda token: token["kept"][0] if token["kept"] else " ", plain)
        expressions += len(_EXPRESSION.findall(code))
        _require(len(plain) <= _LONGEST and expressions <= _MOST_EXPRESSIONS)
        _require(_UNBEARABLE.search(code) is None)
        if plain:
            yield _BOUND.sub(r"\1 ", plain)


def _require(is_bearable: bool) -> None:  # noqa: FBT001  as assert's
    if not is_bearable:
        raise ValueError("no message is defined so")
