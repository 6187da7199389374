"""What the graph shows around the inputs of groups: who publishes them, who takes their outputs, what was meant."""

import time
from collections.abc import Hashable, Iterable
from typing import Any, NamedTuple

from syncrelay.config.wording import counted
from syncrelay.dataflow.observers import Losses
from syncrelay.explain import Endpoint, GraphSnapshot, InputGraph, Refusal
from syncrelay.ros import graph
from syncrelay.ros.entities import Purpose
from syncrelay.ros.inputs import InputBinding


class _Around(NamedTuple):
    """What the graph shows around an input; polled only when the graph has changed."""

    output: str
    subscribers: tuple[Endpoint, ...]
    rivals: tuple[Endpoint, ...]
    alike: tuple[str, ...]


class Surroundings:
    """Keeps what the graph shows around each input until the graph changes. On the main thread."""

    def __init__(self, node: Any, purpose: Purpose, *, relay_name: str) -> None:
        """Poll the graph through a node; `relay_name` is the relay's full name, another one if this node observes."""
        self._node = node
        self._relay_name = relay_name
        self._publishes = purpose is Purpose.RELAY
        self._bindings: frozenset[InputBinding] = frozenset()
        self._around: dict[InputBinding, _Around] = {}
        self._rivals_since: dict[InputBinding, int] = {}
        self._relayed: dict[str, bool] = {}

    def watch(self, bindings: Iterable[InputBinding]) -> None:
        """Forget all but these."""
        self._bindings = frozenset(bindings)
        self.forget()
        self._rivals_since = {each: since for each, since in self._rivals_since.items() if each in self._bindings}

    def forget(self) -> None:
        """Poll the graph again for each, as it has changed."""
        self._around.clear()
        self._relayed.clear()

    def empty_graph(self) -> GraphSnapshot | None:
        """Return the graph if no other node is in it. It is asked only while a topic has no publisher."""
        is_missing = any(not binding.topic.publishers for binding in self._bindings)
        return graph.snapshot(self._node) if is_missing and not graph.other_nodes(self._node) else None

    def nodes_and_topics(self) -> Hashable:
        """Return the nodes and topics that have been found."""
        return graph.other_nodes(self._node), frozenset(graph.topics_in(self._node))

    def of(self, binding: InputBinding, losses: Losses) -> InputGraph:
        """Return what there is around an input, of whose messages DDS lost some."""
        around = self._around.get(binding)
        if around is None:
            around = self._around[binding] = self._poll(binding)
        topic = binding.topic
        return InputGraph(
            name=topic.name,
            output=around.output,
            publishers=topic.publishers,
            subscribers=around.subscribers,
            rivals=around.rivals,
            rivals_since=self._rivals_since.get(binding, 0),
            alike=around.alike,
            not_importable=topic.not_importable,
            not_readable=binding.output.not_readable,
            refusal=binding.refusal or _unpublished(binding, around.output),
            lost=losses.recent,
            lost_in_all=losses.total,
            largest=topic.outputs.largest,
            type_from=topic.type_from,
        )

    def _poll(self, binding: InputBinding) -> _Around:
        node, topic = self._node, binding.topic
        output = node.resolve_topic_name(binding.output.topic)
        publishers = node.get_publishers_info_by_topic(output)
        # A node that only observes does not count the relay itself as a rival.
        own = int(binding.output.publisher is not None) if self._publishes else len(publishers)
        rivals = graph.others(publishers, than=self._relay_name, own=own)
        if rivals:
            self._rivals_since.setdefault(binding, time.time_ns())
        else:
            self._rivals_since.pop(binding, None)
        return _Around(
            output=output,
            subscribers=graph.subscribers(node.get_subscriptions_info_by_topic(output), topic.profile)
            if topic.profile is not None
            else (),
            rivals=rivals,
            alike=() if topic.publishers else self._alike(topic.name, topic.type),
        )

    def _alike(self, name: str, type_name: str | None) -> tuple[str, ...]:
        """Return topics that may have been meant; outputs of relays are none."""
        outputs = {self._node.resolve_topic_name(binding.output.topic) for binding in self._bindings}
        published = graph.published_topics(self._node).items()
        of_type = [each for each in published if type_name in (None, *each[1]) and each[0] not in outputs]
        return graph.topics_alike(name, type_name, [each for each in of_type if not self._is_relayed(each[0])])

    def _is_relayed(self, name: str) -> bool:
        if name not in self._relayed:
            publishers = self._node.get_publishers_info_by_topic(name)
            self._relayed[name] = any(graph.is_relayed(self._node, each, name) for each in publishers)
        return self._relayed[name]


def _unpublished(binding: InputBinding, output: str) -> Refusal | None:
    """What rcl did not publish last."""
    last = binding.output.group.unpublished.get(binding.output.index)
    if last is None:
        return None
    why = f"{last.why} ({counted(last.messages, 'message')} so far)"
    return Refusal("publish", output, str(binding.topic.type), why=why)
