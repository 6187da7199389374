"""The publishers of bundles, one for each group that has one: made, followed and handed on as the inputs' are."""

import logging
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from syncrelay.cdr_walk import UnreadableFieldError
from syncrelay.config.profile import Profile, is_known, matched, sent
from syncrelay.config.resolved import BundleConfig
from syncrelay.dataflow.backend import Outlet, RclBackend
from syncrelay.dataflow.bugs import OnceLog
from syncrelay.dataflow.bundle import Bundle, BundleError
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import TypeImportError
from syncrelay.explain import Refusal
from syncrelay.relay.bindings import GroupBinding
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.graph import owner
from syncrelay.relay.inputs import TopicInput
from syncrelay.relay.ports import Node, Publisher, Purpose
from syncrelay.relay.types import fields_of, import_type
from syncrelay.runtime import Runtime

# As with what DDS refuses of inputs and outputs.
_TRY_AGAIN_S: Final = 5.0
_UNFIT: Final = (TypeImportError, BundleError, UnreadableFieldError)


@dataclass(frozen=True, slots=True)
class _Made:
    """A publisher of bundles, and what it was made for."""

    config: BundleConfig
    profile: Profile
    publisher: Publisher
    outlet: Outlet

    def fits(self, config: BundleConfig) -> bool:
        """Whether another group may go on with it."""
        return (self.config.topic, self.config.type, self.config.qos) == (config.topic, config.type, config.qos)


class Bundles:
    """Has the sets of groups published as one message each. On the main thread."""

    def __init__(
        self, *, entities: Entities, node: Node, backend: RclBackend, loop: ReceiveLoop, runtime: Runtime
    ) -> None:
        self._entities = entities
        self._node = node
        self._backend = backend
        self._loop = loop
        self._runtime = runtime
        self._made: dict[GroupRelay, _Made] = {}
        self._refusals: dict[GroupRelay, Refusal] = {}
        self._refused_at = 0.0
        self._once = OnceLog()

    def begin(self, groups: Iterable[GroupRelay]) -> None:
        """Have groups that do not run yet go on with the publishers of those whose place they take."""
        for group, config in self._bundled(groups):
            if group not in self._made:
                made = next((made for made in self._made.values() if made.fits(config)), None)
                if made is not None:
                    # What is wrong with it is said once it runs.
                    with suppress(*_UNFIT):
                        self._connect(group, made)

    def follow(self, bindings: Sequence[GroupBinding], *, has_changed: bool = True) -> None:
        """Publish what these groups give, as their inputs are received, and end the publishers of all others."""
        by_group = {binding.group: binding for binding in bindings}
        self._end_others(by_group)
        may_try = self._runtime.monotonic() - self._refused_at >= _TRY_AGAIN_S
        for group, config in self._bundled(by_group):
            inputs = by_group[group].inputs
            profile = self._profile([each.topic for each in inputs], group)
            made = self._made.get(group)
            is_due = made is None or made.profile != profile or has_changed
            if profile is not None and is_due and (group not in self._refusals or may_try):
                self._try(group, config, profile, [each.topic for each in inputs])
            self._show(by_group[group])

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for made in self._made.values():
            made.publisher.wait_until_acknowledged(max(0, deadline - self._runtime.monotonic_ns()))

    def _show(self, binding: GroupBinding) -> None:
        """Note what is made of a group's bundles, and feed it if it waited for that."""
        made, bundle = self._made.get(binding.group), binding.bundle
        before = bundle.publisher, bundle.refusal
        bundle.refusal = self._refusals.get(binding.group)
        bundle.publisher, bundle.profile = (None, None) if made is None else (made.publisher, made.profile)
        if before != (bundle.publisher, bundle.refusal):
            self._loop.call(binding.feed).result()

    def _bundled(self, groups: Iterable[GroupRelay]) -> Iterator[tuple[GroupRelay, BundleConfig]]:
        if self._entities.purpose is Purpose.RELAY:
            yield from ((group, group.config.bundle) for group in groups if group.config.bundle is not None)

    def _end_others(self, groups: Iterable[GroupRelay]) -> None:
        ended = [made for group, made in self._made.items() if group not in groups]
        self._made = {group: made for group, made in self._made.items() if group in groups}
        self._refusals = {group: refusal for group, refusal in self._refusals.items() if group in groups}
        kept = [made.publisher for made in self._made.values()]
        for publisher in dict.fromkeys(made.publisher for made in ended):
            if publisher not in kept:
                self._entities.end(publisher)

    def _profile(self, topics: Sequence[TopicInput], group: GroupRelay) -> Profile | None:
        """Return what the bundles leave with, None until each input that a set needs is received."""
        config = group.config
        assert config.bundle is not None  # noqa: S101  for mypy
        known = [topic.profile for topic in topics if topic.profile is not None]
        rows = zip(topics, config.topics, strict=True)
        if any(each.required and topic.profile is None for topic, each in rows) or not is_known(
            config.bundle.qos, known
        ):
            return None
        return sent(matched(config.bundle.qos, known))

    def _try(self, group: GroupRelay, config: BundleConfig, profile: Profile, topics: Sequence[TopicInput]) -> None:
        """Publish with this QoS from now on, or say why not."""
        before = self._made.get(group)
        try:
            self._require_definitions(config, topics)
            if before is None or before.profile != profile:
                self._make(group, config, profile)
                self._end(before)
        except _UNFIT as error:
            self._refuse(group, Refusal("publish", config.topic, config.type, why=str(error), is_unfit=True))
        except RefusedError as error:
            self._refuse(group, error.refusal)
        else:
            self._refusals.pop(group, None)

    def _make(self, group: GroupRelay, config: BundleConfig, profile: Profile) -> None:
        publisher = self._entities.publisher(import_type(config.type), config.topic, profile)
        try:
            self._connect(group, _Made(config, profile, publisher, self._backend.outlet(publisher)))
        except BaseException:
            self._entities.end(publisher)
            raise

    def _connect(self, group: GroupRelay, made: _Made) -> None:
        default = self._node.serialized(import_type(made.config.type)())
        bundle = Bundle(group.config, fields_of, default)
        self._loop.call(lambda: group.connect_bundle(bundle, made.outlet)).result()
        self._made[group] = made

    def _end(self, made: _Made | None) -> None:
        if made is not None and all(each.publisher is not made.publisher for each in self._made.values()):
            self._entities.end(made.publisher)

    def _refuse(self, group: GroupRelay, refusal: Refusal) -> None:
        """Publish no bundles of a group, and say why once."""
        self._refusals[group] = refusal
        self._refused_at = self._runtime.monotonic()
        self._once.log(logging.ERROR, refusal.text)
        self._loop.call(lambda: group.disconnect_bundle(refusal.reason.splitlines()[0])).result()
        self._end(self._made.pop(group, None))

    def _require_definitions(self, config: BundleConfig, topics: Sequence[TopicInput]) -> None:
        """Raise BundleError for an input whose publisher has another definition of its type than this process."""
        graph, own_name = self._node.graph, self._node.name
        for topic in topics:
            subscribers = graph.subscribers_of(topic.name)
            own = next((each.type_hash for each in subscribers if owner(each, "subscriber") == own_name), "")
            for publisher in graph.publishers_of(topic.name) if own else ():
                if publisher.type == topic.type and publisher.type_hash not in ("", own):
                    raise BundleError(
                        f"{owner(publisher, 'publisher')} publishes {topic.name} with another definition of"
                        f" {topic.type} than {config.type} has here: {publisher.type_hash}, here {own}"
                    )
