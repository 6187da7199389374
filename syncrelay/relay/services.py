"""Services of the relay's node that answer in words."""

from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future, InvalidStateError
from contextlib import suppress
from functools import partial
from typing import Final, TypeAlias

from syncrelay.dataflow.bugs import Bugs
from syncrelay.errors import SyncRelayError
from syncrelay.printable import one_entry
from syncrelay.relay.ports import Answer, Node
from syncrelay.runtime import Runtime

Offered: TypeAlias = Mapping[str, Callable[[], "Future[str]"]]
"""What is called for each service, by its name below the node's; the words of its answer come in the future.

A SyncRelayError is an answer too, of a call that did not succeed.
"""

# ROS gives a service a queue of this many answers: if more are sent at once, some are lost.
_MOST_WAITING: Final = 10
_ENDING: Final = Answer(success=False, message="the relay is ending")
_TOO_MANY: Final = Answer(
    success=False, message=f"{_MOST_WAITING} calls are already waiting for their answers; call again later"
)
# How long an end may take to answer the callers that still wait.
_TELL_S: Final = 1.0


class Services:
    """Offers services on a node until `end`. They are called on the thread that serves it, and none holds it up."""

    def __init__(self, node: Node, offered: Offered, *, bugs: Bugs, runtime: Runtime) -> None:
        self._node = node
        self._bugs = bugs
        self._runtime = runtime
        self._waiting: dict[Future[Answer], None] = {}
        self._ended = False
        for name, function in offered.items():
            node.offer(name, partial(self._call, name, function))

    def end(self) -> None:
        """Answer all callers, waiting and new, that the relay is ending. On another thread than the node's."""
        self._ended = True
        for answer in list(self._waiting):
            self._settle(answer, _ENDING)
        self._node.flush_answers(_TELL_S)

    def _call(self, name: str, function: Callable[[], "Future[str]"]) -> "Future[Answer]":
        answer: Future[Answer] = self._runtime.future()
        if len(self._waiting) >= _MOST_WAITING:
            answer.set_result(_TOO_MANY)
            return answer
        self._waiting[answer] = None
        try:
            function().add_done_callback(lambda told: self._settle(answer, self._outcome(name, told)))
        except Exception as error:  # noqa: BLE001  a caller gets an answer whatever happens
            self._settle(answer, self._refusal(name, error))
        if self._ended:
            self._settle(answer, _ENDING)
        return answer

    def _outcome(self, name: str, told: "Future[str]") -> Answer:
        try:
            return Answer(success=True, message=one_entry(told.result()))
        except Exception as error:  # noqa: BLE001  as above
            return self._refusal(name, error)

    def _refusal(self, name: str, error: Exception) -> Answer:
        if isinstance(error, CancelledError):
            return _ENDING
        if isinstance(error, SyncRelayError):
            return Answer(success=False, message=one_entry(str(error)))
        self._bugs.log(f"answering ~/{name}", error)
        words = f"a bug in syncrelay while answering ~/{name}: {error!r}; its traceback is in the log"
        return Answer(success=False, message=one_entry(words))

    def _settle(self, answer: "Future[Answer]", words: Answer) -> None:
        self._waiting.pop(answer, None)
        # An end and an answer may come at the same moment.
        with suppress(InvalidStateError):
            answer.set_result(words)
