"""The difference between two files, key by key with values as written, and what a reload would do."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from syncrelay.config.document import EXTENSION, MappingNode
from syncrelay.config.keys import Keys
from syncrelay.config.load import Config
from syncrelay.config.names_in_graph import MANIFEST_TYPE, manifest_topic
from syncrelay.config.problems import Path
from syncrelay.config.reload import Exchange, Subscription, exchange, needs_restart
from syncrelay.config.resolved import GroupConfig

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
class Endpoints:
    """Topics with their types, and QoS of subscriptions, that a reload removes, creates and recreates."""

    lost: tuple[tuple[str, ...], ...]
    made: tuple[tuple[str, ...], ...]
    made_again: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Difference:
    """What a reload from one file to another does; `restart` are changed keys that it refuses."""

    exchange: Exchange
    restart: tuple[str, ...]
    sections: tuple[KeyChange, ...]
    groups: tuple[GroupChange, ...]
    subscriptions: Endpoints
    publishers: Endpoints

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
        subscriptions=_subscriptions(old, new),
        publishers=_publishers(old, new, kept=changed.kept),
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
            keys=(*self._options(), *(key for name in both for key in self._topic(name))),
            removed=tuple(name for name in names_before if name not in names),
            added=tuple(name for name in names if name not in names_before),
            reordered=both != [name for name in names_before if name in names],
        )

    def _options(self) -> Iterator[KeyChange]:
        path = self.now.path
        yield from self._keys(self.before.options, self.now.options, path, path)

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


def _subscriptions(old: Config, new: Config) -> Endpoints:
    def of(config: Config) -> dict[Subscription, tuple[str, ...]]:
        return {
            Subscription.of(topic, topic=name): (name, topic.type or "", _qos(config, (*path, "qos")))
            for group in config.groups
            for name, (path, topic) in zip(group.inputs.names, group.paths(), strict=True)
        }

    before, now = of(old), of(new)
    return Endpoints(
        lost=tuple(told for key, told in before.items() if key not in now),
        made=tuple(told for key, told in now.items() if key not in before),
    )


def _qos(config: Config, path: Path) -> str:
    return config.written(path) or "auto"


def _publishers(old: Config, new: Config, *, kept: tuple[str, ...]) -> Endpoints:
    before, now = ({each[0]: each for group in config.groups for each in _of(group, config)} for config in (old, new))
    anew = {each[0]: each for group in new.groups if group.name not in kept for each in _outputs(group, new)}
    return Endpoints(
        lost=tuple(each for topic, each in before.items() if topic not in now),
        made=tuple(each for topic, each in now.items() if topic not in before),
        made_again=tuple(each for topic, each in anew.items() if topic in before),
    )


def _of(group: GroupConfig, config: Config) -> Iterator[tuple[str, str]]:
    yield from _outputs(group, config)
    if group.options.manifest:
        # A group that replaces another of its name keeps the manifest's publisher.
        yield config.node.absolute(manifest_topic(group.name)), MANIFEST_TYPE


def _outputs(group: GroupConfig, config: Config) -> Iterator[tuple[str, str]]:
    for topic in group.topics:
        yield config.node.absolute(topic.output), topic.type or ""
