"""Bundles of recorded sets: their types by the definitions that are installed, as no recording has them yet."""

import os
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from syncrelay.cdr_walk import UnreadableFieldError, walk_of
from syncrelay.config import GroupConfig
from syncrelay.config.interfaces import Interfaces
from syncrelay.dataflow.bundle import Bundle, BundleError
from syncrelay.errors import BagError
from syncrelay.recordings.bag.definitions import fields_in, hash_of, require_same, typestore
from syncrelay.recordings.bag.recording import Channel, Definition

_ZEROS: Final[Mapping[str, Any]] = {"string": "", "wstring": "", "bool": False, "float32": 0.0, "float64": 0.0}
# As rosbags names the elements of arrays to numpy.
_DTYPES: Final = {"byte": "int8", "octet": "int8", "char": "uint8"}


class RecordedBundle(NamedTuple):
    """What makes the bundles of a group, and the definition and hash of their type for a recording."""

    bundle: Bundle
    definition: Definition
    type_hash: str


def recorded_bundle(group: GroupConfig, channels: Iterable[Channel]) -> RecordedBundle | None:
    """Return what bundles the sets of a group that these channels give; None where the type is not installed here.

    Raises BagError where the type cannot hold the inputs, or has another definition of one than the recording.
    """
    assert group.bundle is not None  # noqa: S101  for mypy
    name = group.bundle.type
    interfaces = Interfaces.find(os.environ)
    text = interfaces.definition(name) if interfaces else None
    store = typestore(name, Definition("ros2msg", text)) if text else None
    if interfaces is None or text is None or store is None:
        return None
    for channel in channels:
        require_same(channel, store, of=name)
    fields_of = fields_in(store)
    try:
        # rosbags serializes nothing else.
        walk_of(fields_of, name.replace("/msg/", "/"))
        default = bytes(store.serialize_cdr(_default(store, interfaces, name), name))
        bundle = Bundle(group, fields_of, default)
    except (BundleError, UnreadableFieldError) as error:
        raise BagError(f"{group.name}: {error}") from error
    return RecordedBundle(bundle, Definition("ros2msg", text), hash_of(store, name))


def _default(store: Typestore, interfaces: Interfaces, name: str) -> Any:
    """Return a message with the default values of its definition."""
    written = {field.name: field.default for field in interfaces.fields(name) or ()}
    values = (_value(store, interfaces, kind, written.get(field, "")) for field, kind in store.fielddefs[name][1])
    return store.types[name](*values)


def _value(store: Typestore, interfaces: Interfaces, kind: Any, written: str) -> Any:
    what, of = kind
    if what == Nodetype.NAME:
        return _default(store, interfaces, of)
    if what == Nodetype.BASE:
        return _single(of[0], yaml.safe_load(written) if written else None)
    (element, element_of), count = of
    values = yaml.safe_load(written) if written else []
    if what == Nodetype.ARRAY and not values:
        values = [None] * count
    if element == Nodetype.NAME:
        return [_default(store, interfaces, element_of) for _ in values]
    singles = [_single(element_of[0], value) for value in values]
    is_text = element_of[0] in ("string", "wstring")
    return singles if is_text else np.array(singles, dtype=_DTYPES.get(element_of[0], element_of[0]))


def _single(name: str, value: Any) -> Any:
    zero = _ZEROS.get(name, 0)
    number = zero if value is None else type(zero)(value)
    # To rosbags a byte is signed.
    return number - 256 * (number > 127) if name in ("byte", "octet") else number  # noqa: PLR2004
