"""Merging: `defaults` into the groups, and several files into one."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from syncrelay.config.document import MOST_VALUES, Document, Entry, MappingNode, ScalarNode
from syncrelay.config.file import FileKeys, file_format
from syncrelay.config.problems import ConfigError, Path, Problem
from syncrelay.config.wording import quoted
from syncrelay.printable import printable

_ONE_FOR_ALL = ("node", "metrics", "diagnostics", "export")


def with_defaults(document: Document) -> Document:
    """Return the document with `defaults` copied into every group that lacks a key and whose policy has it.

    The keys keep their place, so a fault in one is shown where it was written. Raises ConfigError where they come to
    more than can be looked at.
    """
    root, defaults, groups = document.root, document.find(("defaults",)), document.find(("groups",))
    if not (isinstance(root, MappingNode) and isinstance(defaults, MappingNode) and isinstance(groups, MappingNode)):
        return document
    filled = MappingNode(
        groups.span,
        {
            name: Entry(group.key, _filled(group.value, defaults)) if isinstance(group.value, MappingNode) else group
            for name, group in groups.entries.items()
        },
    )
    if sum(group.value.size for group in filled.entries.values()) > MOST_VALUES:
        text = f"copied into every group they come to more than {MOST_VALUES} values"
        raise ConfigError([document.problem(("defaults",), text, code="yaml", span=document.key_span(("defaults",)))])
    entries = root.entries | {"groups": Entry(root.entries["groups"].key, filled)}
    return replace(document, root=MappingNode(root.span, entries))


def _filled(group: MappingNode, defaults: MappingNode) -> MappingNode:
    policy = (group.entries.get("policy") or defaults.entries.get("policy") or (None, None))[1]
    model = file_format().group(policy.value if isinstance(policy, ScalarNode) else None)
    own = {
        key: entry
        for key, entry in defaults.entries.items()
        if key in model.model_fields and key != "topics" and key not in group.entries
    }
    return MappingNode(group.span, own | group.entries, group.size + sum(entry.value.size for entry in own.values()))


def merged_documents(documents: Sequence[Document]) -> tuple[Document, list[Problem]]:
    """Return one tree for all files, and a problem for each key that only one of them may have.

    `defaults` are already in the groups, so the tree of several files has none.
    """
    if len(documents) == 1:
        return documents[0], []
    first = documents[0]
    groups = MappingNode(first.root.span)
    merged = Document(
        {index: source for document in documents for index, source in document.sources.items()},
        MappingNode(first.root.span, {"groups": Entry(first.root.span, groups)}),
        frozenset(path for document in documents for path in document.faulty),
        {value: written for document in documents for value, written in document.variables.items()},
    )
    problems: list[Problem] = []
    for document in documents:
        for key in _ONE_FOR_ALL:
            problems += _take((key,), document, merged)
        for name in _names(document):
            problems += _take(("groups", name), document, merged)
        problems += _idle_defaults(document)
    return merged, problems


def merged_files(files: Sequence[FileKeys]) -> FileKeys:
    """Return the keys of all files in one. Of what only one file may have, the first counts."""
    merged: dict[str, Any] = {"groups": {}}
    for name, group in (each for file in files for each in file.groups.items()):
        merged["groups"].setdefault(name, group)
    for key in _ONE_FOR_ALL:
        owner = next((file for file in files if key in file.model_fields_set), files[0])
        merged[key] = getattr(owner, key)
    return files[0].model_copy(update=merged)


def _names(document: Document) -> tuple[str, ...]:
    groups = document.find(("groups",))
    return tuple(groups.entries) if isinstance(groups, MappingNode) else ()


def _take(path: Path, document: Document, merged: Document) -> list[Problem]:
    """Copy the entry at a path into the merged tree; yield a problem if the tree already has one."""
    *parents, key = path
    owner, own = merged.node(tuple(parents)), document.node(tuple(parents))
    if not isinstance(owner, MappingNode) or not isinstance(own, MappingNode) or str(key) not in own.entries:
        return []
    entry = own.entries[str(key)]
    there = owner.entries.setdefault(str(key), entry)
    if there is entry:
        return []
    place = f"line {there.key.line} of {printable(merged.sources[there.key.source].name)}"
    text = (
        f"the group {quoted(str(key))} is also on {place}: rename one of them"
        if parents
        else f"`{key}` is also on {place}: files that run together may have it only once"
    )
    return [document.problem(path, text, code="duplicate_key", span=entry.key)]


def _idle_defaults(document: Document) -> list[Problem]:
    if document.find(("defaults",)) is None or _names(document):
        return []
    text = "`defaults` apply to groups of the same file, and this file has none"
    return [document.problem(("defaults",), text, code="conflict", span=document.key_span(("defaults",)))]
