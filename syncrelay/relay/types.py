"""Message types by name, and where in a payload the stamp of a type is found."""

import importlib
from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

from syncrelay.cdr import read_stamp
from syncrelay.cdr_fields import field_reader, time_reader
from syncrelay.cdr_walk import FieldsOf, UnreadableFieldError
from syncrelay.config import StampField, StampSource
from syncrelay.config.names import check_type_name
from syncrelay.dataflow.backend import Content
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint

StampReader: TypeAlias = Callable[[Content], int | None]
"""From a payload to its stamp in nanoseconds; None where none can be read."""
_ReaderOf = TypeVar("_ReaderOf", bound=Callable[[Content], Any])

# Nodes are found one after the other: within this time another may publish another type.
_SETTLE_S: Final = 0.5


class SettlingType:
    """The type that the publishers of a topic agree on, once they have agreed for long enough."""

    def __init__(self) -> None:
        self._types: frozenset[str] = frozenset()
        self._since = 0.0

    def publisher(self, publishers: Sequence[Endpoint], *, now: float) -> Endpoint | None:
        """Return the publisher whose type is to be taken, None as long as there is none; `now` is in seconds."""
        types = frozenset(each.type for each in publishers)
        if types != self._types:
            self._types, self._since = types, now
        if len(types) != 1 or now - self._since < _SETTLE_S:
            return None
        return next((each for each in publishers if each.is_named), publishers[0])


def import_type(name: str) -> Any:
    """Import the class of a full type name, `pkg/msg/Name`; raises TypeImportError saying what failed.

    The graph may name any type: nothing is imported from a package without messages.
    """
    try:
        package, kind, message = check_type_name(name).split("/")
    except ValueError as error:
        raise TypeImportError(str(error)) from error
    try:
        _require_messages(package, kind)
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


def _require_messages(package: str, kind: str) -> None:
    """Raise ImportError for a package that is there, and has no messages."""
    spec = find_spec(package)
    folders = spec.submodule_search_locations if spec is not None else None
    if spec is not None and not any(Path(folder, kind).is_dir() for folder in folders or ()):
        raise ImportError(f"the package {package} has no {kind}")


def name_of(message_type: Any) -> str:
    """Return the full name of a message class, `pkg/msg/Name`."""
    return f"{message_type.__module__.split('.')[0]}/msg/{message_type.__name__}"


def begins_with_header(message_type: Any) -> bool:
    """Whether payloads of a type begin with a std_msgs/Header, whose stamp is at a fixed place."""
    fields = message_type.get_fields_and_field_types()
    return bool(fields) and next(iter(fields.values())) == "std_msgs/Header"


def stamp_reader(source: StampSource, message_type: Any) -> StampReader | None:
    """Return how to read the stamp that the file names; None for the receive time, which is not in the payload.

    Raises TypeImportError where the type has no such stamp.
    """
    if isinstance(source, StampField):
        return _reader(time_reader, message_type, source.field)
    if source == "receive":
        return None
    if not begins_with_header(message_type):
        raise TypeImportError(f"{name_of(message_type)} does not begin with a std_msgs/msg/Header, so it has no stamp")
    return read_stamp


def value_reader(message_type: Any, path: str) -> Callable[[Content], Any]:
    """Return what reads the field at a dotted path: a number, a text, or a time in nanoseconds; None if it cannot.

    Raises TypeImportError where the type has no such field.
    """
    return _reader(field_reader, message_type, path)


def _reader(make: Callable[[FieldsOf, str, str], _ReaderOf], message_type: Any, path: str) -> _ReaderOf:
    name = name_of(message_type)
    try:
        return make(fields_of, name.replace("/msg/", "/"), path)
    except UnreadableFieldError as error:
        raise TypeImportError(f"{name} has no usable field {path}: {error}") from error


def fields_of(name: str) -> Mapping[str, str]:
    """Return the fields of an installed type, named `pkg/Name`, and their types. Raises TypeImportError."""
    package, message = name.split("/")
    fields: Mapping[str, str] = import_type(f"{package}/msg/{message}").get_fields_and_field_types()
    return fields
