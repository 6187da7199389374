"""Checks of message types and fields against the installed interfaces, without importing them."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from syncrelay.config.document import Document
from syncrelay.config.interfaces import HEADER, PRIMITIVES, TIME, Field, Interfaces
from syncrelay.config.models import StampField
from syncrelay.config.problems import Path, Problem, Severity
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.wording import one_of, or_nearest, quoted


def check_types(groups: Sequence[GroupConfig], document: Document, interfaces: Interfaces) -> Iterator[Problem]:
    """Yield types that are not installed, fields that they do not have, and notes on what could not be checked."""
    for group in groups:
        for path, topic in group.paths():
            if topic.type is not None and (*path, "type") not in document.faulty:
                yield from _check_topic(group, topic, path, document, interfaces)
        yield from _check_kinds_of_keys(group, document, interfaces)
        yield from _check_restamp(group, document, interfaces)


def _check_topic(
    group: GroupConfig, topic: TopicConfig, path: Path, document: Document, interfaces: Interfaces
) -> Iterator[Problem]:
    of_type, type_name = (*path, "type"), topic.type or ""
    package = type_name.partition("/")[0]
    fault = _not_installed(type_name, document, interfaces)
    asked = list(_asked_fields(topic, path, document))
    goes_by_header = topic.stamp == "header" and (*path, "stamp") not in document.faulty
    if fault is not None:
        text, code = fault
        # The relay may run on another machine, and replay needs no package.
        severity = Severity.NOTE if code == "package_missing" else Severity.ERROR
        subject = package if code == "package_missing" else type_name
        if filled_in := document.filled_in(of_type):
            text, subject = f"this message type is not installed here, or not sourced: {filled_in}", ""
        # If another group gives the type, the problem is shown there.
        if document.has(of_type):
            yield document.problem(of_type, text, code=code, severity=severity, subject=subject)
    elif asked or goes_by_header:
        fields = interfaces.fields(type_name)
        if fields is None:
            text = f"{quoted(type_name)} is installed without its .msg file, so its fields were not checked"
            yield document.problem(of_type, text, code="not_checked", severity=Severity.NOTE, subject=type_name)
            return
        for each in asked:
            yield from check_field(
                type_name, each.path, each.steps, each.wanted, document=document, interfaces=interfaces
            )
        if goes_by_header and not _begins_with_header(fields):
            yield _no_header(group, type_name, path, fields, document=document, interfaces=interfaces)


def _check_kinds_of_keys(group: GroupConfig, document: Document, interfaces: Interfaces) -> Iterator[Problem]:
    """Yield the first key that can never equal the others: a text among numbers or times, or the reverse."""
    first: tuple[Path, bool] | None = None
    for path, topic in group.paths():
        asked = next((each for each in _asked_fields(topic, path, document) if each.wanted is _A_KEY), None)
        found = asked and topic.type and _field_at(topic.type, asked.steps.split("."), interfaces)
        if not asked or not found or found.type not in _A_KEY.types or (*path, "type") in document.faulty:
            continue
        is_text = found.type == "string"
        first = first or (path, is_text)
        if is_text != first[1]:
            kinds = ("text", "a number or a time")
            kind, other = kinds if is_text else kinds[::-1]
            line = document.line((*first[0], "topic"), beside=(*path, "topic"))
            text = f"the key of this topic is {kind}, that of the topic on {line} is {other}: they are never equal"
            yield document.problem((*path, "topic"), text, code="conflict")
            return


def _field_at(type_name: str, steps: Sequence[str], interfaces: Interfaces) -> Field | None:
    """Return the field at the end of a path; None if it cannot be found."""
    first, *rest = steps
    field = next((each for each in interfaces.fields(type_name) or () if each.name == first), None)
    if field is None or field.is_array:
        return None
    return _field_at(field.type, rest, interfaces) if rest else field


def _asked_fields(topic: TopicConfig, path: Path, document: Document) -> Iterator["_WantedField"]:
    """Yield the fields of its messages that the file names for a topic."""
    if isinstance(topic.stamp, StampField):
        yield _WantedField((*path, "stamp", "field"), topic.stamp.field, _A_TIME)
    own = (*path, "key")
    written = own if document.has(own) else (*path[:2], "key")
    if topic.key is not None and written not in document.faulty:
        yield _WantedField(written, topic.key, _A_KEY)


def _not_installed(type_name: str, document: Document, interfaces: Interfaces) -> tuple[str, str] | None:
    package = type_name.partition("/")[0]
    if package not in interfaces.packages:
        if package in interfaces.other_packages:
            return f"the package {quoted(package)} defines no messages", "unknown_type"
        # Stricter than usual: most package names share the ending _msgs.
        hint = document.did_you_mean(package, interfaces.packages, likeness=0.8)
        return f"the package {quoted(package)} is not installed here, or not sourced{hint}", "package_missing"
    types = interfaces.types(package)
    if type_name in types:
        return None
    messages = [name for name in types if name.startswith(f"{package}/msg/")]
    name = type_name.rpartition("/")[2]
    for kind, word in (("srv", "a service"), ("action", "an action")):
        if f"{package}/{kind}/{name}" in types:
            return f"{quoted(name)} is {word} of {package}, expected a message type", "unknown_type"
    close = next(_same_name_elsewhere(name, interfaces), None) or _nearest_message(name, messages, document)
    return f"the package {package} has no message {quoted(name)}{or_nearest(close)}", "unknown_type"


def _nearest_message(name: str, messages: Sequence[str], document: Document) -> str | None:
    by_name = {message.rpartition("/")[2]: message for message in messages}
    close = document.nearest(name, by_name)
    return by_name[close] if close else None


def _same_name_elsewhere(name: str, interfaces: Interfaces) -> Iterator[str]:
    for package in interfaces.packages:
        if f"{package}/msg/{name}" in interfaces.types(package):
            yield f"{package}/msg/{name}"


def _begins_with_header(fields: Sequence[Field]) -> bool:
    return bool(fields) and fields[0].type == HEADER and not fields[0].is_array


def _no_header(
    group: GroupConfig,
    type_name: str,
    path: Path,
    fields: Sequence[Field],
    *,
    document: Document,
    interfaces: Interfaces,
) -> Problem:
    times = list(_time_paths(fields, interfaces))
    ways = [f"`stamp: {{field: {times[0]}}}`"] if times else []
    tolerance = group.options.tolerance
    if tolerance is None or tolerance.takes_times_of_arrival:
        ways.insert(0, "`stamp: receive` to use the time of arrival")
    elif not times:
        ways = [f"`stamp: receive` to use the time of arrival, and a {tolerance.key} above 0"]
        if tolerance.wider_policy is not None:
            ways = [f"`stamp: receive` to use the time of arrival, and `policy: {tolerance.wider_policy}`"]
    text = (
        f"{quoted(type_name)} does not begin with a std_msgs/msg/Header, so it has no stamp there:"
        f" write {', or '.join(ways)}"
    )
    key = next((key for key in ("stamp", "type") if document.has((*path, key))), "topic")
    return document.problem((*path, key), text, code="no_header", subject=type_name)


def _time_paths(fields: Sequence[Field], interfaces: Interfaces, *, depth: int = 3) -> Iterator[str]:
    """Yield the paths of all times in a message, nearest to its top first."""
    singles = [field for field in fields if not field.is_array]
    yield from (field.name for field in singles if field.type == TIME)
    for field in singles if depth else ():
        below = interfaces.fields(field.type) if field.type != TIME else None
        yield from (f"{field.name}.{path}" for path in _time_paths(below or (), interfaces, depth=depth - 1))


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


_A_TIME: Final = Wanted(frozenset([TIME]), TIME)
_A_KEY: Final = Wanted(PRIMITIVES - {"wstring"} | {TIME}, "a number, a string or a time")


def check_field(
    type_name: str, path: Path, steps: str, wanted: Wanted, *, document: Document, interfaces: Interfaces
) -> Iterator[Problem]:
    """Yield what is wrong with the fields that the file names at `path`. A type without its .msg file is believed."""
    text = _field_fault(type_name, (), steps.split("."), wanted, interfaces, document=document)
    if text is not None:
        if filled_in := document.filled_in(path):
            text = f"expected a field of {type_name} that is {wanted.name}, found {filled_in}"
        yield document.problem(path, text, code="no_such_field", subject=type_name)


def _field_fault(
    type_name: str,
    above: tuple[str, ...],
    steps: Sequence[str],
    wanted: Wanted,
    interfaces: Interfaces,
    *,
    document: Document,
) -> str | None:
    first, *rest = steps
    fields = interfaces.fields(type_name)
    if fields is None:
        return None
    by_name = {field.name: field for field in fields}
    field = by_name.get(first)
    if field is None:
        close = document.nearest(first, by_name)
        hint = f"did you mean `{'.'.join((*above, close, *rest))}`?" if close else f"it has {one_of(by_name)}"
        return f"{type_name} has no field {quoted(first)}, {hint}"
    found = f"{quoted(first)} of {type_name} is {field.type}{'[]' if field.is_array else ''}"
    if rest and (field.is_array or field.type in PRIMITIVES):
        return f"{found}, which has no field {quoted(rest[0])}"
    if rest:
        return _field_fault(field.type, (*above, first), rest, wanted, interfaces, document=document)
    hint = _time_below((*above, first), field, interfaces) if TIME in wanted.types else ""
    return None if wanted.takes(field) else f"{found}, expected {wanted.name}{hint}"


def _time_below(path: tuple[str, ...], field: Field, interfaces: Interfaces) -> str:
    below = next(_time_paths(interfaces.fields(field.type) or (), interfaces), None)
    return f", did you mean `{'.'.join((*path, below))}`?" if below else ""


def _check_restamp(group: GroupConfig, document: Document, interfaces: Interfaces) -> Iterator[Problem]:
    if group.options.restamp == "none" or not group.topics:
        return
    known = [interfaces.fields(topic.type) if topic.type else None for topic in group.topics]
    if any(fields is None or _begins_with_header(fields) for fields in known):
        return
    text = "no type of this group begins with a std_msgs/msg/Header, so there is no stamp to set"
    yield document.problem((*group.path, "restamp"), text, code="no_header")
