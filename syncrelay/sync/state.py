"""What decides what leaves an engine from now on: two engines of equal state give equal sets for ever after."""

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from enum import Enum
from types import MethodType
from typing import Any, TypeAlias

from syncrelay.sync.messages import Message

Name: TypeAlias = Callable[[Any], Hashable]
"""From a message's payload to what tells the message from all others of its input."""

_UNSET = "unset"


def state_of(part: Any, name: Name) -> Hashable:
    """Return the state of an engine or a part of it, as a value that can be compared, hashed and pickled.

    All attributes of a part are in it, and those of the parts in them, so that a new one cannot be forgotten. A
    part leaves out what it lists in `aside`, because nothing that leaves depends on it, and adds what it gives
    `in_effect`, which is what the values set aside still decide. Raises TypeError for a value of another kind than
    parts, messages and plain values.
    """
    match part:
        case None | bool() | int() | float() | str() | bytes() | Enum():
            return part
        case Message():
            return (part.input, part.stamp, part.key, name(part.payload))
        case list() | tuple() | deque():
            return tuple([state_of(each, name) for each in part])
        case dict():
            # In their order, which may decide: of two orders, at worst, two states are not seen to be equal.
            return tuple([(state_of(key, name), state_of(value, name)) for key, value in part.items()])
        case set() | frozenset():
            return tuple(sorted(part))
    attributes = [each for each in _attributes(part) if each not in getattr(part, "aside", ())]
    if not hasattr(part, "aside") and not attributes:
        raise TypeError(f"{part!r} has no state that can be told")
    values = {each: getattr(part, each, _UNSET) for each in attributes}
    in_effect = part.in_effect() if hasattr(part, "in_effect") else ()
    # Methods that are kept to be called faster belong to parts that are told anyway.
    told = [(each, state_of(value, name)) for each, value in values.items() if not isinstance(value, MethodType)]
    return (type(part).__name__, *told, state_of(in_effect, name))


def _attributes(part: Any) -> Iterator[str]:
    """Yield the names of all attributes of an object, sorted within each of its classes."""
    for kind in type(part).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        yield from sorted((slots,) if isinstance(slots, str) else slots)
    yield from sorted(getattr(part, "__dict__", ()))
