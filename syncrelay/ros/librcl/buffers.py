"""Memory of messages: lent to one payload at a time, and back in the pool when nobody holds that payload."""

from ctypes import addressof, byref, c_uint8
from typing import Final

from syncrelay.ros.librcl.rcl import Rcl, SerializedMessage

# A queue gives back one memory for each that it takes in, so a few keep a steady stream from allocating. What a
# burst took beyond them is freed.
_SPARE: Final = 8


class Memory:
    """A serialized message that librcl fills, grows and publishes from."""

    __slots__ = ("_capacity", "_content", "_length", "_message", "_rcl", "_whole", "pointer")

    def __init__(self, rcl: Rcl) -> None:
        """Make one without room; raises RclCallError where there is no memory."""
        self._rcl = rcl
        self._message = SerializedMessage()
        self.pointer = byref(self._message)
        allocator = rcl.default_allocator()
        rcl.require(rcl.array_init(self.pointer, 0, byref(allocator)), "rcutils_uint8_array_init")
        self._capacity = self._length = 0
        self._whole = self._content = memoryview(b"")

    def content(self) -> memoryview:
        """The message's bytes where they lie: writable, and valid until the next take."""
        # A topic's messages are nearly always as long as the one before.
        if self._message.length != self._length or self._message.capacity != self._capacity:
            self._look()
        return self._content

    def _look(self) -> None:
        message = self._message
        if message.capacity != self._capacity:
            self._capacity = message.capacity
            self._whole = memoryview((c_uint8 * self._capacity).from_address(message.buffer)).cast("B")
        self._length = message.length
        self._content = self._whole[: self._length]

    def __del__(self) -> None:
        self._rcl.array_fini(self.pointer)
        # The collector may end it before its payload, which gives it back: it is as new then.
        self._capacity = self._length = 0


class OwnMessage:
    """A serialized message that is filled from Python, and lies in memory of Python's."""

    __slots__ = ("_message", "_room", "pointer")

    def __init__(self, rcl: Rcl) -> None:
        self._message = SerializedMessage(allocator=rcl.default_allocator())
        self._room = memoryview(b"")
        self.pointer = byref(self._message)

    def fill(self, content: bytes) -> None:
        """Take a copy of a message, in the place of the one before."""
        size = len(content)
        if size > len(self._room):
            # As the numbers in it grow, so may the next.
            room = (c_uint8 * (2 * size))()
            self._room = memoryview(room).cast("B")
            self._message.buffer, self._message.capacity = addressof(room), 2 * size
        self._room[:size] = content
        self._message.length = size


class Pool:
    """Memories of one subscription, whose messages are of like size. Taken on one thread, given back on any."""

    def __init__(self, rcl: Rcl) -> None:
        self._rcl = rcl
        self.spare: list[Memory] = []
        """Those that nobody has; the last is the one to take, or `make` one."""
        self.made = 0
        self.freed = 0

    @property
    def lent(self) -> int:
        """How many memories are out."""
        return self.made - self.freed - len(self.spare)

    def make(self) -> Memory:
        """Return a memory more; its payload gives it back."""
        self.made += 1
        return Memory(self._rcl)


class Payload:
    """One message; whoever refers to it owns it, and when nobody does, its memory goes back.

    So it may serve several groups and several sets, and none of them has to say when it is done.
    """

    __slots__ = ("_pool", "content", "memory", "received")

    def __init__(self, memory: Memory, pool: Pool, received: int) -> None:
        self.memory = memory
        self.received = received
        self.content = memory.content
        self._pool = pool

    def __del__(self) -> None:
        # Done for each message, as is taking a spare one: a call more would cost more than what it does.
        pool = self._pool
        if len(pool.spare) < _SPARE:
            pool.spare.append(self.memory)
        else:
            pool.freed += 1
