"""/tf and /tf_static: what the relay knows of transforms, for the groups whose sets wait for them."""

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final

from syncrelay.config import GroupConfig
from syncrelay.config.profile import Profile
from syncrelay.config.typechecks import TF_INSTALL
from syncrelay.dataflow.backend import Payload, RclBackend, RclCallError, Source
from syncrelay.dataflow.bugs import OnceLog
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.errors import TypeImportError
from syncrelay.frames import TF_TYPE, Frames, read_transforms
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.ports import RclError, Subscription
from syncrelay.relay.types import import_type
from syncrelay.runtime import Runtime

# As tf2_ros::TransformListener subscribes: a consumer would get no others.
PROFILES: Final = {
    "/tf": Profile(depth=100),
    "/tf_static": Profile(depth=100, durability="transient_local"),
}
"""The topics of transforms, and what is requested of their publishers."""
# What DDS refuses is tried again this often.
_TRY_AGAIN_S: Final = 5.0


def require_type(groups: Iterable[GroupConfig]) -> Any:
    """Import the type of /tf if one of these groups needs it; raises TypeImportError saying what to install."""
    needing = next((group.name for group in groups if group.options.transforms is not None), None)
    if needing is None:
        return None
    try:
        return import_type(TF_TYPE)
    except TypeImportError as error:
        raise TypeImportError(f"groups.{needing}.transforms: {error}\n  {TF_INSTALL}") from error


class TransformListener:
    """Subscribes to /tf and /tf_static while groups need them. On the main thread, except where noted."""

    def __init__(
        self,
        *,
        entities: Entities,
        backend: RclBackend,
        loop: ReceiveLoop,
        came: Callable[[], None],
        runtime: Runtime,
    ) -> None:
        """Have `came` called, on the loop's thread, after transforms came."""
        self.frames: Final = Frames()
        """The transforms. To be used on the loop's thread."""
        self._entities, self._backend, self._loop, self._runtime = entities, backend, loop, runtime
        self._came = came
        self._message_type: Any = None
        self._entered: dict[str, tuple[Subscription, Source]] = {}
        self._failed: set[str] = set()
        self._try_again = 0.0
        self._once = OnceLog()

    def serve(self, groups: Iterable[GroupConfig]) -> None:
        """Listen from the next `poll` on if one of these needs it, else no longer; raises as `require_type`."""
        self._message_type = require_type(groups)
        self._try_again = 0.0

    def poll(self) -> None:
        """Subscribe to what is wanted and lacking, and end what is not wanted, or gives no more messages."""
        for topic in [*self._entered]:
            if self._message_type is None or topic in self._failed:
                self._leave(topic)
        if self._message_type is not None and self._runtime.monotonic() >= self._try_again:
            for topic in PROFILES:
                if topic not in self._entered:
                    self._enter(topic)

    def _enter(self, topic: str) -> None:
        try:
            subscription = self._entities.subscription(self._message_type, topic, PROFILES[topic])
            try:
                deliver = partial(self._take, is_static=topic == "/tf_static")
                source = self._backend.source(subscription, deliver)
                self._loop.call(lambda: self._loop.add(source, partial(self._fail, topic))).result()
            except BaseException:
                self._entities.end(subscription)
                raise
        except (RefusedError, RclError, RclCallError, OSError) as error:
            self._try_again = self._runtime.monotonic() + _TRY_AGAIN_S
            self._once.log(logging.ERROR, f"{topic}: {error}")
        else:
            self._entered[topic] = subscription, source

    def _leave(self, topic: str) -> None:
        subscription, source = self._entered.pop(topic)
        if topic not in self._failed:
            self._loop.call(lambda: self._loop.remove(source)).result()
        self._failed.discard(topic)
        self._entities.end(subscription)

    # These run on the loop's thread.

    def _take(self, payload: Payload, *, is_static: bool) -> None:
        for edge in read_transforms(payload.content(), is_static=is_static):
            self.frames.add(edge)
        self._came()

    def _fail(self, topic: str, error: Exception) -> None:
        self._failed.add(topic)
        self._once.log(logging.ERROR, f"{topic}: {error}; subscribing again")
