"""Files that nobody would write: those of configs/, with bytes, lines and values that are not what they should be."""

import random
import re
from collections.abc import Callable, Iterator, Sequence

from syncrelay.config.schema import json_schema

# What a value may be in place of what it is: of other kinds, sizes and signs, and what YAML and templates make of it.
_ODD = """\
null  ~  true  yes  0  -1  1e308  -0.0  .nan  .inf  0x7f  1_000  12:30:45  []  {}  [[[[]]]]  |  >
0ms  -5ms  1e400 s  9999999999999 min  10 Hz  0 Hz  nan ms  5 parsecs  //  /a/../b  /\u00e4  {x}/y  ~/x  /  a b
{a: {b: {c: d}}}  [1, 2  {a  *a  &a b  !!python/object:os.system x  !x y  <<: {a: b}  # nothing  ---  ...
${HOME}  ${UNSET}  ${UNSET:-${UNSET}}  $  $$  ${  '  "  'unclosed  "\\u12"  %YAML 3.0  ? a  - - -
std_msgs/msg/String  std_msgs/String  a/b/c/d  sensor_msgs/srv/X  ../../etc/passwd"""
_LONG = (
    "9" * 40,
    "9" * 309,
    "-" + "9" * 400,
    "9" * 5000,
    "0x" + "f" * 398,
    "9" * 40 + "e999 min",
    "1e-999 Hz",
    "x" * 5000,
)
_STRANGE = (
    "\u202e/a",
    "/\ufeff",
    "a\u0301" * 40,
    "\U0001f916",
    "/\u0660",
    "\u2028",
    "\ud7ff\ue000",
    "\u00a0 ",
    '"\\e[2J"',
)
_VALUES = (*(value for line in _ODD.splitlines() for value in line.split("  ")), "", *_LONG, *_STRANGE)
_BYTES = tuple(map(bytes.fromhex, ["00", "ff", "feff", "c3", "09", "0d", "85", "e280a8", "eda080", "f4908080"]))

_Mutation = Callable[[bytes, random.Random], bytes]


def _other_byte(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content))
    return content[:place] + bytes([chance.randrange(256)]) + content[place + 1 :]


def _odd_bytes(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content))
    return content[:place] + chance.choice(_BYTES) + content[place:]


def _cut(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content))]


def _without_a_slice(content: bytes, chance: random.Random) -> bytes:
    begin = chance.randrange(len(content))
    return content[:begin] + content[begin + chance.randrange(1, 40) :]


def _slice_twice(content: bytes, chance: random.Random) -> bytes:
    begin = chance.randrange(len(content))
    end = begin + chance.randrange(1, 400)
    return content[:end] + content[begin:]


def _of_lines(mutate: Callable[[list[bytes], random.Random], None]) -> _Mutation:
    def mutation(content: bytes, chance: random.Random) -> bytes:
        lines = content.split(b"\n")
        mutate(lines, chance)
        return b"\n".join(lines)

    return mutation


def _swap(lines: list[bytes], chance: random.Random) -> None:
    one, other = (chance.randrange(len(lines)) for _ in range(2))
    lines[one], lines[other] = lines[other], lines[one]


def _indent(lines: list[bytes], chance: random.Random) -> None:
    place = chance.randrange(len(lines))
    lines[place] = b" " * chance.randrange(1, 9) + lines[place]


def _dedent(lines: list[bytes], chance: random.Random) -> None:
    place = chance.randrange(len(lines))
    lines[place] = lines[place].lstrip()


def _another_value(lines: list[bytes], chance: random.Random) -> None:
    places = [number for number, line in enumerate(lines) if b":" in line]
    if not places:
        return
    place = chance.choice(places)
    key = lines[place].split(b":")[0]
    lines[place] = key + b": " + chance.choice(_VALUES).encode()


def _another_word(content: bytes, chance: random.Random) -> bytes:
    words = list(re.finditer(rb"[\w/.]+", content))
    if not words:
        return content
    word, other = chance.choice(words), chance.choice(words)
    return content[: word.start()] + other.group() + content[word.end() :]


_MUTATIONS: Sequence[_Mutation] = (
    *(_other_byte, _odd_bytes, _cut, _without_a_slice, _slice_twice, _another_word),
    *(_of_lines(mutate) for mutate in (_swap, _indent, _dedent, _another_value, _another_value)),
)


def mutated(content: bytes, chance: random.Random) -> bytes:
    """The content of a file with one to four faults; by chance it may still be in order."""
    for _ in range(chance.randrange(1, 5)):
        if content:
            content = chance.choice(_MUTATIONS)(content, chance)
    return content


def _names(schema: object) -> Iterator[str]:
    """Yield the keys and the fixed values of a JSON Schema."""
    if isinstance(schema, dict):
        for key, value in schema.items():
            yield from value if key == "properties" else ()
            yield from (each for each in value if isinstance(each, str)) if key == "enum" else ()
            yield from [value] if key == "const" and isinstance(value, str) else ()
            yield from _names(value)
    elif isinstance(schema, list):
        yield from (name for each in schema for name in _names(each))


# Words that mean something somewhere in the file, and some that never do.
_WORDS = [
    *sorted({name for name in _names(json_schema()) if name.isidentifier()}),
    *["sec", "nsec", "front", "rear", "/a", "/b", "sensor_msgs/msg/Image", "/clock", "<<", "?", "$", "frnot"],
]


def made_up(chance: random.Random) -> bytes:
    """A document of the words that a file is made of, in no order: nested, repeated, anchored, of any values."""
    return f"version: 1\n{_tree(chance)}\n".encode("utf-8", "surrogatepass")


def _tree(chance: random.Random, *, depth: int = 0) -> str:
    """A mapping of mappings, lists and values; at its top in lines of its own."""
    keys = [chance.choice(_WORDS) for _ in range(chance.randrange(1, 7))]
    entries = [f"{key}: {_node(chance, depth=depth + 1)}" for key in keys]
    return "\n".join(entries) if depth == 0 else f"{{{', '.join(entries)}}}"


def _node(chance: random.Random, *, depth: int) -> str:
    anchor = chance.choice(("", "", "", "", "&a ", "&b "))
    if depth > 6 or chance.random() < 0.4:
        return chance.choice(("*a", "*b", *_WORDS)) if chance.random() < 0.7 else anchor + chance.choice(_VALUES)
    if chance.random() < 0.4:
        return f"{anchor}[{', '.join(_node(chance, depth=depth + 1) for _ in range(chance.randrange(4)))}]"
    return anchor + _tree(chance, depth=depth)
