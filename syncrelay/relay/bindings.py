"""Which groups run, and on which topics: how others take their place while messages flow."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config import TopicConfig
from syncrelay.config.names_in_graph import manifest_topic
from syncrelay.config.reload import Subscription
from syncrelay.config.wording import one_of
from syncrelay.dataflow.backend import RclBackend
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import ReloadError
from syncrelay.explain import Endpoint
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.inputs import InputBinding, TopicInput
from syncrelay.relay.outputs import BundleOutput
from syncrelay.relay.ports import Node, Publisher, Purpose
from syncrelay.runtime import Runtime
from syncrelay.sync import DropReason

# Within this time, a subscriber that is restarted or waits for publishers of another QoS is back.
_GRACE_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class GroupBinding:
    """A group and its inputs, each bound to the topic that feeds it; and its bundles, if it has any."""

    group: GroupRelay
    inputs: tuple[InputBinding, ...]
    bundle: BundleOutput

    @property
    def waiting_for(self) -> str:
        """What keeps the group from giving sets, in words; empty where nothing does."""
        if self.group.failure is not None:
            return "a reload or restart: a bug stopped it"
        missing_of = {each.output.index: what for each in self.inputs if (what := each.missing)}
        there = [index not in missing_of for index in range(len(self.inputs))]
        # Nearly always nothing is missing, and this is asked ten times a second.
        needed = self.group.config.enough(there) if missing_of else ()
        missing = ", ".join(what for index, what in missing_of.items() if index in needed)
        if self.group.sleeps and self.publishers and not missing:
            return f"a subscriber of {one_of(each.topic_name for each in self.publishers)}"
        if not missing and self.bundle.refusal is not None and not self.group.config.options.outputs:
            return f"its bundle, which cannot leave on {self.bundle.refusal.topic}"
        return missing

    def feed(self) -> None:
        """Feed its inputs, those that are to be fed now. On the loop's thread."""
        for each in self.inputs:
            each.topic.outputs.feed()

    @property
    def publishers(self) -> list[Publisher]:
        """Those whose subscribers keep a lazy group awake. On the main thread."""
        publishers = [*(each.output.publisher for each in self.inputs), self.bundle.publisher]
        return [each for each in publishers if each is not None]


