"""Several files as one: the groups of all, and what there can be only one of from the file that has it."""

from collections.abc import Sequence
from typing import Any

from syncrelay.config.document import Document, Entry, MappingNode
from syncrelay.config.file import FileKeys
from syncrelay.config.problems import Path, Problem
from syncrelay.config.wording import printable, quoted

_ONE_FOR_ALL = ("node", "metrics", "diagnostics")


def merged_documents(documents: Sequence[Document]) -> tuple[Document, list[Problem]]:
    """Return the tree of all files, of several without their `defaults`, and what two have that only one may."""
    if len(documents) == 1:
        return documents[0], []
    first = documents[0]
    groups = MappingNode(first.root.span)
    merged = Document(
        {index: source for document in documents for index, source in document.sources.items()},
        MappingNode(first.root.span, {"groups": Entry(first.root.span, groups)}),
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
    """Return the keys of all files in one. What only one may have is in one only."""
    merged: dict[str, Any] = {"groups": {name: group for file in files for name, group in file.groups.items()}}
    for key in _ONE_FOR_ALL:
        owner = next((file for file in files if key in file.model_fields_set), files[0])
        merged[key] = getattr(owner, key)
    return files[0].model_copy(update=merged)


def _names(document: Document) -> tuple[str, ...]:
    groups = document.find(("groups",))
    return tuple(groups.entries) if isinstance(groups, MappingNode) else ()


def _take(path: Path, document: Document, merged: Document) -> list[Problem]:
    """Put what stands at a path into the merged tree, or tell where that has it already."""
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
        f"the group {quoted(str(key))} is in {place} too: give one of them another name"
        if parents
        else f"`{key}` is in {place} too: files that run together have it once"
    )
    return [document.problem(path, text, code="duplicate_key", span=entry.key)]


def _idle_defaults(document: Document) -> list[Problem]:
    if document.find(("defaults",)) is None or _names(document):
        return []
    text = "`defaults` are for the groups of their own file, and this one has none"
    return [document.problem(("defaults",), text, code="conflict", span=document.key_span(("defaults",)))]
