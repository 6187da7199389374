"""A package with a message for each group of a file, in which the group's sets leave: `FrontSet` for `front`."""

import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config.bundle import ROLES, BundledInput, BundleType
from syncrelay.config.load import Config
from syncrelay.config.resolved import GroupConfig
from syncrelay.config.wording import all_of
from syncrelay.errors import UsageError

# Names that rosidl's classes for C++ cannot have, beside those that Python's cannot.
_OF_CPP: Final = re.compile(
    "alignas|alignof|asm|auto|bool|case|catch|char|class|const|constexpr|decltype|default|delete|do|double|enum|explicit"
    "|export|extern|float|friend|goto|inline|int|long|mutable|namespace|new|noexcept|nullptr|operator|private|protected"
    "|public|register|short|signed|sizeof|static|struct|switch|template|this|throw|typedef|typeid|typename|union"
    "|unsigned|using|virtual|void|volatile|wchar_t"
)
_HEAD: Final = (
    ("std_msgs/Header header", "the common stamp that `restamp` gives, else the latest of the set"),
    ("uint64 number", "the number of the set, from 1"),
    ("string[] missing", "the fields below whose inputs are missing"),
    ("builtin_interfaces/Time[] stamps", "the stamp of each input, 0 of one that is missing"),
)


@dataclass(frozen=True, slots=True)
class SetMessage:
    """The message of a group. `fields` are those of its inputs in the file's order, with their types and topics."""

    group: str
    name: str
    topic: str
    fields: tuple[tuple[str, str, str], ...]

    @property
    def text(self) -> str:
        """The .msg file."""
        rows = [*_HEAD, *((f"{_short(type_name)} {field}", topic) for field, type_name, topic in self.fields)]
        width = max(len(code) for code, _ in rows)
        return "".join(f"{code:<{width}}  # {about}\n" for code, about in rows)

    @property
    def named(self) -> Mapping[str, str]:
        """The fields that the file has to name, because a relay would not find these by their names."""
        types = {field: type_name.replace("/msg/", "/") for field, type_name, _ in self.fields}
        inputs = [BundledInput(topic, type_name, None) for _, type_name, topic in self.fields]
        placed, _ = BundleType(self.name, types).place(inputs)
        found = [placed.get(index) for index in range(len(inputs))]
        wanted = [field for field, _, _ in self.fields]
        return {} if found == wanted else {field: topic for field, _, topic in self.fields}


def messages_of(config: Config, package: str) -> tuple[SetMessage, ...]:
    """Return the message of each group. Raises UsageError where a type is not known, or two messages have one name."""
    messages = tuple(_message(group, package) for group in config.groups)
    names = [each.name for each in messages]
    twice = [each for each in messages if names.count(each.name) > 1]
    if twice:
        groups = all_of(each.group for each in twice)
        raise UsageError(f"the groups {groups} would have one message, {twice[0].name}: write the `type` of a `bundle`")
    return messages


def _message(group: GroupConfig, package: str) -> SetMessage:
    untyped = [topic.topic for topic in group.topics if topic.type is None]
    if untyped:
        raise UsageError(f"{group.name}: write the `type` of {all_of(untyped)}: a field of the message has it")
    name = f"{_camel(group.name)}Set"
    written: Sequence[str | None] = (None,) * len(group.topics)
    if group.bundle is not None and group.bundle.type.startswith(f"{package}/"):
        name, written = group.bundle.type.rpartition("/")[2], group.bundle.fields
    taken = [*ROLES, *filter(None, written)]
    fields = []
    for topic, field in zip(group.topics, written, strict=True):
        chosen = field or _field(topic.topic, taken)
        taken.append(chosen)
        fields.append((chosen, str(topic.type), topic.topic))
    topic_name = group.bundle.topic if group.bundle is not None else f"/{group.name}/set"
    return SetMessage(group.name, name, topic_name, tuple(fields))


def package_of(config: Config, stem: str) -> str:
    """Return the package that the types of the bundles name, if it is one; else one that is named after the file."""
    named = {group.bundle.type.partition("/")[0] for group in config.groups if group.bundle is not None}
    words = "_".join(re.findall(r"[a-z0-9]+", stem.lower())) or "sets"
    return named.pop() if len(named) == 1 else f"{words if words[0].isalpha() else f'sets_{words}'}_interfaces"


def _camel(name: str) -> str:
    return "".join(f"{word[0].upper()}{word[1:]}" for word in name.split("_") if word)


def _short(type_name: str) -> str:
    return type_name.replace("/msg/", "/")


def _field(topic: str, taken: Sequence[str]) -> str:
    """Return a field's name for a topic: all words of the topic's name."""
    name = "_".join(re.findall(r"[a-z0-9]+", topic.lower()))
    if not name[:1].isalpha() or keyword.iskeyword(name) or _OF_CPP.fullmatch(name) or name in taken:
        name = f"input_{name}"
    return next(each for each in (name, *(f"{name}_{n}" for n in range(2, len(taken) + 3))) if each not in taken)
