"""What of a group could not be published, and why."""

import logging
from typing import NamedTuple

from syncrelay.config.wording import counted
from syncrelay.dataflow.backend import Outlet
from syncrelay.explain import Code

_LOG = logging.getLogger("syncrelay")


class Unpublished(NamedTuple):
    """How many messages of an input could not be published one after the other, and why the last one could not."""

    messages: int
    why: str


class Refusals:
    """Counts what the outlets of a group refuse, and says it once."""

    def __init__(self, group: str) -> None:
        self.unpublished: dict[int, Unpublished] = {}
        """The inputs of which the last message could not be published."""
        self._group = group

    def refused(self, index: int, outlet: Outlet, why: str) -> None:
        """Note that an outlet did not publish a message of this input."""
        before = self.unpublished.get(index)
        self.unpublished[index] = Unpublished(1 + (before.messages if before else 0), why)
        if before is None:
            _LOG.error(
                "%s: a message could not be published on %s: %s; trying again with the next one",
                self._group,
                outlet.topic,
                why,
                extra={"group": self._group, "finding": Code.REFUSED_BY_DDS.value},
            )

    def accepted(self, index: int, outlet: Outlet) -> None:
        """Note that an outlet published a message of this input."""
        recovered = self.unpublished.pop(index, None)
        if recovered is not None:
            _LOG.info(
                "%s: publishing on %s again; %s not published",
                self._group,
                outlet.topic,
                f"{counted(recovered.messages, 'message')} {'was' if recovered.messages == 1 else 'were'}",
                extra={"group": self._group},
            )
