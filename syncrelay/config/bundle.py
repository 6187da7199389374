"""`bundle`: which field of a message holds which input of a set, and what is filled in beside them."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple, TypeVar

from pydantic import Field

from syncrelay.config.keys import FieldPath, Keys, TopicName, TypeName
from syncrelay.config.qos import AUTO, Qos
from syncrelay.config.wording import all_of, did_you_mean, one_of, quoted

_Scored = TypeVar("_Scored")


class BundleKeys(Keys):
    """The whole set as one message, in whose fields the messages of the set stand."""

    topic: TopicName = Field(description="Name of the topic that the sets leave on.", examples=["/front/set"])
    type: TypeName = Field(
        description=(
            "Message type in full: any that has a field for each input. `header`, `stamps`, `number` and `missing` are"
            " filled too, where the type has them. `syncrelay interfaces` writes such types."
        ),
        examples=["realsense2_camera_msgs/msg/RGBD"],
    )
    fields: dict[FieldPath, TopicName] = Field(
        default={},
        description=(
            "Inputs by the fields that hold them. Default: found by their types and, where several have one type, by"
            " the words of their names."
        ),
        examples=[{"rgb": "/camera/color/image_raw"}],
    )
    qos: Qos = Field(
        default=AUTO,
        description="QoS of the bundle, as at a topic: `auto` offers what all inputs are received with. Default: auto.",
        examples=["auto", "sensor_data"],
        json_schema_extra={"default": "auto"},
    )


class Role(Enum):
    """A field that is filled beside the inputs, by its name; the value has the types that it may have, by rosidl."""

    HEADER = re.compile(r"std_msgs/Header")
    """The set's common stamp, or else the latest of the set; no frame."""
    STAMPS = re.compile(r"sequence<builtin_interfaces/Time(, \d+)?>")
    """The stamp of each input, 0 of one that is missing."""
    NUMBER = re.compile(r"u?int(32|64)")
    """The number of the set, from 1."""
    MISSING = re.compile(r"sequence<string(<\d+>)?(, \d+)?>")
    """The fields of the inputs that are missing."""

    @property
    def field(self) -> str:
        """The name of its field."""
        return self.name.lower()


ROLES: Final = {role.field: role for role in Role}


def roles_in(fields: Mapping[str, str]) -> dict[str, Role]:
    """Return the fields of a type that are filled beside the inputs."""
    return {name: role for name, role in ROLES.items() if role.value.fullmatch(fields.get(name, ""))}


class BundledInput(NamedTuple):
    """An input, its type, and the field that the file names for it, if any."""

    topic: str
    type: str
    field: str | None


class Unplaced(NamedTuple):
    """Why the input with this number, from 0, and maybe others have no field; `field` is what the file names for it."""

    number: int
    field: str | None
    why: str


@dataclass(frozen=True, slots=True)
class BundleType:
    """A type of bundles: its name, and its fields with their types, in rosidl's words."""

    name: str
    fields: Mapping[str, str]

    def place(self, inputs: Sequence[BundledInput]) -> tuple[dict[int, str], list[Unplaced]]:
        """Return the field of each input, by its index, and which inputs have none.

        An input gets the field that the file names; else the only one of its type; among several the one of whose name
        all words are in the topic's name, that of most words; else the one that is left.
        """
        placed: dict[int, str] = {}
        unplaced: list[Unplaced] = []
        for index, each in enumerate(inputs):
            if each.field is not None:
                why = self._misfit(each, each.field)
                placed[index] = each.field
                unplaced += [Unplaced(index, each.field, why)] if why else []
        for type_name in dict.fromkeys(each.type for each in inputs):
            left = {index: each for index, each in enumerate(inputs) if each.type == type_name and index not in placed}
            free = [name for name in self._holding(type_name) if name not in placed.values()]
            by_name = _by_name({index: each.topic for index, each in left.items()}, free)
            rest, unused = left.keys() - by_name.keys(), set(free) - set(by_name.values())
            if len(rest) == len(unused) == 1:
                by_name[rest.pop()] = unused.pop()
            placed |= by_name
            if rest:
                why = self._no_field([left[index] for index in sorted(rest)], [name for name in free if name in unused])
                unplaced.append(Unplaced(min(rest), None, why))
        return placed, unplaced

    def _holding(self, type_name: str) -> list[str]:
        wanted = type_name.replace("/msg/", "/")
        filled = roles_in(self.fields)
        return [name for name, each in self.fields.items() if each == wanted and name not in filled]

    def _misfit(self, each: BundledInput, field: str) -> str | None:
        found = self.fields.get(field)
        if found is None:
            hint = did_you_mean(field, self.fields) or f", it has {one_of(self.fields)}"
            return f"{self.name} has no field {quoted(field)}{hint}"
        found = found.replace("/", "/msg/")
        return None if found == each.type else f"{quoted(field)} of {self.name} is {found}, {each.topic} is {each.type}"

    def _no_field(self, inputs: Sequence[BundledInput], candidates: Sequence[str]) -> str:
        """Return why inputs of one type have no fields, of which these are left."""
        topics, type_name = [each.topic for each in inputs], inputs[0].type
        if len(candidates) >= len(inputs):
            written = f"`fields: {{{candidates[0]}: {topics[0]}}}`"
            return f"{one_of(candidates)} of {self.name} may hold {all_of(topics)}: say which, for example {written}"
        messages = [
            f"{name} ({each.replace('/', '/msg/')})"
            for name, each in self.fields.items()
            if "/" in each and not {"[", "<"} & {*each} and name not in roles_in(self.fields)
        ]
        held = f"it holds {all_of(messages)}" if messages else "it holds no messages"
        wanted = type_name.replace("/msg/", "/")
        if arrays := [name for name, each in self.fields.items() if re.search(rf"(^|<){wanted}(,|>|\[)", each)]:
            held += f"; a bundle fills no arrays of messages, as {all_of(arrays)}"
        return f"{self.name} has too few fields of {type_name} for {all_of(topics)}: {held}"


def _by_name(topics: Mapping[int, str], fields: Sequence[str]) -> dict[int, str]:
    """Return the field of each topic that is the best for it, where it is also the best for the field."""
    if len(topics) == len(fields) == 1:
        return {next(iter(topics)): fields[0]}
    scores = {(index, field): _score(topic, field) for index, topic in topics.items() for field in fields}
    of_field = {field: _best({index: scores[index, field] for index in topics}) for field in fields}
    of_topic = {index: _best({field: scores[index, field] for field in fields}) for index in topics}
    return {index: field for index, field in of_topic.items() if field is not None and of_field[field] == index}


def _score(topic: str, field: str) -> int:
    """Return how many words of a field's name are in a topic's; 0 if not all are."""
    words, of_field = set(_words(topic)), set(_words(field))
    return len(of_field) if of_field <= words else 0


def _words(name: str) -> Iterator[str]:
    return (word for word in re.split(r"[/_~]", name.lower()) if word)


def _best(scores: Mapping[_Scored, int]) -> _Scored | None:
    """Return what has the highest score, alone and above 0."""
    best = max(scores.values(), default=0)
    if not best or Counter(scores.values())[best] > 1:
        return None
    return next(each for each, score in scores.items() if score == best)
