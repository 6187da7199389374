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
_NO_LINE: Final = re.compile(r"^[ \t]*(?:#[^\n]*)?(?:\n|\Z)", re.MULTILINE)
# The parser knows no empty text and no wide string in .msg text. A wide text is as good as any where it is a constant;
# elsewhere a message of a name that no package has stands for it.
_TEXT_CONSTANT: Final = re.compile(r"^[ \t]*w?(string[ \t]+\w+[ \t]*=)([ \t]*$)?", re.MULTILINE)
_WIDE_STRING: Final = re.compile(r"^[ \t]*wstring(?:<=(\d+))?(?=[ \t\[])", re.MULTILINE)
WIDE_STRING: Final = "wide_strings/msg/W"
"""What the name of a message begins with that stands for a wide string; its bound follows, 0 for none."""
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
    """Return .msg text as rosbags can parse it, without comments and empty lines; raises ValueError if too large."""
    _require(len(text) <= _LONGEST_RECORDED)
    plain = _NO_LINE.sub("", text.replace("\r\n", "\n"))
    _require(len(plain) <= _LONGEST and plain.count("\n") <= _MOST_LINES)
    plain = _TEXT_CONSTANT.sub(lambda found: found[1] + ("" if found[2] is None else '""'), plain)
    return _WIDE_STRING.sub(lambda found: f"{WIDE_STRING}{found[1] or 0}", plain)


def plain_idl(text: str) -> Iterator[str]:
    """Yield the IDL text of each type, without comments and annotations.

    Raises ValueError if it is too large, or nests what takes the parser exponential time.
    """
    _require(len(text) <= _LONGEST_RECORDED)
    expressions = 0
    for part in text.replace("\r\n", "\n").split(_IDL_RULE):
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
