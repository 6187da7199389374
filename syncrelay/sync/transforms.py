"""Sets that wait until their messages can be transformed, and leave in the order in which they were matched."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, Protocol

from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.thinning import Withheld

# So many of the sets that were given up are followed, for so long, to see when they could have left: those of 10 s at
# 50 Hz, as long as tf2 keeps transforms.
_FOLLOWED: Final = 500
_FOLLOWED_NS: Final = 10_000_000_000


class Lack(Enum):
    """Why a message cannot be transformed; the later ones are the harder to mend by waiting."""

    LATE = "late"
    """An edge has nothing as new as the message yet."""
    UNCONNECTED = "unconnected"
    """Its frame and the target are in two trees."""
    UNKNOWN_FRAME = "unknown_frame"
    """No transform has named its frame, or the target."""
    LOOP = "loop"
    """Its frame's parents lead back to it."""
    PAST = "past"
    """An edge has only transforms that are newer than the message."""
    NO_FRAME = "no_frame"
    """Its frame_id is empty, or begins with `/`, and tf2 looks up none such."""


_SEVERITY: Final = {lack: severity for severity, lack in enumerate(Lack)}


@dataclass(frozen=True, slots=True)
class Missing:
    """What a message lacks: an edge from `parent` to `child`, whose stamps are `by_ns` from the message's.

    Of a lack that is of no edge, `child` is the frame that it is of, and `parent` the target.
    """

    lack: Lack
    parent: str
    child: str
    by_ns: int = 0

    @property
    def rank(self) -> tuple[int, int]:
        """The greater, the less is to be expected of waiting."""
        return _SEVERITY[self.lack], self.by_ns


class Chains(Protocol):
    """The transforms that are known."""

    version: int
    """Changes whenever more, or fewer, are known."""

    def missing(self, target: str, source: str, stamp: int) -> Missing | None:
        """Return what is missing to transform from a frame to another at a time in ns; None where nothing is."""
        ...


@dataclass(frozen=True, slots=True)
class Transforms:
    """What sets wait for: the transforms of all frames to `target`, up to `wait_ns` after they were matched."""

    chains: Chains
    target: str
    wait_ns: int


@dataclass(frozen=True, slots=True)
class Lapse:
    """A set that was given up: which input lacked what.

    `needed_ns` is the wait with which it would have left, `covered` when it could have, by the time of the group's
    calls. Both are None while that is not known.
    """

    input: int
    missing: Missing
    needed_ns: int | None = None
    covered: int | None = None


@dataclass(slots=True)
class _Needs:
    """The inputs, frames and stamps of a set that was matched at `since`, and what it lacked at some version."""

    of: tuple[tuple[int, str, int], ...]
    since: int
    version: int | None = None
    lapse: Lapse | None = None


