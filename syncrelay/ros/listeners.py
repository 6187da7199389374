"""Whether anyone subscribes to what lazy groups publish: while nobody does, they sleep."""

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.ros.entities import has_subscriber

if TYPE_CHECKING:
    from syncrelay.dataflow.group import GroupRelay
    from syncrelay.ros.bindings import GroupBinding

# A subscriber that is restarted, or that waits for publishers of another QoS, is back by then.
_GRACE_S: Final = 2.0

PublishersOf: TypeAlias = "Callable[[GroupRelay], Sequence[Any]]"


class Listeners:
    """Counts the subscribers of lazy groups. On the main thread."""

    def __init__(self, loop: ReceiveLoop) -> None:
        self._loop = loop
        self._unheard_since: dict[GroupRelay, float] = {}

    def count(self, lazy: Sequence["GroupBinding"], more: PublishersOf) -> None:
        """Wake the groups that have a subscriber, and let sleep those that have had none for a while.

        Beside those of their outputs, subscribers of `more` of a group's publishers count.
        """
        now = time.monotonic()
        unheard = [each for each in lazy if not any(map(has_subscriber, (*each.publishers, *more(each.group))))]
        self._unheard_since = {each.group: self._unheard_since.get(each.group, now) for each in unheard}
        for binding in lazy:
            group, since = binding.group, self._unheard_since.get(binding.group)
            if since is None and group.sleeps:
                self._switch(binding, group.wake)
            elif since is not None and not group.sleeps and now - since >= _GRACE_S:
                self._switch(binding, group.sleep)

    def _switch(self, binding: "GroupBinding", switch: Callable[[], None]) -> None:
        """Have all its inputs be fed, or not, between two messages; then have their topics subscribed, or not."""

        def turn() -> None:
            switch()
            for each in binding.inputs:
                each.topic.outputs.feed()

        self._loop.call(turn).result()
        for each in binding.inputs:
            each.topic.try_again()