class GroupBindings:
    """All groups that run, in the file's order; one input per topic, however many use it and whatever they call it."""

    def __init__(
        self, *, entities: Entities, node: Node, backend: RclBackend, loop: ReceiveLoop, runtime: Runtime
    ) -> None:
        self.all: tuple[GroupBinding, ...] = ()
        self.is_held = False
        """Whether nothing is received nor published."""
        self._entities = entities
        self._node = node
        self._backend = backend
        self._loop = loop
        self._runtime = runtime
        self._topics: dict[Subscription, TopicInput] = {}
        # By topic, the publishers whose types held groups had taken: their successors keep these types.
        self._taken: dict[str, Endpoint] = {}
        # Since when lazy groups have had no subscriber.
        self._unheard_since: dict[GroupRelay, float] = {}

    @property
    def groups(self) -> list[GroupRelay]:
        """The groups alone."""
        return [binding.group for binding in self.all]

    @property
    def topics(self) -> list[TopicInput]:
        """Each topic once."""
        return list(self._topics.values())

    def count_listeners(self, more: Callable[[GroupRelay], Sequence[Publisher]]) -> None:
        """Wake the lazy groups that have a subscriber, and put to sleep those that have had none for a while.

        `more` returns a group's publishers beside its outputs', whose subscribers count too. A relay that only observes
        has no lazy groups. On the main thread.
        """
        if self._entities.purpose is not Purpose.RELAY:
            return
        now = self._runtime.monotonic()
        lazy = [binding for binding in self.all if binding.group.config.options.lazy]
        unheard = [each for each in lazy if not any(out.is_heard() for out in (*each.publishers, *more(each.group)))]
        self._unheard_since = {each.group: self._unheard_since.get(each.group, now) for each in unheard}
        for binding in lazy:
            group, since = binding.group, self._unheard_since.get(binding.group)
            if since is None and group.sleeps:
                self._switch_over(binding, group.wake)
            elif since is not None and not group.sleeps and now - since >= _GRACE_S:
                self._switch_over(binding, group.sleep)

    def _switch_over(self, binding: GroupBinding, switch: Callable[[], None]) -> None:
        """Feed all inputs of a group, or none, between two messages; then have their topics subscribed, or not."""

        def turn() -> None:
            switch()
            binding.feed()

        self._loop.call(turn).result()
        for each in binding.inputs:
            each.topic.try_again()

    def run(self, groups: Sequence[GroupRelay]) -> None:
        """Run these groups and no others; those that ran already are left as they are. On the main thread.

        New groups begin and others end between two messages. Where DDS gives the new ones their topics only after the
        old ones are gone, the old ones end first. Raises TypeImportError for a field that a type does not have, and
        ReloadError where DDS does not make a publisher, with all as it was.
        """
        running = {binding.group: binding for binding in self.all}
        topics = dict(self._topics)
        bindings = tuple(running.get(group) or self._binding(group, topics) for group in groups)
        begun = [each for binding in bindings if binding.group not in running for each in binding.inputs]
        ended = [binding for group, binding in running.items() if group not in groups]
        used = {each.topic for binding in bindings for each in binding.inputs}
        unused = [topic for topic in self.topics if topic not in used]
        if running:
            self._exchange(ended, unused, begun)
        else:
            _switch(ended, begun)
        # From here on these run, even if ending the others fails.
        self._topics = {key: topic for key, topic in topics.items() if topic in used}
        self.all = bindings
        self._taken = {}
        for topic in used:
            topic.try_again()
        self._end_publishers(_inputs_of(ended))
        for topic in unused:
            topic.close()

    def hold(self) -> None:
        """Receive nothing until `release`. Call `end_publishers` when all that is buffered has left."""
        self.is_held = True
        for topic in self.topics:
            topic.hold()

    def end_publishers(self) -> None:
        """End the publishers of all groups, which nothing feeds any more."""
        self._end_publishers(_inputs_of(self.all))

    def release(self) -> None:
        """End the groups that were held; those that are run from now on receive and publish."""
        taken = _taken(self.topics)
        self.run(())
        self.is_held, self._taken = False, taken

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Give reliable subscribers until `deadline`, by time.monotonic_ns(), to get what was published last."""
        for topic in self.topics:
            topic.outputs.wait_until_acknowledged(deadline)

    def _exchange(
        self, ended: Sequence[GroupBinding], unused: Sequence[TopicInput], begun: Sequence[InputBinding]
    ) -> None:
        """Make the publishers of those who begin, and exchange the groups."""
        ending: set[object] = {each.output.publisher for each in _inputs_of(ended)}
        ending |= {topic.entity for topic in unused}
        try:
            late = [each for each in begun if not self._has_publisher(each, ending)]
            if late:
                self._free_topics(ended, unused, late)
            self._loop.call(lambda: _switch(ended, begun)).result()
        except BaseException as error:
            self._end_publishers(begun)
            if isinstance(error, RefusedError):
                raise ReloadError(str(error)) from error
            raise

    def _has_publisher(self, binding: InputBinding, ending: set[object]) -> bool:
        """Make a publisher; return False if it can only be made once these have ended. Raises RefusedError."""
        try:
            binding.topic.make_publisher(binding.output)
        except RefusedError as error:
            # What DDS refuses for another reason than a type that is held, it would refuse to those that run too.
            if error.refusal.held_as is None or not self._entities.frees(binding.output.topic, ending):
                raise
            return False
        return True

    def _free_topics(
        self, ended: Sequence[GroupBinding], unused: Sequence[TopicInput], late: Sequence[InputBinding]
    ) -> None:
        """End what holds the topics of `late`, then make its publishers; if that fails, make the old ones again."""
        ending = _inputs_of(ended)
        wanted = {self._node.resolve_topic(each.output.topic) for each in late}
        self._loop.call(lambda: _suspend(ended)).result()
        try:
            publishers = [(each, each.output.publisher) for each in ending if each.output.publisher]
            self._end_publishers([each for each, publisher in publishers if publisher.topic_name in wanted])
            for topic in unused:
                if topic.name in wanted:
                    topic.close()
            for each in late:
                each.topic.make_publisher(each.output)
        except BaseException:
            self._end_publishers(late)
            for each in ending:
                each.topic.make_publisher_or_report(each.output)
            self._loop.call(lambda: _resume(ended)).result()
            raise

    def _end_publishers(self, bindings: Sequence[InputBinding]) -> None:
        for each in bindings:
            if (publisher := each.output.publisher) is not None:
                each.output.publisher = None
                self._entities.end(publisher)

    def _binding(self, group: GroupRelay, topics: dict[Subscription, TopicInput]) -> GroupBinding:
        inputs = enumerate(self._topic(config, topics) for config in group.config.topics)
        if group.config.options.lazy and self._entities.purpose is Purpose.RELAY and not self._may_be_heard(group):
            group.sleep()
        bundle = BundleOutput()
        return GroupBinding(group, tuple(topic.bind(group, index, bundle) for index, topic in inputs), bundle)

    def _may_be_heard(self, group: GroupRelay) -> bool:
        """Whether its topics have subscribers, of any QoS, as where a reload puts it in the place of another group."""
        names = [*group.config.outputs]
        if group.config.options.manifest:
            names.append(manifest_topic(group.config.name))
        return any(self._node.graph.subscribers_of(self._node.resolve_topic(name)) for name in names)

    def _topic(self, config: TopicConfig, topics: dict[Subscription, TopicInput]) -> TopicInput:
        name = self._node.resolve_topic(config.topic)
        key = Subscription.of(config, topic=name)
        if key not in topics:
            topics[key] = TopicInput(
                config,
                name=name,
                entities=self._entities,
                graph=self._node.graph,
                backend=self._backend,
                loop=self._loop,
                runtime=self._runtime,
            )
            if self.is_held:
                topics[key].hold()
            # The type that was taken stays, even if the file now says another QoS.
            publisher = (self._taken | _taken(self.topics)).get(name)
            if publisher is not None:
                topics[key].keep_type(publisher)
        return topics[key]


def _taken(topics: Sequence[TopicInput]) -> dict[str, Endpoint]:
    return {each.name: each.type_from for each in topics if each.type_from is not None}


def _inputs_of(bindings: Sequence[GroupBinding]) -> list[InputBinding]:
    return [each for binding in bindings for each in binding.inputs]


# These run on the loop's thread, or before that runs.


def _switch(ended: Sequence[GroupBinding], begun: Sequence[InputBinding]) -> None:
    """End some groups and begin others."""
    for each in _inputs_of(ended):
        each.topic.outputs.detach(each.output.group)
    for binding in ended:
        binding.group.flush(DropReason.SHUTDOWN)
    for each in begun:
        each.topic.outputs.attach(each.output)


def _suspend(ended: Sequence[GroupBinding]) -> None:
    """Hold new messages: the publishers of these groups end before they do."""
    for binding in ended:
        binding.group.suspend()


def _resume(ended: Sequence[GroupBinding]) -> None:
    """Have groups that were to end go on, with the publishers that they have now."""
    for each in _inputs_of(ended):
        each.topic.outputs.connect([each.output])
    for binding in ended:
        binding.group.resume()
