"""Groups and the topics that feed them: which run, and how others take their place while messages flow."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from syncrelay.config import TopicConfig
from syncrelay.dataflow.backend import RclBackend
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import ReloadError
from syncrelay.ros.entities import Entities, RefusedError
from syncrelay.ros.inputs import TopicInput, User
from syncrelay.sync import DropReason

_Key: TypeAlias = tuple[str, str, str]
_Use: TypeAlias = tuple[TopicInput, User]


@dataclass(frozen=True, slots=True)
class Wiring:
    """A group and the topics that feed it, in the order of its inputs."""

    group: GroupRelay
    inputs: tuple[TopicInput, ...]

    @property
    def waiting_for(self) -> str | None:
        """What keeps the group from giving sets, in words."""
        if self.group.failure is not None:
            return "a reload or restart: a bug stopped it"
        rows = enumerate(zip(self.group.config.topics, self.inputs, strict=True))
        return ", ".join(filter(None, (self._missing(n, each) for n, (topic, each) in rows if topic.required))) or None

    def _missing(self, index: int, topic_input: TopicInput) -> str | None:
        refusal = topic_input.refusal(self.group, index)
        return topic_input.missing or (f"DDS to let it {refusal.verb} {refusal.topic}" if refusal else None)

    @property
    def uses(self) -> list[_Use]:
        """Its inputs as their topics have them."""
        return [(each, user) for each in dict.fromkeys(self.inputs) for user in each.users if user.group is self.group]


class Wirings:
    """All groups that run, in the file's order; one input per topic, however many use it and whatever they call it."""

    def __init__(self, *, entities: Entities, node: Any, backend: RclBackend, loop: ReceiveLoop) -> None:
        self.all: tuple[Wiring, ...] = ()
        self._entities = entities
        self._node = node
        self._backend = backend
        self._loop = loop
        self._inputs: dict[_Key, TopicInput] = {}

    @property
    def groups(self) -> list[GroupRelay]:
        """The groups alone."""
        return [wiring.group for wiring in self.all]

    @property
    def inputs(self) -> list[TopicInput]:
        """Each topic once."""
        return list(self._inputs.values())

    def wire(self, groups: Sequence[GroupRelay]) -> None:
        """Let these groups run, and no other; those that did go on as they are. On the main thread.

        What is new begins, and what is gone ends, between two messages; but where DDS lets the new have its topics
        only when the old are gone, those end first. Raises TypeImportError for a field that a type does not have, and
        ReloadError where DDS does not make a publisher, with all as it was.
        """
        running = {wiring.group: wiring for wiring in self.all}
        inputs = dict(self._inputs)
        wirings = tuple(running.get(group) or self._wiring(group, inputs) for group in groups)
        begun = [
            (topic_input, topic_input.user(wiring.group, index))
            for wiring in wirings
            if wiring.group not in running
            for index, topic_input in enumerate(wiring.inputs)
        ]
        ended = [wiring for group, wiring in running.items() if group not in groups]
        used = {each for wiring in wirings for each in wiring.inputs}
        unused = [each for each in self.inputs if each not in used]
        gone = self._exchange(ended, unused, begun) if running else _switch(ended, begun)
        # From here on these run, whatever becomes of the end of the others.
        self._inputs = {key: topic_input for key, topic_input in inputs.items() if topic_input in used}
        self.all = wirings
        for topic_input in used:
            topic_input.try_again()
        for _, user in gone:
            if user.publisher is not None:
                self._entities.end(user.publisher)
        for topic_input in unused:
            topic_input.close()

    def _exchange(self, ended: Sequence[Wiring], unused: Sequence[TopicInput], begun: Sequence[_Use]) -> list[_Use]:
        """Make the publishers of those who begin, and let them; the uses that are gone."""
        over = [use for wiring in ended for use in wiring.uses]
        ending = {user.publisher for _, user in over} | {each.entity for each in unused}
        try:
            late = [use for use in begun if not self._equip(use, ending)]
            if not late:
                return self._loop.call(lambda: _switch(ended, begun)).result()
            return self._exchange_late(ended, unused, begun, late)
        except BaseException as error:
            for _, user in begun:
                if user.publisher is not None:
                    self._entities.end(user.publisher)
            if isinstance(error, RefusedError):
                raise ReloadError(str(error)) from error
            raise

    def _equip(self, use: _Use, ending: set[Any]) -> bool:
        """Make a publisher; whether there is one, else it is to be when these end. Raises RefusedError."""
        topic_input, user = use
        try:
            topic_input.equip(user)
        except RefusedError:
            if not self._entities.frees(user.output, ending):
                raise
            return False
        return True

    def _exchange_late(
        self, ended: Sequence[Wiring], unused: Sequence[TopicInput], begun: Sequence[_Use], late: Sequence[_Use]
    ) -> list[_Use]:
        """End what holds the topics of those who are late, then make their publishers, or else the old ones again."""
        over = [use for wiring in ended for use in wiring.uses]
        wanted = {self._node.resolve_topic_name(user.output) for _, user in late}
        self._loop.call(lambda: _suspend(ended)).result()
        try:
            for _, user in over:
                if user.publisher is not None and user.publisher.topic_name in wanted:
                    publisher, user.publisher = user.publisher, None
                    self._entities.end(publisher)
            for topic_input in unused:
                if topic_input.name in wanted:
                    topic_input.close()
            for topic_input, user in late:
                topic_input.equip(user)
        except BaseException:
            self._restore(ended, over, late)
            raise
        return self._loop.call(lambda: _switch(ended, begun)).result()

    def _restore(self, ended: Sequence[Wiring], over: Sequence[_Use], late: Sequence[_Use]) -> None:
        for _, user in late:
            if user.publisher is not None:
                publisher, user.publisher = user.publisher, None
                self._entities.end(publisher)
        for topic_input, user in over:
            topic_input.equip_or_tell(user)
        self._loop.call(lambda: _resume(ended, over)).result()

    def _wiring(self, group: GroupRelay, inputs: dict[_Key, TopicInput]) -> Wiring:
        return Wiring(group, tuple(self._input(topic, inputs) for topic in group.config.topics))

    def _input(self, topic: TopicConfig, inputs: dict[_Key, TopicInput]) -> TopicInput:
        name = self._node.resolve_topic_name(topic.topic)
        key = (name, topic.type, repr(topic.qos))
        if key not in inputs:
            inputs[key] = TopicInput(
                topic, name=name, entities=self._entities, node=self._node, backend=self._backend, loop=self._loop
            )
        return inputs[key]


# These run on the loop's thread, or before that runs.


def _switch(ended: Sequence[Wiring], begun: Sequence[_Use]) -> list[_Use]:
    """End some groups and begin others; the uses that are gone."""
    gone = _detach(ended)
    for wiring in ended:
        wiring.group.flush(DropReason.SHUTDOWN)
    _attach(begun)
    return gone


def _detach(ended: Sequence[Wiring]) -> list[_Use]:
    gone = [use for wiring in ended for use in wiring.uses]
    for wiring in ended:
        for topic_input in wiring.inputs:
            topic_input.detach(wiring.group)
    return gone


def _suspend(ended: Sequence[Wiring]) -> None:
    """Let nothing more leave by publishers that end before their groups do; what comes is held."""
    for wiring in ended:
        wiring.group.suspend()


def _resume(ended: Sequence[Wiring], over: Sequence[_Use]) -> None:
    """Have groups that were to end go on, by what publishers they have now."""
    for topic_input, user in over:
        topic_input.connect([user])
    for wiring in ended:
        wiring.group.resume()


def _attach(uses: Sequence[_Use]) -> None:
    for topic_input, user in uses:
        topic_input.attach(user)
