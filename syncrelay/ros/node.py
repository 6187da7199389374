"""A node of rclpy, as the relay's ports want it."""

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.serialization import serialize_message
from rclpy.task import Future as RosFuture
from rosgraph_msgs.msg import Clock

from syncrelay.config.profile import Profile
from syncrelay.relay.ports import Call, Outcome, RclError
from syncrelay.relay.types import name_of
from syncrelay.ros.entities import RosPublisher, RosSubscription, never_called
from syncrelay.ros.graph import RosGraph
from syncrelay.ros.leaving import leave
from syncrelay.ros.parameters import Parameters
from syncrelay.ros.qos import to_rclpy
from syncrelay.ros.services import Answering
from syncrelay.ros.start import RosoutHandler

_LOG = logging.getLogger("syncrelay")

# The publisher that rcl makes for every node's log is not among those that rclpy knows of.
_ROSOUT: Final = ("/rosout", "rcl_interfaces/msg/Log")
# A clock may fall back by this much without a jump: two publishers of /clock, or one that rounds.
_JUMP: Final = Duration(nanoseconds=-1_000_000_000)
_FORWARD: Final = Duration(nanoseconds=1)
_WAKE_AGAIN_S: Final = 0.1


class _LeftToTheReceiveLoop(CallbackGroup):  # type: ignore[misc]  # CallbackGroup is untyped
    """Keeps the node's executor, which serves parameters and the clock, away from the data."""

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002  rclpy's signature
        return False

    def beginning_execution(self, entity: Any) -> bool:  # noqa: ARG002
        return False

    def ending_execution(self, entity: Any) -> None:
        """Nothing ever begins."""


class RosNode:
    """A node of rclpy that has joined the graph, with an executor of its own."""

    def __init__(self, raw: Any, *, relay_name: str, resolve: Callable[[str], str]) -> None:
        """Take a node; `resolve` gives a topic's name after all remaps."""
        self.raw = raw
        self.relay_name = relay_name
        self.name: str = raw.get_fully_qualified_name()
        self.graph = RosGraph(raw)
        self.log_handler: logging.Handler = RosoutHandler(raw.get_logger().name)
        self.is_simulated = bool(raw.get_parameter("use_sim_time").value)
        self._clock = raw.get_clock()
        self._resolve = resolve
        self._resolved: dict[str, str] = {}
        self._left_to_the_loop = _LeftToTheReceiveLoop()
        self._parameters: Parameters | None = None
        self._executor = SingleThreadedExecutor(context=raw.context)
        self._executor.add_node(raw)
        self._served = RosFuture()
        self._rests = threading.Event()
        self._rests.set()
        self._answering = Answering(raw)
        for subscription in raw.subscriptions:
            # rclpy's own, which is there from the start where time is simulated.
            if subscription.msg_type is Clock:
                subscription.callback = _since_1970(subscription.callback)

    @property
    def handle(self) -> Any:
        """Rcl's node, for the backends."""
        return self.raw.handle

    @property
    def context(self) -> Any:
        """Rclpy's context, for the backends."""
        return self.raw.context

    def ros_time_ns(self) -> int:
        return int(self._clock.now().nanoseconds)

    def follow_clock(self, changed: Callable[[int], None]) -> Callable[[], None]:
        def jumped(jump: Any) -> None:
            changed(jump.delta.nanoseconds if jump.delta <= _JUMP else max(0, jump.delta.nanoseconds))

        threshold = JumpThreshold(min_forward=_FORWARD, min_backward=_JUMP, on_clock_change=True)
        handle = self._clock.create_jump_callback(threshold, post_callback=jumped)
        return lambda: handle.unregister()  # noqa: PLW0108  rclpy's own return value is none of ours

    def resolve_topic(self, name: str) -> str:
        # Any thread may ask for a name, also after the node has ended.
        if name not in self._resolved:
            self._resolved[name] = self._resolve(name)
        return self._resolved[name]

    def resolve_service(self, name: str) -> str:
        return str(self.raw.resolve_service_name(name))

    def own(self) -> Sequence[tuple[str, Any, str]]:
        made = [
            (each.topic_name, each, name_of(each.msg_type)) for each in (*self.raw.publishers, *self.raw.subscriptions)
        ]
        return [(self.resolve_topic(_ROSOUT[0]), self.raw, _ROSOUT[1]), *made]

    def subscription(self, message_type: Any, topic: str, profile: Profile) -> RosSubscription:
        raw = None
        try:
            # With events, the executor's thread would keep a reference to it, so that it would not end in time.
            raw = self.raw.create_subscription(
                message_type,
                topic,
                never_called,
                to_rclpy(profile),
                raw=True,
                callback_group=self._left_to_the_loop,
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            )
            return RosSubscription(raw)
        except _rclpy.RCLError as error:
            if raw is not None:
                self.raw.destroy_subscription(raw)
            raise RclError(str(error)) from error

    def publisher(self, message_type: Any, topic: str, profile: Profile) -> RosPublisher:
        without_events = PublisherEventCallbacks(use_default_callbacks=False)
        try:
            made = self.raw.create_publisher(message_type, topic, to_rclpy(profile), event_callbacks=without_events)
        except _rclpy.RCLError as error:
            raise RclError(str(error)) from error
        return RosPublisher(made)

    def serialized(self, message: Any) -> bytes:
        content: bytes = serialize_message(message)
        return content

    def end(self, entity: Any) -> None:
        entity.release()
        if not self.raw.destroy_publisher(entity.raw):
            self.raw.destroy_subscription(entity.raw)

    def offer(self, name: str, call: Call) -> None:
        self._answering.offer(name, call)

    def flush_answers(self, patience_s: float) -> None:
        self._answering.flush(patience_s)

    def manage(self, carry_out: Callable[[str], Outcome]) -> None:
        self.raw.carry_out = carry_out

    def declare(self, paths: Sequence[str], version: str) -> None:
        self._parameters = Parameters(self.raw, paths=paths, version=version)

    def name_groups(self, names: Sequence[str]) -> None:
        if self._parameters is not None:
            self._parameters.name_groups(names)

    def serve(self) -> None:
        if self.raw.context.ok():
            self._rests.clear()
            try:
                with suppress(ExternalShutdownException):
                    self._executor.spin_until_future_complete(self._served)
            finally:
                self._rests.set()

    def end_serving(self) -> None:
        self._served.set_result(None)
        # The middleware takes a wake for none now and then, see rclpy_backend, and the executor would wait for ever.
        while not self._rests.wait(_WAKE_AGAIN_S):
            self._executor.wake()

    def leave(self) -> None:
        self._executor.shutdown()
        leave(self.raw, self.raw.context)


def _since_1970(take: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a callback for /clock that ignores negative times, for which rclpy raises."""
    was_said = False

    def take_valid(message: Any) -> None:
        nonlocal was_said
        if message.clock.sec >= 0:
            take(message)
        elif not was_said:
            was_said = True
            _LOG.warning(
                "/clock is at %d s, and no time in ROS is below 0: ignored until it is 0 or more",
                message.clock.sec,
            )

    return take_valid
