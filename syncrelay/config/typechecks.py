"""Checks of message types and fields against the installed interfaces, without importing them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from syncrelay.config.bundle import BundleType
from syncrelay.config.document import Document
from syncrelay.config.interfaces import HEADER, PRIMITIVES, TIME, Field, Interfaces
from syncrelay.config.models import StampField
from syncrelay.config.problems import Path, Problem, Severity
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.wording import one_of, or_nearest, quoted
from syncrelay.frames import TF_TYPE


class Wanted(NamedTuple):
    """The types that a field may have and what they are called; and those of which it may be an array."""

    types: frozenset[str]
    name: str
    in_arrays: frozenset[str] = frozenset()
    takes_messages: bool = False
    """Whether a message is accepted too: its fields are checked against the recording."""

    def takes(self, field: Field) -> bool:
        """Tell whether a field has a type that is wanted."""
        is_message = field.type not in PRIMITIVES and self.takes_messages
        return field.type in self.in_arrays if field.is_array else field.type in self.types or is_message


class _WantedField(NamedTuple):
    """A field that the file names: the key's place, the field's path, and the type it must have."""

    path: Path
    steps: str
    wanted: Wanted


TF_INSTALL: Final = "`apt-get install ros-jazzy-tf2-msgs`, or with ROS from PyPI see docs/howto/transforms.md"
"""What to do where the type of /tf is not installed."""

_A_TIME: Final = Wanted(frozenset([TIME]), TIME)
_A_KEY: Final = Wanted(PRIMITIVES - {"wstring"} | {TIME}, "a number, a string or a time")


@dataclass(frozen=True, slots=True)
class TypeChecks:
    """Checks of a file's types, and of the fields that it names in them."""

    document: Document
    interfaces: Interfaces

    def of_groups(self, groups: Sequence[GroupConfig]) -> Iterator[Problem]:
        """Yield types that are not installed, fields that they do not have, and notes on what could not be checked."""
        for group in groups:
            for path, topic in group.paths():
                if topic.type is not None and (*path, "type") not in self.document.faulty:
                    yield from self._topic(group, topic, topic.type, path)
            yield from self._kinds_of_keys(group)
            yield from self._restamp(group)
            yield from self._transforms(group)
            yield from self._bundle(group)

    def of_field(self, type_name: str, path: Path, steps: str, wanted: Wanted) -> Iterator[Problem]:
        """Yield what is wrong with the field that the file names at `path`; nothing of a type without its .msg file."""
        text = self._field_fault(type_name, (), steps.split("."), wanted)
        if text is not None:
            if filled_in := self.document.filled_in(path):
                text = f"expected a field of {type_name} that is {wanted.name}, found {filled_in}"
            yield self.document.problem(path, text, code="no_such_field", subject=type_name)

    def _topic(self, group: GroupConfig, topic: TopicConfig, type_name: str, path: Path) -> Iterator[Problem]:
        of_type = (*path, "type")
        if self._is_installed(type_name):
            asked = list(self._asked_fields(topic, path))
            goes_by_header = topic.stamp == "header" and (*path, "stamp") not in self.document.faulty
            fields = self.interfaces.fields(type_name)
            if fields is not None:
                for each in asked:
                    yield from self.of_field(type_name, *each)
                if goes_by_header and not _begins_with_header(fields):
                    yield self._no_header(group, type_name, path, fields)
            elif asked or goes_by_header:
                text = f"{quoted(type_name)} is installed without its .msg file, so its fields were not checked"
                yield self.document.problem(
                    of_type, text, code="not_checked", severity=Severity.NOTE, subject=type_name
                )
        # If another group gives the type, the problem is shown there.
        elif self.document.has(of_type):
            yield self._not_installed(type_name, of_type)

    def _is_installed(self, type_name: str) -> bool:
        package = type_name.partition("/")[0]
        return package in self.interfaces.packages and type_name in self.interfaces.types(package)

    def _not_installed(self, type_name: str, path: Path) -> Problem:
        package, _, name = type_name.split("/")
        code, severity, subject = "unknown_type", Severity.ERROR, type_name
        if package in self.interfaces.packages:
            text = self._no_message(package, name)
        elif package in self.interfaces.other_packages:
            text = f"the package {quoted(package)} defines no messages"
        else:
            # Stricter than usual: most package names share the ending _msgs.
            hint = self.document.did_you_mean(package, self.interfaces.packages, likeness=0.8)
            text = f"the package {quoted(package)} is not installed here, or not sourced{hint}"
            # The relay may run on another machine, and replay needs no package.
            code, severity, subject = "package_missing", Severity.NOTE, package
        if filled_in := self.document.filled_in(path):
            text, subject = f"this message type is not installed here, or not sourced: {filled_in}", ""
        return self.document.problem(path, text, code=code, severity=severity, subject=subject)

    def _no_message(self, package: str, name: str) -> str:
        types = self.interfaces.types(package)
        for kind, word in (("srv", "a service"), ("action", "an action")):
            if f"{package}/{kind}/{name}" in types:
                return f"{quoted(name)} is {word} of {package}, expected a message type"
        elsewhere = (f"{other}/msg/{name}" for other in self.interfaces.packages)
        close = next((each for each in elsewhere if self._is_installed(each)), None)
        if close is None:
            beginning = f"{package}/msg/"
            nearest = self.document.nearest(name, [each.removeprefix(beginning) for each in types if beginning in each])
            close = nearest and f"{beginning}{nearest}"
        return f"the package {package} has no message {quoted(name)}{or_nearest(close)}"

    def _kinds_of_keys(self, group: GroupConfig) -> Iterator[Problem]:
        """Yield the first key that can never equal the others: a text among numbers or times, or the reverse."""
        first: tuple[Path, bool] | None = None
        for path, topic in group.paths():
            asked = next((each for each in self._asked_fields(topic, path) if each.wanted is _A_KEY), None)
            found = asked and topic.type and self._field_at(topic.type, asked.steps.split("."))
            if not found or found.type not in _A_KEY.types or (*path, "type") in self.document.faulty:
                continue
            is_text = found.type == "string"
            first = first or (path, is_text)
            if is_text != first[1]:
                kinds = ("text", "a number or a time")
                kind, other = kinds if is_text else kinds[::-1]
                line = self.document.line((*first[0], "topic"), beside=(*path, "topic"))
                text = f"the key of this topic is {kind}, that of the topic on {line} is {other}: they are never equal"
                yield self.document.problem((*path, "topic"), text, code="conflict")
                return

    def _restamp(self, group: GroupConfig) -> Iterator[Problem]:
        if group.options.restamp == "none" or not group.topics:
            return
        known = [self.interfaces.fields(topic.type) if topic.type else None for topic in group.topics]
        if any(fields is None or _begins_with_header(fields) for fields in known):
            return
        text = "no type of this group begins with a std_msgs/msg/Header, so there is no stamp to set"
        yield self.document.problem((*group.path, "restamp"), text, code="no_header")

    def _transforms(self, group: GroupConfig) -> Iterator[Problem]:
        path = (*group.path, "transforms")
        if group.options.transforms is not None and not self._is_installed(TF_TYPE):
            text = f"{TF_TYPE} is not installed here, or not sourced, and the relay needs it for this: {TF_INSTALL}"
            yield self.document.problem(path, text, code="transforms_missing", severity=Severity.NOTE, subject=TF_TYPE)

    def _bundle(self, group: GroupConfig) -> Iterator[Problem]:
        path = (*group.path, "bundle")
        keys = {(*group.path, "bundle"), (*group.path, "topics")} | {(*each, "type") for each, _ in group.paths()}
        if group.bundle is None or keys & self.document.faulty or None in (topic.type for topic in group.topics):
            return
        type_name = group.bundle.type
        if not self._is_installed(type_name):
            yield self._not_installed(type_name, (*path, "type"))
            return
        if self.interfaces.fields(type_name) is None:
            text = f"{quoted(type_name)} is installed without its .msg file, so its fields were not checked"
            yield self.document.problem(
                (*path, "type"), text, code="not_checked", severity=Severity.NOTE, subject=type_name
            )
            return
        bundle = BundleType(type_name, self.interfaces.fields_of(type_name.replace("/msg/", "/")))
        for number, field, why in bundle.place(group.bundled())[1]:
            place = (*path, "type") if field is None else (*path, "fields", field)
            span = None if field is None else self.document.key_span(place)
            subject = str(group.topics[number].type)
            yield self.document.problem(place, why, code="no_such_field", span=span, subject=subject)

    def _asked_fields(self, topic: TopicConfig, path: Path) -> Iterator[_WantedField]:
        """Yield the fields of its messages that the file names for a topic."""
        if isinstance(topic.stamp, StampField):
            yield _WantedField((*path, "stamp", "field"), topic.stamp.field, _A_TIME)
        own = (*path, "key")
        written = own if self.document.has(own) else (*path[:2], "key")
        if topic.key is not None and written not in self.document.faulty:
            yield _WantedField(written, topic.key, _A_KEY)

    def _field_at(self, type_name: str, steps: Sequence[str]) -> Field | None:
        """Return the field at the end of a path; None if it cannot be found."""
        first, *rest = steps
        field = next((each for each in self.interfaces.fields(type_name) or () if each.name == first), None)
        if field is None or field.is_array:
            return None
        return self._field_at(field.type, rest) if rest else field

    def _field_fault(self, type_name: str, above: tuple[str, ...], steps: Sequence[str], wanted: Wanted) -> str | None:
        first, *rest = steps
        fields = self.interfaces.fields(type_name)
        if fields is None:
            return None
        by_name = {field.name: field for field in fields}
        field = by_name.get(first)
        if field is None:
            close = self.document.nearest(first, by_name)
            hint = f"did you mean `{'.'.join((*above, close, *rest))}`?" if close else f"it has {one_of(by_name)}"
            return f"{type_name} has no field {quoted(first)}, {hint}"
        found = f"{quoted(first)} of {type_name} is {field.type}{'[]' if field.is_array else ''}"
        if rest and (field.is_array or field.type in PRIMITIVES):
            return f"{found}, which has no field {quoted(rest[0])}"
        if rest:
            return self._field_fault(field.type, (*above, first), rest, wanted)
        if wanted.takes(field):
            return None
        times = self._time_paths(self.interfaces.fields(field.type) or ()) if TIME in wanted.types else iter(())
        below = next(times, None)
        hint = f", did you mean `{'.'.join((*above, first, below))}`?" if below else ""
        return f"{found}, expected {wanted.name}{hint}"

    def _no_header(self, group: GroupConfig, type_name: str, path: Path, fields: Sequence[Field]) -> Problem:
        times = list(self._time_paths(fields))
        ways = [f"`stamp: {{field: {times[0]}}}`"] if times else []
        tolerance = group.options.tolerance
        if tolerance is None or tolerance.takes_times_of_arrival:
            ways.insert(0, "`stamp: receive` to use the time of arrival")
        elif not times:
            beside = f"a {tolerance.key} above 0" if tolerance.is_key else f"`policy: {tolerance.wider_policy}`"
            ways = [f"`stamp: receive` to use the time of arrival, and {beside}"]
        text = (
            f"{quoted(type_name)} does not begin with a std_msgs/msg/Header, so it has no stamp there:"
            f" write {', or '.join(ways)}"
        )
        key = next((key for key in ("stamp", "type") if self.document.has((*path, key))), "topic")
        return self.document.problem((*path, key), text, code="no_header", subject=type_name)

    def _time_paths(self, fields: Sequence[Field], *, depth: int = 3) -> Iterator[str]:
        """Yield the paths of all times in a message, nearest to its top first."""
        singles = [field for field in fields if not field.is_array]
        yield from (field.name for field in singles if field.type == TIME)
        for field in singles if depth else ():
            below = self.interfaces.fields(field.type) if field.type != TIME else None
            yield from (f"{field.name}.{path}" for path in self._time_paths(below or (), depth=depth - 1))


def _begins_with_header(fields: Sequence[Field]) -> bool:
    return bool(fields) and fields[0].type == HEADER and not fields[0].is_array
