"""The simulated ROS, anew for each script."""

from collections.abc import Callable, Mapping
from typing import Any, Self

from syncrelay.config.profile import Profile
from syncrelay.relay.ports import Node, Purpose
from syncrelay.relay.types import import_type
from tests.simulated.bus import Bus, BusNode, Participant, Reader, Weather, Writer
from tests.simulated.node import SimulatedBackend, SimulatedGraph, SimulatedNode
from tests.simulated.scheduler import SECOND, Process, Scheduler, SimulatedRuntime

# Threads of the player.
_NOT_WAITED_FOR = frozenset({"relay", "listen", "observe"})


class _Reader:
    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self.end = reader.end

    @property
    def n_writers(self) -> int:
        return self._reader.n_writers

    def take(self) -> bytes | None:
        taken = self._reader.take()
        return None if taken is None else taken[0].content


class SimulatedWorld:
    """A bus; use it as a context manager."""

    def __init__(self, seed: int) -> None:
        self.scheduler = Scheduler(seed)
        self._bus = Bus(self.scheduler, Weather(missed=0.3))
        self._participants: dict[str, Participant] = {}
        self._nodes: dict[tuple[str, str], BusNode] = {}
        self.process = Process(self.scheduler, "relay")
        self.runtime = SimulatedRuntime(self.process)
        observer = self._bus.participant(Process(self.scheduler, "observer"))
        observer.node("observer")
        self.graph = SimulatedGraph(observer)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.scheduler.close()

    @property
    def left(self) -> list[str]:
        return [each for each in (*self.runtime.alive(), *sorted(self.runtime.held)) if each not in _NOT_WAITED_FOR]

    def writer(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> Writer:
        return self._node(by, node).writer(topic, type_name, profile)

    def reader(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> _Reader:
        return _Reader(self._node(by, node).reader(topic, type_name, profile))

    def _node(self, by: str, name: str) -> BusNode:
        if (by, name) not in self._nodes:
            if by not in self._participants:
                self._participants[by] = self._bus.participant(Process(self.scheduler, by))
            namespace, _, last = name.rpartition("/")
            self._nodes[by, name] = self._participants[by].node(last, namespace or "/")
        return self._nodes[by, name]

    def leave(self, by: str) -> None:
        self._gone(by).leave()

    def kill(self, by: str) -> None:
        self._gone(by).kill()

    def _gone(self, by: str) -> Participant:
        for key in [each for each in self._nodes if each[0] == by]:
            del self._nodes[key]
        return self._participants.pop(by)

    def join(self, config: Any, names: Mapping[str, str], purpose: Purpose = Purpose.RELAY) -> tuple[Any, Any]:
        self._relays = self._bus.participant(self.process)
        node = SimulatedNode(
            self._relays,
            self.runtime,
            # Names that begin so are hidden from lists.
            name="_observer" if purpose is Purpose.OBSERVE else names.get("__node", config.node.name),
            namespace=names.get("__ns", config.node.namespace),
            is_simulated=config.node.use_sim_time,
            remaps=names,
        )
        if purpose is Purpose.OBSERVE:
            node.relay_name = f"{config.node.namespace.rstrip('/')}/{config.node.name}"
        return node, SimulatedBackend(self.runtime)

    def hold(self, node: Any, topic: str, type_name: str) -> object:
        return node.publisher(import_type(type_name), topic, Profile(depth=1))

    def free(self, node: Any, held: object) -> None:
        node.end(held)

    def wait_until(self, condition: Callable[[], object], what: str) -> None:
        end, rest = self.scheduler.now + 60 * SECOND, 0.02
        while not condition():
            if self.scheduler.now > end:
                raise TimeoutError(f"waited in vain for {what}")
            self.scheduler.sleep(rest)
            rest = min(0.3, 1.5 * rest)

    def call(self, node: Node, service: str) -> tuple[bool, str]:
        answer = self._answer(lambda answered: node.request(service, answered))  # type: ignore[attr-defined]
        return answer.success, answer.message

    def transition(self, node: Node, name: str) -> tuple[bool, str]:
        success = self._answer(lambda answered: node.transition(name, answered))  # type: ignore[attr-defined]
        return success, node.state  # type: ignore[attr-defined]

    def _answer(self, ask: Callable[[Callable[[Any], object]], object]) -> Any:
        answers: list[Any] = []
        ask(answers.append)
        self.wait_until(lambda: answers, "an answer")
        return answers[0]
