"""What the graph shows around the inputs of groups: who publishes them, who takes their outputs, what was meant."""

from collections.abc import Hashable, Iterable, Sequence
from typing import NamedTuple

from syncrelay.config.profile import Profile
from syncrelay.config.wording import counted
from syncrelay.dataflow.flow import Unpublished
from syncrelay.dataflow.observers import Losses, Senders
from syncrelay.explain import BundleGraph, Endpoint, GraphSnapshot, InputGraph, Refusal
from syncrelay.relay import graph
from syncrelay.relay.bindings import GroupBinding
from syncrelay.relay.inputs import InputBinding
from syncrelay.relay.outputs import BundleOutput
from syncrelay.relay.ports import EndpointInfo, Node, Publisher, Purpose
from syncrelay.relay.transforms import PROFILES
from syncrelay.runtime import Runtime


class _Around(NamedTuple):
    """What the graph shows around an output; polled only when the graph has changed."""

    name: str
    subscribers: tuple[Endpoint, ...]
    rivals: tuple[Endpoint, ...]
    rivals_since: int


class Surroundings:
    """Keeps what the graph shows around each input until the graph changes. On the main thread."""

    def __init__(self, node: Node, purpose: Purpose, *, runtime: Runtime) -> None:
        self._node = node
        self._graph = node.graph
        self._runtime = runtime
        self._publishes = purpose is Purpose.RELAY
        self._bindings: frozenset[InputBinding] = frozenset()
        self._around: dict[InputBinding | BundleOutput, _Around] = {}
        self._alike: dict[InputBinding, tuple[str, ...]] = {}
        self._rivals_since: dict[InputBinding | BundleOutput, int] = {}
        self._managed: dict[InputBinding, tuple[str, ...]] = {}
        self._managed_nodes: dict[str, bool] | None = None
        self._unheard: tuple[tuple[str, Endpoint], ...] | None = None
        self._relayed: dict[str, bool] = {}
        self._published: dict[str, tuple[tuple[str, ...], Sequence[EndpointInfo]]] | None = None

    def watch(self, bindings: Iterable[InputBinding]) -> None:
        """Forget all but these."""
        self._bindings = frozenset(bindings)
        self.forget()
        kept = {*self._bindings, *(each.output.bundle for each in self._bindings)}
        self._rivals_since = {each: since for each, since in self._rivals_since.items() if each in kept}

    def forget(self) -> None:
        """Poll the graph again for each, as it has changed."""
        self._around.clear()
        self._alike.clear()
        self._managed_nodes = self._unheard = None
        self._relayed.clear()
        self._published = None

    def empty_graph(self) -> GraphSnapshot | None:
        """Return the graph if no other node is in it. It is asked only while a topic has no publisher."""
        is_missing = any(not binding.topic.publishers for binding in self._bindings)
        return graph.snapshot(self._node) if is_missing and not graph.other_nodes(self._node) else None

    def nodes_and_topics(self) -> Hashable:
        """Return the nodes and topics that have been found."""
        return graph.other_nodes(self._node), frozenset(graph.topics_in(self._graph))

    def of(self, binding: InputBinding, losses: Losses, senders: Senders) -> InputGraph:
        """Return what there is around an input, of whose messages some may not have come."""
        topic, around = binding.topic, self._around.get(binding)
        if around is None:
            publisher, profile = binding.output.publisher, topic.profile
            if not binding.output.is_separate:
                publisher, profile = binding.output.bundle.publisher, binding.output.bundle.profile
            around = self._around[binding] = self._poll(binding, binding.output.topic, publisher, profile)
            self._alike[binding] = () if topic.publishers else self._topics_alike(topic.name, topic.type)
            self._managed[binding] = self._managed_by(topic.publishers)
        return InputGraph(
            name=topic.name,
            output=around.name,
            publishers=topic.publishers,
            subscribers=around.subscribers,
            rivals=around.rivals,
            rivals_since=around.rivals_since,
            alike=self._alike[binding],
            managed=self._managed[binding],
            not_importable=topic.not_importable,
            not_readable=binding.output.not_readable,
            refusal=binding.refusal or _unpublished(binding, around.name),
            lost=losses.recent,
            lost_in_all=losses.total,
            largest=topic.outputs.largest,
            type_from=topic.type_from,
            senders=senders.recent,
            profile=topic.profile,
        )

    def _poll(
        self, output: InputBinding | BundleOutput, topic: str, publisher: Publisher | None, profile: Profile | None
    ) -> _Around:
        """Ask the graph who takes and who publishes an output, which ours publishes with this QoS."""
        name = self._node.resolve_topic(topic)
        publishers = self._graph.publishers_of(name)
        # A node that only observes does not count the relay itself as a rival.
        own = int(publisher is not None) if self._publishes else len(publishers)
        rivals = graph.others(publishers, than=self._node.relay_name, own=own)
        if not rivals:
            self._rivals_since.pop(output, None)
        subscribers = self._graph.subscribers_of(name)
        return _Around(
            name,
            graph.as_subscribers(subscribers, profile) if profile is not None else (),
            rivals,
            self._rivals_since.setdefault(output, self._runtime.time_ns()) if rivals else 0,
        )

    def _managed_by(self, publishers: Sequence[Endpoint]) -> tuple[str, ...]:
        """Return those of the publishers that are managed nodes; of none, those that publish nothing yet."""
        if self._managed_nodes is None:
            self._managed_nodes = graph.managed_nodes(self._node)
        if publishers:
            return tuple(each.node for each in publishers if each.node in self._managed_nodes)
        return tuple(name for name, is_quiet in self._managed_nodes.items() if is_quiet)

    def _topics_alike(self, name: str, type_name: str | None) -> tuple[str, ...]:
        """Return topics that may have been meant; outputs of relays are none."""
        published = self._published
        if published is None:
            outputs = {self._node.resolve_topic(binding.output.topic) for binding in self._bindings}
            published = self._published = {
                topic: (tuple({each.type for each in publishers}), publishers)
                for topic, publishers in graph.published_topics(self._graph).items()
                if topic not in outputs
            }
        not_relayed = [
            (topic, types)
            for topic, (types, publishers) in published.items()
            if type_name in (None, *types) and not self._is_relayed(topic, publishers)
        ]
        return graph.topics_alike(name, type_name, not_relayed)

    def _is_relayed(self, name: str, publishers: Sequence[EndpointInfo]) -> bool:
        if name not in self._relayed:
            self._relayed[name] = any(graph.is_relayed(self._graph, each, name) for each in publishers)
        return self._relayed[name]

    def unheard(self) -> Sequence[tuple[str, Endpoint]]:
        """Return the publishers of transforms that do not offer what tf2 requests, with their topics."""
        if self._unheard is None:
            self._unheard = tuple(
                (topic, each)
                for topic, profile in PROFILES.items()
                for each in graph.as_publishers(self._graph.publishers_of(self._node.resolve_topic(topic)), profile)
                if each.mismatch is not None
            )
        return self._unheard

    def bundle_of(self, binding: GroupBinding) -> BundleGraph | None:
        """Return what there is around the topic of the bundles of a group, if it has them."""
        config, shown = binding.group.config.bundle, binding.bundle
        if config is None:
            return None
        around = self._around.get(shown)
        if around is None:
            around = self._around[shown] = self._poll(shown, config.topic, shown.publisher, shown.profile)
        refusal, last = shown.refusal, binding.group.unpublished.get(binding.group.bundle_index)
        if refusal is None and last is not None:
            refusal = _refused(last, around.name, config.type)
        return BundleGraph(
            around.name,
            is_alone=not binding.group.config.options.outputs,
            refusal=refusal,
            subscribers=around.subscribers,
            rivals=around.rivals,
            rivals_since=around.rivals_since,
        )


def _unpublished(binding: InputBinding, output: str) -> Refusal | None:
    """Return why the last message of an input was not published."""
    last = binding.output.group.unpublished.get(binding.output.index)
    return last and _refused(last, output, str(binding.topic.type))


def _refused(last: Unpublished, output: str, type_name: str) -> Refusal:
    why = f"{last.why} ({counted(last.messages, 'message')} so far)"
    return Refusal("publish", output, type_name, why=why, is_unfit=last.is_unfit)
