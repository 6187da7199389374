"""A file's groups and topics as far as they can be read: checks between them don't wait for every key to be right."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from syncrelay.config.document import Document, MappingNode, SequenceNode, mappings, plain
from syncrelay.config.names import (
    check_namespace,
    check_node_name,
    check_output_prefix,
    check_topic_name,
    default_output,
    expand,
)
from syncrelay.config.problems import Path
from syncrelay.config.typenames import check_field_path, check_type_name
from syncrelay.config.wording import quoted


@dataclass(frozen=True, slots=True)
class TopicDraft:
    """A topic. Names are absolute; what is missing or wrong is None. `key_path` is where its key is written.

    Where remaps make others of the names, `topic_before` and `output_before` are those that the file gives.
    """

    path: Path
    topic: str | None
    type: str | None
    output: str | None
    has_own_output: bool
    qos: Any
    has_header_stamp: bool
    stamp_field: str | None
    is_required: bool
    key: str | None
    key_path: Path
    topic_before: str | None = None
    output_before: str | None = None

    @property
    def topic_said(self) -> str:
        """The topic as a sentence names it, with what remaps made it from."""
        return _said(self.topic, self.topic_before)

    @property
    def output_said(self) -> str:
        """The output, likewise."""
        return _said(self.output, self.output_before)

    @property
    def output_path(self) -> Path:
        """The key that the output's name comes from."""
        return (*self.path, "output" if self.has_own_output else "topic")


@dataclass(frozen=True, slots=True)
class GroupDraft:
    """A group with those of its topics that are mappings.

    `restamp_topic` and `trigger_topic` are absolute, and None where they name no topic. `needs_max_wait` tells that
    its sets would wait for optional inputs without end.
    """

    path: Path
    restamp: str
    restamp_topic: str | None
    trigger: str | None
    trigger_topic: str | None
    needs_key: bool
    needs_max_wait: bool
    topics: tuple[TopicDraft, ...]

    @property
    def name(self) -> str:
        """The group's name."""
        return str(self.path[-1])


def remapped_from(before: str | None) -> str:
    """Return what a sentence adds to a name that remaps made of another; nothing where there is none."""
    return "" if before is None else f", remapped from {quoted(before)}"


def _said(name: str | None, before: str | None) -> str:
    return f"{quoted(str(name))}{remapped_from(before)}{',' if before else ''}"


def drafts(document: Document) -> tuple[GroupDraft, ...]:
    """Return what can be read of a file's groups."""
    return _drafts(document, absolute_names(document))


def remapped_drafts(document: Document, resolve: Callable[[str], str]) -> tuple[GroupDraft, ...]:
    """Return the groups of a file under the names that a node makes of the file's own: `resolve` gives them."""
    return tuple(
        replace(group, topics=tuple(map(_remapped, group.topics, before.topics)))
        for group, before in zip(_drafts(document, resolve), drafts(document), strict=True)
    )


def _remapped(topic: TopicDraft, before: TopicDraft) -> TopicDraft:
    return replace(
        topic,
        topic_before=before.topic if before.topic != topic.topic else None,
        output_before=before.output if before.output != topic.output else None,
    )


def _drafts(document: Document, absolute: Callable[[str], str]) -> tuple[GroupDraft, ...]:
    groups = document.find(("groups",))
    if groups is None:
        return ()
    return tuple(_group(("groups", *step), node, absolute) for step, node in mappings(groups))


def _group(path: Path, node: MappingNode, absolute: Callable[[str], str]) -> GroupDraft:
    prefix = _checked(check_output_prefix, _value(node, "output_prefix")) if "output_prefix" in node.entries else None
    restamp = _value(node, "restamp")
    restamp = restamp if isinstance(restamp, str) else "none"
    restamp_topic = None if restamp in ("none", "earliest", "latest") else _checked(check_topic_name, restamp)
    trigger = _checked(check_topic_name, _value(node, "trigger"))
    topics = node.entries["topics"].value if "topics" in node.entries else None
    return GroupDraft(
        path=path,
        restamp=restamp,
        restamp_topic=absolute(restamp_topic) if restamp_topic else None,
        trigger=trigger,
        trigger_topic=absolute(trigger) if trigger else None,
        needs_key=_value(node, "policy") == "equal_key",
        needs_max_wait=_value(node, "policy") != "latest_time" and "max_wait" not in node.entries,
        topics=tuple(
            _topic((*path, "topics", *step), topic, node, prefix=prefix or f"/{path[-1]}", absolute=absolute)
            for step, topic in (mappings(topics) if isinstance(topics, SequenceNode) else ())
        ),
    )


def _topic(
    path: Path, node: MappingNode, group: MappingNode, *, prefix: str, absolute: Callable[[str], str]
) -> TopicDraft:
    topic = _checked(check_topic_name, _value(node, "topic"))
    has_own_output = "output" in node.entries
    if has_own_output:
        output = _checked(check_topic_name, _value(node, "output"))
    else:
        output = default_output(topic, prefix=prefix) if topic else None
    stamp = _value(node, "stamp")
    has_own_key = "key" in node.entries
    return TopicDraft(
        path=path,
        topic=absolute(topic) if topic else None,
        type=_checked(check_type_name, _value(node, "type")),
        output=absolute(output) if output else None,
        has_own_output=has_own_output,
        qos=_value(node, "qos") or "auto",
        has_header_stamp="stamp" not in node.entries or stamp == "header",
        stamp_field=_checked(check_field_path, stamp.get("field")) if isinstance(stamp, dict) else None,
        is_required=_value(node, "required") is not False,
        key=_checked(check_field_path, _value(node if has_own_key else group, "key")),
        key_path=(*(path if has_own_key else path[:-2]), "key"),
    )


def node_name(document: Document) -> str:
    """Return the full name that a file gives to its node."""
    return absolute_names(document)("~")


def absolute_names(document: Document) -> Callable[[str], str]:
    """Return what makes a name of the file absolute, as its node does."""
    node = document.find(("node",))
    own = node if isinstance(node, MappingNode) else MappingNode(document.root.span)
    name = _checked(check_node_name, _value(own, "name")) or "syncrelay"
    namespace = _checked(check_namespace, _value(own, "namespace")) or ""
    return lambda topic: expand(topic, node=name, namespace=namespace)


def _value(node: MappingNode, key: str) -> Any:
    entry = node.entries.get(key)
    return plain(entry.value) if entry else None


def _checked(check: Callable[[str], str], value: Any) -> str | None:
    if not isinstance(value, str):
        return None
    try:
        return check(value)
    except ValueError:
        return None
