"""Message types by name, and where in a payload the stamp of a type is found."""

import importlib
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from syncrelay.cdr import read_stamp
from syncrelay.cdr_fields import UnreadableFieldError, field_reader
from syncrelay.config import StampField, StampSource
from syncrelay.dataflow.backend import Content
from syncrelay.errors import TypeImportError

StampReader: TypeAlias = Callable[[Content], int | None]
"""From a payload to its stamp in nanoseconds; None where none can be read."""


def import_type(name: str) -> Any:
    """Import the class of a full type name, `pkg/msg/Name`; raises TypeImportError saying what failed."""
    package, kind, message = name.split("/")
    try:
        module = importlib.import_module(f"{package}.{kind}")
        message_type = getattr(module, message)
        # The C support library is loaded here, not at import: a broken package shows only now.
        message_type.__class__.__import_type_support__()
    except (ImportError, AttributeError, OSError) as error:
        raise TypeImportError(
            f"{name} cannot be imported: {error}\n"
            f"  Is the package {package} built for this Python and sourced in this shell?"
        ) from error
    return message_type


def name_of(message_type: Any) -> str:
    """Return the full name of a message class, `pkg/msg/Name`."""
    return f"{message_type.__module__.split('.')[0]}/msg/{message_type.__name__}"


def begins_with_header(message_type: Any) -> bool:
    """Whether payloads of a type begin with a std_msgs/Header, whose stamp is at a fixed place."""
    fields = message_type.get_fields_and_field_types()
    return bool(fields) and next(iter(fields.values())) == "std_msgs/Header"


def stamp_reader(source: StampSource, message_type: Any) -> StampReader | None:
    """How to read the stamp that the file asks for; None for the receive time, which no payload holds."""
    if isinstance(source, StampField):
        return value_reader(message_type, source.field)
    return read_stamp if source == "header" else None


def value_reader(message_type: Any, path: str) -> Callable[[Content], Any]:
    """What reads the field at a dotted path: a number, a text, or a time in nanoseconds; None where it cannot.

    Raises TypeImportError where the type has no such field.
    """
    name = name_of(message_type)
    try:
        return field_reader(_fields_of, name.replace("/msg/", "/"), path)
    except UnreadableFieldError as error:
        raise TypeImportError(f"{name} has no usable field {path}: {error}") from error


def _fields_of(name: str) -> Mapping[str, str]:
    package, message = name.split("/")
    fields: Mapping[str, str] = import_type(f"{package}/msg/{message}").get_fields_and_field_types()
    return fields
