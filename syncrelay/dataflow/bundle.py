"""A set as one message: the messages of the set in its fields, and what is said of the set beside them."""

from collections.abc import Callable, Mapping, Sequence
from struct import Struct
from typing import Final

from syncrelay.cdr import Payload
from syncrelay.cdr_assembly import ENCAPSULATION, Assembler, UnfitError
from syncrelay.cdr_walk import FieldsOf
from syncrelay.config import GroupConfig
from syncrelay.config.bundle import BundleType, Role, roles_in
from syncrelay.dataflow.backend import Outlet, PublishError
from syncrelay.sync import Match

_NS_PER_SECOND: Final = 1_000_000_000
_STAMP: Final = Struct("<iI").pack
_COUNT: Final = Struct("<I").pack
_NUMBERS: Final = {"32": Struct("<I"), "64": Struct("<Q")}


class BundleError(Exception):
    """A type that cannot hold the inputs of a group, and why."""


class Bundle:
    """Makes the messages that hold the sets of a group."""

    def __init__(self, config: GroupConfig, fields_of: FieldsOf, default: Payload) -> None:
        """Take a group with a bundle, the fields of types named `pkg/Name`, and a message of the bundle's type.

        Fields that hold nothing have the values of that message. Raises BundleError where an input has no field, and
        UnreadableFieldError for a type without a plain layout.
        """
        assert config.bundle is not None  # noqa: S101  for mypy
        name, inputs = config.bundle.type, config.bundled()
        fields = fields_of(name.replace("/msg/", "/"))
        placed, unplaced = BundleType(name, fields).place(inputs)
        if unplaced:
            raise BundleError("; ".join(each.why for each in unplaced))
        self.fields: Final = tuple(placed[index] for index in range(len(inputs)))
        """The field of each input."""
        self.restamped: Final = tuple(_begins_with_header(fields_of, each.type) for each in inputs)
        """Which inputs' messages begin with a Header, whose stamp the set's common stamp replaces."""
        self._stamped = frozenset(field for field, begins in zip(self.fields, self.restamped, strict=True) if begins)
        self._assembler = Assembler(fields_of, name.replace("/msg/", "/"), default)
        self._number = next(
            (layout for bits, layout in _NUMBERS.items() if fields.get("number", "").endswith(bits)), None
        )
        self._roles = {field: _SAID[role] for field, role in roles_in(fields).items() if role is not Role.NUMBER}

    def content(
        self, contents: Sequence[Payload | None], stamps: Sequence[int | None], common: int | None, number: int
    ) -> bytes:
        """Return the message of a set: the payloads and stamps of its inputs, the stamp that it was given, its number.

        Raises UnfitError for a payload that is no message of its type.
        """
        given = {field: each for field, each in zip(self.fields, contents, strict=True) if each is not None}
        missing = [field for field in self.fields if field not in given]
        for field, said in self._roles.items():
            given[field] = ENCAPSULATION + said(stamps, common, missing)
        if self._number is not None:
            given["number"] = ENCAPSULATION + self._number.pack(number)
        return self._assembler.assemble(given, stamp=common, stamped=self._stamped)


def _begins_with_header(fields_of: FieldsOf, type_name: str) -> bool:
    return next(iter(fields_of(type_name.replace("/msg/", "/")).values()), None) == "std_msgs/Header"


def _header(stamps: Sequence[int | None], common: int | None, _missing: Sequence[str]) -> bytes:
    stamp = max(stamp for stamp in stamps if stamp is not None) if common is None else common
    return _STAMP(*divmod(stamp, _NS_PER_SECOND)) + _COUNT(1) + b"\0"


def _stamps(stamps: Sequence[int | None], _common: int | None, _missing: Sequence[str]) -> bytes:
    return _COUNT(len(stamps)) + b"".join([_STAMP(*divmod(stamp or 0, _NS_PER_SECOND)) for stamp in stamps])


def _missing(_stamps: Sequence[int | None], _common: int | None, missing: Sequence[str]) -> bytes:
    content = _COUNT(len(missing))
    for field in missing:
        content += bytes(-len(content) % 4) + _COUNT(len(field) + 1) + field.encode() + b"\0"
    return content


_Said = Callable[[Sequence[int | None], int | None, Sequence[str]], bytes]
_SAID: Final[Mapping[Role, _Said]] = {Role.HEADER: _header, Role.STAMPS: _stamps, Role.MISSING: _missing}


class BundleOutlet:
    """Publishes the sets of a group as bundles. On the receive thread."""

    def __init__(
        self, bundle: Bundle, outlet: Outlet, note: Callable[[Outlet, UnfitError | PublishError | None], None]
    ) -> None:
        """Have `note` hear of each bundle why it could not be published, or None."""
        self._bundle = bundle
        self._outlet = outlet
        self._note = note

    @property
    def sent(self) -> int:
        """How many it has published: DDS numbers them alike."""
        return self._outlet.sent

    def send(self, match: Match, number: int) -> None:
        """Publish a set, the one with this number."""
        contents = [None if message is None else message.payload.content() for message in match.messages]
        failed = None
        try:
            self._outlet.send_content(self._bundle.content(contents, match.stamps, match.stamp, number))
        except (UnfitError, PublishError) as error:
            failed = error
        self._note(self._outlet, failed)
