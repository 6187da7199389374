"""Other values for the file, and a group as it would be with them."""

from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

from syncrelay.config import GroupConfig, Tolerance
from syncrelay.config.file import file_format
from syncrelay.config.units import parse_duration
from syncrelay.explain import words
from syncrelay.explain.nearest import LONGEST


class Change(NamedTuple):
    """A value to write: of a group, or of one of its inputs."""

    key: str
    value: str
    input: int | None = None

    @property
    def parsed(self) -> Any:
        """The value as the group has it."""
        match self.key:
            case "policy" | "clock" | "stamp":
                return self.value
            case "queue_size":
                return int(self.value)
            case _:
                # A tolerance of the policy, whatever its key, or of an input, `max_wait`, `offset` or `delay`.
                return parse_duration(self.value)


Changes: TypeAlias = tuple[Change, ...]


def offset_change(index: int, by: int) -> Change | None:
    """Return an offset of an input as it stands in the file; None of one that is too large to be written there."""
    return Change("offset", words.exactly(by), index) if abs(by) <= LONGEST else None


def changed(config: GroupConfig, changes: Changes) -> GroupConfig:
    """Return a group as it would be with other values in the file."""
    options, topics = config.options, list(config.topics)
    values = {each.key: each.parsed for each in changes if each.input is None}
    if "policy" in values:
        form, policy = file_format(), values["policy"]
        of_policy = tuple(form.topics[policy].model_construct(**dict(topic)) for topic in options.topics)
        known = {key: value for key, value in dict(options).items() if key in form.groups[policy].model_fields}
        options = form.groups[policy].model_construct(**{**known, **values, "topics": of_policy})
    elif values:
        options = options.model_copy(update=values)
    for each in changes:
        if each.input is not None:
            topic, value = topics[each.input], each.parsed
            match each.key:
                case "clock":
                    topics[each.input] = replace(topic, is_of_device=value == "device")
                case "stamp":
                    topics[each.input] = replace(topic, stamp=value)
                case "delay":
                    topics[each.input] = replace(topic, delay_ns=value)
                case "tolerance":
                    topics[each.input] = replace(topic, tolerance=Tolerance(each.key, value))
                    keys = list(options.topics)
                    keys[each.input] = keys[each.input].model_copy(update={each.key: value})
                    options = options.model_copy(update={"topics": tuple(keys)})
                case _:
                    topics[each.input] = replace(topic, offset_ns=value)
    return replace(config, options=options, topics=tuple(topics))
