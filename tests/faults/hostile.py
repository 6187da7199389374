"""Payloads that no driver sends: random bytes, lengths that lie, stamps that cannot be."""

import random
from collections.abc import Iterator
from struct import pack
from typing import Literal

from tests.faults.certified import certified
from tests.ros.cdr_messages import NS_PER_SECOND, padded

_MOST_SECONDS = 2**31 - 1
_SECONDS = (_MOST_SECONDS, -_MOST_SECONDS - 1, -1, 0, 1)
_NANOSECONDS = (0, 1, NS_PER_SECOND - 1, NS_PER_SECOND, 4_000_000_000, 2**32 - 1)
_LENGTHS = (0, 1, 4, 49, 2**16, 2**31, 2**32 - 1)
_ODD_NUMBERS = (float("nan"), float("inf"), -0.0, 5e-324)


def hostile_payloads(count: int, *, seed: int) -> Iterator[bytes]:
    """So many payloads for a topic of Vector3Stamped; none has a stamp near that of a message that is meant."""
    chance = random.Random(seed)
    makers = (_random_bytes, _cut, _lying_length, _impossible_stamp, _odd_numbers, _other_encapsulation)
    for _ in range(count):
        yield chance.choice(makers)(chance)


def fate(payload: bytes) -> str:
    """What a group that goes by header stamps is to make of it: `malformed`, `unstamped` or `stamped`."""
    carried = padded(payload)
    if len(carried) < 12 or carried[0] or carried[1] not in (0, 1, 6, 7):
        return "malformed"
    order: Literal["little", "big"] = "little" if carried[1] % 2 else "big"
    seconds, nanoseconds = carried[4:8], int.from_bytes(carried[8:12], order)
    if nanoseconds >= NS_PER_SECOND:
        return "malformed"
    return "stamped" if any(seconds) or nanoseconds else "unstamped"


def _whole(chance: random.Random) -> bytes:
    return certified("/camera", chance.randrange(1, 1000) * NS_PER_SECOND)


def _random_bytes(chance: random.Random) -> bytes:
    return chance.randbytes(chance.randrange(1, 200))


def _cut(chance: random.Random) -> bytes:
    whole = _whole(chance)
    return whole[: chance.randrange(1, len(whole))]


def _lying_length(chance: random.Random) -> bytes:
    whole = _whole(chance)
    return whole[:12] + pack("<I", chance.choice(_LENGTHS)) + whole[16 : chance.randrange(16, len(whole) + 1)]


def _impossible_stamp(chance: random.Random) -> bytes:
    whole = _whole(chance)
    return whole[:4] + pack("<iI", chance.choice(_SECONDS), chance.choice(_NANOSECONDS)) + whole[12:]


def _odd_numbers(chance: random.Random) -> bytes:
    return _whole(chance)[:-24] + pack("<ddd", *chance.choices(_ODD_NUMBERS, k=3))


def _other_encapsulation(chance: random.Random) -> bytes:
    return chance.randbytes(4) + _whole(chance)[4:]