class TransformStage:
    """Holds sets until all of their messages can be transformed.

    A set that cannot leave `wait_ns` after it was matched is given up, as `no_transform`; one of which a message has no
    frame that tf2 looks up, at once. A set that is ready waits for those before it, but not for those that lie before
    all that an edge has: only transforms out of order could help these. At most `most` sets wait; the oldest is given
    up for more.
    """

    __slots__ = ("_followed", "_most", "_passed", "_transforms", "_waiting", "_withheld", "lapses")

    def __init__(self, transforms: Transforms, *, n_inputs: int, repeats: bool, most: int) -> None:
        self._transforms = transforms
        self._most = most
        self._waiting: deque[tuple[Match, _Needs]] = deque()
        self._withheld = Withheld(n_inputs, DropReason.NO_TRANSFORM) if repeats else None
        self._passed: list[int | None] = [None] * n_inputs
        self._followed: deque[_Needs] = deque(maxlen=_FOLLOWED)
        self.lapses: deque[Lapse] = deque(maxlen=2 * _FOLLOWED)
        """The sets that were given up last, oldest first; and once more when they lack something else, or nothing."""

    def take(self, outcomes: Sequence[Outcome], now: int) -> list[Outcome]:
        """Take what a policy lets leave; return what leaves now. Drops do not wait."""
        left: list[Outcome] = []
        for outcome in outcomes:
            if isinstance(outcome, Drop):
                left.append(outcome)
                continue
            self._waiting.append((outcome, _Needs(_needs(outcome), now)))
            left += self.release(now)
            if len(self._waiting) > self._most:
                left += self._give_up()
        return left

    def release(self, now: int) -> list[Outcome]:
        """Return the sets that can be transformed, and the messages of those that are given up."""
        self._follow(now)
        left: list[Outcome] = []
        while self._waiting:
            ready = self._first_ready()
            _, head = self._waiting[0]
            if ready == 0:
                left += self._let_pass()
            elif ready is not None or now >= self._deadline(head) or _is_without_frame(head):
                left += self._give_up()
            else:
                break
        return left

    def next_deadline(self) -> int | None:
        """Return when the first of the waiting sets is given up."""
        return self._deadline(self._waiting[0][1]) if self._waiting else None

    def flush(self, reason: DropReason) -> list[Drop]:
        """Drop everything, and be as new."""
        messages = [message for index in range(len(self._passed)) for message in self._unseen(index)]
        drops = [Drop(message, reason) for message in messages]
        if self._withheld is not None:
            drops += self._withheld.flush(reason)
        self._waiting.clear()
        self._followed.clear()
        self._passed = [None] * len(self._passed)
        return drops

    def let_go(self, reason: DropReason) -> list[Drop]:
        """Drop what waits; the newest message of an input stays where it can be in many sets."""
        if self._withheld is None:
            return self.flush(reason)
        drops: list[Drop] = []
        while self._waiting:
            match, _ = self._waiting.popleft()
            drops += self._withheld.note_stopped(match)
        return drops

    def buffered(self, index: int) -> int:
        """Return how many messages of this input wait, and have been in no set that left."""
        held = 0 if self._withheld is None else self._withheld.buffered(index)
        return held + len(self._unseen(index))

    def _unseen(self, index: int) -> list[Message]:
        """Return the messages of an input that are in waiting sets, and were in none before."""
        messages = [message for match, _ in self._waiting if (message := match.messages[index]) is not None]
        if self._withheld is None:
            return messages
        seen = {self._passed[index], self._withheld.stamp(index)}
        return [message for stamp, message in {each.stamp: each for each in messages}.items() if stamp not in seen]

    def _first_ready(self) -> int | None:
        """Return the place of the first set that can leave; None where one before it is worth waiting for."""
        for place, (_, needs) in enumerate(self._waiting):
            lapse = self._look(needs)
            if lapse is None:
                return place
            if lapse.missing.lack not in (Lack.PAST, Lack.NO_FRAME):
                break
        return None

    def _look(self, needs: _Needs) -> Lapse | None:
        """Return what a set lacks now."""
        chains = self._transforms.chains
        if needs.version != chains.version:
            found = [
                Lapse(index, missing)
                for index, frame, stamp in needs.of
                if (missing := chains.missing(self._transforms.target, frame, stamp)) is not None
            ]
            needs.lapse = max(found, key=lambda each: each.missing.rank, default=None)
            needs.version = chains.version
        return needs.lapse

    def _let_pass(self) -> list[Outcome]:
        match, _ = self._waiting.popleft()
        if self._withheld is None:
            return [match]
        for message in match.messages:
            if message is not None:
                self._passed[message.input] = message.stamp
        return [*self._withheld.note_passed(match), match]

    def _give_up(self) -> list[Drop]:
        match, needs = self._waiting.popleft()
        if needs.lapse is not None:
            self.lapses.append(needs.lapse)
            self._followed.append(needs)
        if self._withheld is not None:
            return self._withheld.note_stopped(match)
        return [Drop(message, DropReason.NO_TRANSFORM) for message in match.messages if message is not None]

    def _follow(self, now: int) -> None:
        """See which of the sets that were given up could leave now."""
        while self._followed:
            first = self._followed[0]
            if first.version == self._transforms.chains.version:
                return
            lapse, lacks = first.lapse, self._look(first)
            if lacks is None and lapse is not None:
                self.lapses.append(replace(lapse, needed_ns=now - first.since, covered=now))
            elif now - first.since < _FOLLOWED_NS:
                if lacks is not None and lapse is not None and lacks.missing.lack is not lapse.missing.lack:
                    self.lapses.append(lacks)
                return
            self._followed.popleft()

    def _deadline(self, needs: _Needs) -> int:
        return needs.since + self._transforms.wait_ns


def _needs(match: Match) -> tuple[tuple[int, str, int], ...]:
    """Return the inputs, frames and stamps with which the messages of a set leave."""
    return tuple(
        (message.input, message.frame, message.stamp if match.stamp is None else match.stamp)
        for message in match.messages
        if message is not None and message.frame is not None
    )


def _is_without_frame(needs: _Needs) -> bool:
    return needs.lapse is not None and needs.lapse.missing.lack is Lack.NO_FRAME
