"""Message types and their fields, read from the ament index and .msg files without importing anything.

The index is a folder `share/ament_index/resource_index` in every prefix of AMENT_PREFIX_PATH. The ROS wheels leave
that variable unset and put the index into the Python environment's own prefix.
"""

import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple, Self

HEADER: Final = "std_msgs/msg/Header"
TIME: Final = "builtin_interfaces/msg/Time"

_FIELD = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d+)?(?P<array>\[[^\]]*\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
# What is before a comment. A default value may be a text with `#` in it.
_CODE = re.compile(r"""(?:[^#"']|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')*""")
PRIMITIVES: Final = frozenset(
    [
        "bool",
        "byte",
        "char",
        "float32",
        "float64",
        "int8",
        "uint8",
        "int16",
        "uint16",
        "int32",
        "uint32",
        "int64",
        "uint64",
        "string",
        "wstring",
    ]
)

_RULE: Final = "=" * 80 + "\n"
_INDEX: Final = Path("share/ament_index/resource_index")


ROSIDL: Final = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}
"""Names of primitives in .msg files, and in rosidl's Python classes where those are others."""


class Field(NamedTuple):
    """A field with its type in full (`float64`, `std_msgs/msg/Header`), and what its definition says besides.

    `bound` is that of a string (`<=10`), `array` is empty or as `[]`, `[3]` and `[<=3]`, `default` its default value.
    """

    name: str
    type: str
    bound: str = ""
    array: str = ""
    default: str = ""

    @property
    def is_array(self) -> bool:
        """Whether it is an array of its type."""
        return bool(self.array)

    @property
    def rosidl(self) -> str:
        """Its type as rosidl's classes name it, such as `sequence<builtin_interfaces/Time, 3>`."""
        element = ROSIDL.get(self.type, self.type).replace("/msg/", "/")
        if self.bound:
            element += f"<{self.bound.removeprefix('<=')}>"
        size = self.array.strip("[]")
        if not self.array or size.isdigit():
            return element + self.array
        return f"sequence<{element}, {size.removeprefix('<=')}>" if size else f"sequence<{element}>"


@dataclass(frozen=True)
class Interfaces:
    """The installed interfaces below some prefixes, of which earlier ones hide later ones; each is read once."""

    prefixes: tuple[Path, ...]
    _types: dict[str, tuple[str, ...]] = field(default_factory=dict, compare=False, repr=False)
    _fields: dict[str, tuple[Field, ...] | None] = field(default_factory=dict, compare=False, repr=False)

    @classmethod
    def find(cls, environ: Mapping[str, str]) -> Self | None:
        """Return what the environment has installed; None where there is no index at all."""
        listed = environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        prefixes = [Path(entry) for entry in (*listed, sys.prefix) if entry]
        indexed = tuple(dict.fromkeys(prefix for prefix in prefixes if (prefix / _INDEX).is_dir()))
        return cls(indexed) if indexed else None

    @cached_property
    def packages(self) -> Mapping[str, Path]:
        """Every package that defines interfaces, with its prefix."""
        return self._resources("rosidl_interfaces")

    @cached_property
    def other_packages(self) -> frozenset[str]:
        """Every installed package that defines none."""
        return frozenset(self._resources("packages")) - frozenset(self.packages)

    def types(self, package: str) -> tuple[str, ...]:
        """Return a package's types in full (`pkg/msg/Name`, `pkg/srv/Name`, `pkg/action/Name`)."""
        if package not in self._types:
            listed = self.packages[package] / _INDEX / "rosidl_interfaces" / package
            lines = listed.read_text(encoding="utf-8", errors="replace").split()
            self._types[package] = tuple(
                sorted({f"{package}/{line.rpartition('.')[0]}" for line in lines if "." in line})
            )
        return self._types[package]

    def fields(self, type_name: str) -> tuple[Field, ...] | None:
        """Return the fields of an installed message type; None where its .msg file cannot be read."""
        if type_name not in self._fields:
            self._fields[type_name] = self._read_fields(type_name)
        return self._fields[type_name]

    def fields_of(self, name: str) -> dict[str, str]:
        """Return the fields of a type, named `pkg/Name`, and their types, as rosidl's classes have them."""
        return {field.name: field.rosidl for field in self.fields(name.replace("/", "/msg/")) or ()}

    def definition(self, type_name: str) -> str | None:
        """Return the .msg file of a type with those of all types within it, as recordings hold them.

        None where one of the files cannot be read.
        """
        texts: dict[str, str] = {}
        waiting = [type_name]
        while waiting:
            name = waiting.pop()
            text = self._text(name)
            if text is None:
                return None
            texts[name] = text
            below = [field.type for field in self.fields(name) or () if field.type not in PRIMITIVES]
            waiting += [each for each in dict.fromkeys(below) if each not in texts and each not in waiting]
        others = [f"{_RULE}MSG: {name.replace('/msg/', '/')}\n{text}" for name, text in texts.items()][1:]
        return "\n".join([texts[type_name], *others])

    def _read_fields(self, type_name: str) -> tuple[Field, ...] | None:
        text = self._text(type_name)
        return None if text is None else parse_fields(text, package=type_name.partition("/")[0])

    def _text(self, type_name: str) -> str | None:
        prefix = self.packages.get(type_name.partition("/")[0])
        if prefix is None:
            return None
        try:
            return (prefix / "share" / f"{type_name}.msg").read_text(encoding="utf-8", errors="replace")
        except OSError:
            return None

    def _resources(self, kind: str) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for prefix in self.prefixes:
            for name in _names_in(prefix / _INDEX / kind):
                found.setdefault(name, prefix)
        return found


def _names_in(folder: Path) -> Iterator[str]:
    if folder.is_dir():
        yield from sorted(entry.name for entry in folder.iterdir() if not entry.name.startswith("."))


def parse_fields(text: str, *, package: str) -> tuple[Field, ...]:
    """Return the fields of a .msg file in order, without constants."""
    fields = []
    for line in text.splitlines():
        code = _CODE.match(line)
        found = _FIELD.match(code.group().strip() if code else "")
        if found is not None and not found["rest"].startswith("="):
            full, bound, array = _full_name(found["type"], package), found["bound"] or "", found["array"] or ""
            fields.append(Field(found["name"], full, bound, array.replace(" ", ""), found["rest"].strip()))
    return tuple(fields)


def _full_name(written: str, package: str) -> str:
    if written in PRIMITIVES:
        return written
    owner, slash, name = written.rpartition("/")
    return f"{owner.removesuffix('/msg')}/msg/{name}" if slash else f"{package}/msg/{name}"
