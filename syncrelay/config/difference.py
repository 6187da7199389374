"""The difference between two files, key by key with values as written, and what a reload would do: text and JSON."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from syncrelay.config.document import EXTENSION, MappingNode
from syncrelay.config.keys import Keys
from syncrelay.config.load import Config
from syncrelay.config.problems import Path
from syncrelay.config.reload import Exchange, exchange, needs_restart
from syncrelay.config.resolved import GroupConfig
from syncrelay.config.wording import all_of, counted

_FROM_ELSEWHERE: Final = ("output", "type")
"""Keys of a topic that output_prefix or another group may say for it."""


@dataclass(frozen=True, slots=True)
class KeyChange:
    """A key with its values as they are written, None where it is not. `topic` is the input whose key it is."""

    key: str
    old: str | None
    new: str | None
    topic: str | None = None

    def __str__(self) -> str:
        old, new = ("not set" if written is None else written for written in (self.old, self.new))
        return f"{f'{self.topic} ' if self.topic else ''}{self.key}: {old} -> {new}"


@dataclass(frozen=True, slots=True)
class GroupChange:
    """What changes in a group: keys, and inputs by their names."""

    name: str
    keys: tuple[KeyChange, ...]
    removed: tuple[str, ...]
    added: tuple[str, ...]
    reordered: bool


@dataclass(frozen=True, slots=True)
class Difference:
    """What a reload from one file to another does; `restart` are changed keys that it refuses."""

    exchange: Exchange
    restart: tuple[str, ...]
    sections: tuple[KeyChange, ...]
    groups: tuple[GroupChange, ...]

    @property
    def is_empty(self) -> bool:
        """Whether a reload changes nothing."""
        gone = self.exchange
        return not (gone.rebuilt or gone.started or gone.ended or self.restart or self.sections)


def difference(old: Config, new: Config) -> Difference:
    """Return what a reload does with a relay that runs `old` when it reads `new`."""
    changed = exchange(old.groups, new.groups)
    before = {group.name: group for group in old.groups}
    pairs = [(before[group.name], group) for group in new.groups if group.name in changed.rebuilt]
    return Difference(
        exchange=changed,
        restart=needs_restart(old, new),
        sections=tuple(section_changes(old, new)),
        groups=tuple(_Pair(old, new, *pair).change() for pair in pairs),
    )


def section_changes(old: Config, new: Config) -> Iterator[KeyChange]:
    """Yield what changes outside the groups."""
    if old.node != new.node:
        for key in type(old.node).model_fields:
            if getattr(old.node, key) != getattr(new.node, key):
                yield _change(old, new, ("node", key))
    if old.listen != new.listen:
        yield from _section("metrics", old, new)
    if old.diagnostics != new.diagnostics:
        yield from _section("diagnostics", old, new)


def _section(name: str, old: Config, new: Config) -> Iterator[KeyChange]:
    """Yield what differs in a section that may be null, or else written as a mapping."""
    nodes = [config.names.document.find((name,)) for config in (old, new)]
    if not all(node is None or isinstance(node, MappingNode) for node in nodes):
        yield _change(old, new, (name,))
        return
    for key in dict.fromkeys(key for node in nodes if isinstance(node, MappingNode) for key in node.entries):
        change = _change(old, new, (name, key))
        if change.old != change.new and not key.startswith(EXTENSION):
            yield change


def _change(old: Config, new: Config, path: Path) -> KeyChange:
    return KeyChange(".".join(map(str, path)), old.written(path), new.written(path))


@dataclass(frozen=True, slots=True)
class _Pair:
    """A group as two files have it."""

    old: Config
    new: Config
    before: GroupConfig
    now: GroupConfig

    def change(self) -> GroupChange:
        names_before, names = self.before.inputs.names, self.now.inputs.names
        both = [name for name in names if name in names_before]
        return GroupChange(
            name=self.now.name,
            keys=(
                *self._keys(self.before.options, self.now.options, self.now.path, self.now.path),
                *(key for name in both for key in self._topic(name)),
            ),
            removed=tuple(name for name in names_before if name not in names),
            added=tuple(name for name in names if name not in names_before),
            reordered=both != [name for name in names_before if name in names],
        )

    def _topic(self, name: str) -> Iterator[KeyChange]:
        at_before, at = self.before.inputs.names.index(name), self.now.inputs.names.index(name)
        old_path, path = ((*self.now.path, "topics", index) for index in (at_before, at))
        for change in self._keys(self.before.options.topics[at_before], self.now.options.topics[at], old_path, path):
            if change.key not in _FROM_ELSEWHERE:
                yield replace(change, topic=name)
        for key in _FROM_ELSEWHERE:
            was, is_now = getattr(self.before.topics[at_before], key), getattr(self.now.topics[at], key)
            if was != is_now:
                old, new = self.old.written((*old_path, key)) or was, self.new.written((*path, key)) or is_now
                yield KeyChange(key, old, new, topic=name)

    def _keys(self, before: Keys, now: Keys, old_path: Path, path: Path) -> Iterator[KeyChange]:
        for key in dict.fromkeys([*type(before).model_fields, *type(now).model_fields]):
            if key not in ("topic", "topics") and getattr(before, key, None) != getattr(now, key, None):
                old, new = self.old.written((*old_path, key)), self.new.written((*path, key))
                # Another policy has other defaults, which nobody has written.
                if old != new:
                    yield KeyChange(key, old, new)


def difference_lines(found: Difference) -> Iterator[str]:
    """Yield what a reload does, in lines."""
    yield _summary(found)
    yield from (f"  {section}" for section in found.sections)
    gone = found.exchange
    if not found.is_empty and not found.restart:
        yield from (f"  {name}: keeps running, loses nothing" for name in gone.kept)
    rebuilt = "changed" if found.restart else "rebuilt; what waits in its queues is dropped"
    for change in found.groups:
        # A restart rebuilds all groups; only those with changed keys get lines.
        if lines := list(_group_lines(change)):
            yield f"~ {change.name}: {rebuilt}"
            yield from (f"    {line}" for line in lines)
    yield from (f"+ {name}: started" for name in gone.started)
    yield from (f"- {name}: ended" for name in gone.ended)


def _summary(found: Difference) -> str:
    gone = found.exchange
    if found.is_empty:
        return f"a reload changes nothing: {counted(len(gone.kept), 'group')} unchanged"
    if found.restart:
        keys = all_of(f"`{key}`" for key in found.restart)
        return f"a reload would be refused: {keys} cannot change while the relay runs; after a restart:"
    done = {"keeps": gone.kept, "rebuilds": gone.rebuilt, "starts": gone.started, "ends": gone.ended}
    return "a reload " + all_of(f"{verb} {counted(len(names), 'group')}" for verb, names in done.items() if names)


def _group_lines(change: GroupChange) -> Iterator[str]:
    yield from map(str, change.keys)
    yield from (f"{topic}: no longer an input" for topic in change.removed)
    yield from (f"{topic}: a new input" for topic in change.added)
    if change.reordered:
        yield "its inputs are in another order"


def difference_as_json(found: Difference) -> dict[str, Any]:
    """Return what json.dumps takes."""
    gone = found.exchange
    return {
        "reload": "none" if found.is_empty else "refused" if found.restart else "taken",
        "restart": list(found.restart),
        "sections": [_key_as_json(each) for each in found.sections],
        "groups": {
            "kept": list(gone.kept),
            "rebuilt": [_group_as_json(each) for each in found.groups],
            "started": list(gone.started),
            "ended": list(gone.ended),
        },
    }


def _key_as_json(change: KeyChange) -> dict[str, Any]:
    return {"key": change.key, "old": change.old, "new": change.new}


def _group_as_json(change: GroupChange) -> dict[str, Any]:
    return {
        "name": change.name,
        "keys": [{"topic": each.topic, **_key_as_json(each)} for each in change.keys],
        "inputs_removed": list(change.removed),
        "inputs_added": list(change.added),
        "inputs_reordered": change.reordered,
    }
