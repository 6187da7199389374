# cython: language_level=3, boundscheck=False, wraparound=False
"""The path of a message in compiled code: messages are taken and published in librcl, without a copy in Python.

The inbox and the flow do what dataflow/inbox.py and flow.py do, which are easier to read; only the waiting
differs. An rcl wait set is filled, attached to every reader and taken apart for each wait. Here DDS itself rings a bell
when a message arrives, so a wait costs the same for any number of subscriptions.

This module is built without ROS. backend.py hands over the addresses of librcl's functions, and proves at every start
that they do what is expected here.
"""

import time
from collections import deque

from syncrelay.dataflow.backend import PublishError, RclCallError
from syncrelay.dataflow.deliveries import GID_BYTES, LARGEST_GAP, MOST_PUBLISHERS, Deliveries
from syncrelay.dataflow.flow import RECENT, Watched
from syncrelay.explain import RecentDrop
from syncrelay.sync import DropReason, Match, Message, SyncGroup
from syncrelay.sync.lending import LARGEST_NS, MOST_LENT, Fed, Search

cimport cython
from cpython.memoryview cimport PyMemoryView_FromMemory
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint8_t, uint32_t, uint64_t, uintptr_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcmp, memcpy, memmove, memset


cdef extern from *:
    """
    #include <errno.h>
    #include <limits.h>
    #include <linux/futex.h>
    #include <stdint.h>
    #include <sys/syscall.h>
    #include <time.h>
    #include <unistd.h>

    /* The receive loop sleeps on a bell. Ringing it is a system call only while the loop sleeps. */
    enum { AWAKE = 0, RUNG = 1, ASLEEP = 2 };
    typedef struct { uint32_t state; uint32_t woken; } sr_bell;
    /* What DDS reports of one subscription. */
    typedef struct { sr_bell * bell; uint64_t reported; } sr_signal;

    static void sr_ring(sr_bell * bell)
    {
      if (__atomic_exchange_n(&bell->state, RUNG, __ATOMIC_SEQ_CST) == ASLEEP) {
        syscall(SYS_futex, &bell->state, FUTEX_WAKE | FUTEX_PRIVATE_FLAG, 1, NULL, NULL, 0);
      }
    }

    /* rcl_event_callback_t, called on DDS's threads. */
    static void sr_on_new_message(const void * user, size_t count)
    {
      sr_signal * signal = (sr_signal *)user;
      __atomic_fetch_add(&signal->reported, count, __ATOMIC_SEQ_CST);
      sr_ring(signal->bell);
    }

    static void sr_wake(sr_bell * bell)
    {
      __atomic_store_n(&bell->woken, 1, __ATOMIC_SEQ_CST);
      sr_ring(bell);
    }

    /* Whether it has rung since it was last heard. */
    static int sr_heard(sr_bell * bell)
    {
      return __atomic_exchange_n(&bell->state, AWAKE, __ATOMIC_SEQ_CST) == RUNG;
    }

    static void sr_sleep(sr_bell * bell, int64_t longest_ns)
    {
      uint32_t awake = AWAKE;
      if (__atomic_compare_exchange_n(&bell->state, &awake, ASLEEP, 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST)) {
        struct timespec longest = { longest_ns / 1000000000, longest_ns % 1000000000 };
        syscall(SYS_futex, &bell->state, FUTEX_WAIT | FUTEX_PRIVATE_FLAG, ASLEEP, &longest, NULL, 0);
      }
    }

    static int sr_was_woken(sr_bell * bell)
    {
      return (int)__atomic_exchange_n(&bell->woken, 0, __ATOMIC_SEQ_CST);
    }

    static uint64_t sr_reported(sr_signal * signal)
    {
      return __atomic_load_n(&signal->reported, __ATOMIC_SEQ_CST)
        ? __atomic_exchange_n(&signal->reported, 0, __ATOMIC_SEQ_CST) : 0;
    }

    static int64_t sr_clock(clockid_t clock)
    {
      struct timespec now;
      clock_gettime(clock, &now);
      return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
    }
    """
    ctypedef struct sr_bell:
        pass
    ctypedef struct sr_signal:
        sr_bell * bell
    void sr_on_new_message(const void * user, size_t count) noexcept nogil
    void sr_wake(sr_bell *) noexcept nogil
    bint sr_heard(sr_bell *) noexcept nogil
    void sr_sleep(sr_bell *, int64_t) noexcept nogil
    bint sr_was_woken(sr_bell *) noexcept nogil
    uint64_t sr_reported(sr_signal *) noexcept nogil
    int64_t sr_clock(int) noexcept nogil
    int CLOCK_REALTIME
    int CLOCK_MONOTONIC


# Structures of Jazzy, after rcutils/allocator.h, rcutils/types/uint8_array.h, rcutils/error_handling.h and rmw/types.h:
# rcutils_allocator_t, rmw_serialized_message_t, rmw_gid_t, rmw_message_info_t (times in nanoseconds of the system clock)
# and rcutils_error_string_t.
ctypedef struct Allocator:
    void * allocate
    void * deallocate
    void * reallocate
    void * zero_allocate
    void * state

ctypedef struct SerializedMessage:
    uint8_t * buffer
    size_t length
    size_t capacity
    Allocator allocator

ctypedef struct Gid:
    void * implementation_identifier
    uint8_t data[16]

ctypedef struct MessageInfo:
    int64_t source_timestamp
    int64_t received_timestamp
    uint64_t publication_sequence_number
    uint64_t reception_sequence_number
    Gid publisher_gid
    uint8_t from_intra_process

ctypedef struct ErrorText:
    char text[1024]

cdef enum:
    MARGIN = 256
    UNTOUCHED = 0xA5

# What librcl fills lies before a margin: that stays as it was, unless librcl's structure is larger than ours.
ctypedef struct RoomyAllocator:
    Allocator allocator
    uint8_t margin[MARGIN]

ctypedef struct RoomyMessage:
    SerializedMessage message
    uint8_t margin[MARGIN]

ctypedef struct RoomyInfo:
    MessageInfo info
    uint8_t margin[MARGIN]


cdef bint _is_untouched(const uint8_t * margin) noexcept nogil:
    cdef int n
    for n in range(MARGIN):
        if margin[n] != UNTOUCHED:
            return False
    return True


cdef extern from *:
    const char * SYNCRELAY_SOURCE

# setup.py's fingerprint of this file.
SOURCE = SYNCRELAY_SOURCE.decode()

cdef enum:
    NOTHING_TAKEN = 401
    SPARE = 8
    BATCH = 256
    MOST_COUNTED = 16
    GID = 16

assert (MOST_COUNTED, GID) == (MOST_PUBLISHERS, GID_BYTES)

cdef int64_t SECOND = 1_000_000_000
# rmw's number of a message where the middleware has none.
cdef uint64_t NOT_NUMBERED = <uint64_t>-1
cdef uint64_t MOST_SKIPPED = LARGEST_GAP
# More than any history holds.
cdef uint64_t ALL = <uint64_t>1 << 62


ctypedef void (*OnNewMessage)(const void *, size_t) noexcept nogil

# The garbage collector does not see these three: no cycle goes through them, and a message that ends needs the others.
@cython.final
@cython.no_gc
cdef class Librcl:
    """The functions of librcl and librcutils that are called here, by name as addresses.

    Raises RclCallError where they do not fill the structures as they are declared above.
    """

    cdef int (*take)(const void *, SerializedMessage *, MessageInfo *, void *) noexcept nogil
    cdef int (*publish)(const void *, const SerializedMessage *, void *) noexcept nogil
    cdef int (*array_init)(SerializedMessage *, size_t, const Allocator *) noexcept nogil
    cdef int (*array_fini)(SerializedMessage *) noexcept nogil
    cdef int (*set_on_new_message)(const void *, OnNewMessage, const void *) noexcept nogil
    cdef void * (*graph_guard_condition)(const void *) noexcept nogil
    cdef int (*add_guard_condition)(void *, const void *, void *) noexcept nogil
    cdef ErrorText (*error_text)() noexcept nogil
    cdef void (*reset_error)() noexcept nogil
    cdef Allocator allocator

    def __init__(self, addresses):
        def address(name) -> int:
            return addresses[name]

        self.take = <int (*)(const void *, SerializedMessage *, MessageInfo *, void *) noexcept nogil><uintptr_t>address("rcl_take_serialized_message")
        self.publish = <int (*)(const void *, const SerializedMessage *, void *) noexcept nogil><uintptr_t>address("rcl_publish_serialized_message")
        self.array_init = <int (*)(SerializedMessage *, size_t, const Allocator *) noexcept nogil><uintptr_t>address("rcutils_uint8_array_init")
        self.array_fini = <int (*)(SerializedMessage *) noexcept nogil><uintptr_t>address("rcutils_uint8_array_fini")
        self.set_on_new_message = <int (*)(const void *, OnNewMessage, const void *) noexcept nogil><uintptr_t>address("rcl_subscription_set_on_new_message_callback")
        self.graph_guard_condition = <void * (*)(const void *) noexcept nogil><uintptr_t>address("rcl_node_get_graph_guard_condition")
        self.add_guard_condition = <int (*)(void *, const void *, void *) noexcept nogil><uintptr_t>address("rcl_wait_set_add_guard_condition")
        self.error_text = <ErrorText (*)() noexcept nogil><uintptr_t>address("rcutils_get_error_string")
        self.reset_error = <void (*)() noexcept nogil><uintptr_t>address("rcutils_reset_error")
        self._prove((<RoomyAllocator (*)() noexcept nogil><uintptr_t>address("rcutils_get_default_allocator"))().allocator)

    cdef int _prove(self, Allocator allocator) except -1:
        cdef RoomyMessage roomy
        cdef SerializedMessage * message = &roomy.message
        memset(&roomy, UNTOUCHED, sizeof(RoomyMessage))
        self.require(self.array_init(message, 17, &allocator), "rcutils_uint8_array_init")
        if not _is_untouched(roomy.margin):
            raise RclCallError("rmw_serialized_message_t is larger than expected")
        if message.length != 0 or message.capacity != 17:
            raise RclCallError("rmw_serialized_message_t has other fields than expected")
        if memcmp(&message.allocator, &allocator, sizeof(Allocator)):
            raise RclCallError("rcutils_allocator_t has other fields than expected")
        self.require(self.array_fini(message), "rcutils_uint8_array_fini")
        if message.buffer != NULL:
            raise RclCallError("rmw_serialized_message_t keeps its buffer elsewhere")
        self.allocator = allocator
        return 0

    cdef int require(self, int code, object what) except -1:
        """Raise RclCallError, in librcl's words, unless a call returned that all is well."""
        if code:
            text = self.error_text().text.decode(errors="replace")
            self.reset_error()
            raise RclCallError(f"{what} failed with {code}: {text}")
        return 0

    def add_graph_condition(self, node, wait_set):
        """Have an rcl wait set wait for changes of the graph, as a node sees them. Both are addresses."""
        cdef void * condition = self.graph_guard_condition(<void *><uintptr_t>node)
        self.require(self.add_guard_condition(<void *><uintptr_t>wait_set, condition, NULL), "rcl_wait_set_add_guard_condition")


@cython.final
@cython.no_gc
cdef class Pool:
    """Memories of one subscription, whose messages are of like size."""

    cdef Librcl librcl
    cdef SerializedMessage * spare[SPARE]
    cdef int n_spare
    cdef readonly int made, freed

    def __init__(self, Librcl librcl):
        self.librcl = librcl

    @property
    def lent(self):
        """How many memories are out."""
        return self.made - self.freed - self.n_spare

    cdef SerializedMessage * lend(self) except NULL:
        if self.n_spare:
            self.n_spare -= 1
            return self.spare[self.n_spare]
        cdef SerializedMessage * message = <SerializedMessage *>calloc(1, sizeof(SerializedMessage))
        if message == NULL:
            raise MemoryError
        if self.librcl.array_init(message, 0, &self.librcl.allocator):
            free(message)
            raise MemoryError
        self.made += 1
        return message

    cdef void give_back(self, SerializedMessage * message) noexcept:
        if self.n_spare < SPARE:
            self.spare[self.n_spare] = message
            self.n_spare += 1
        else:
            self.freed += 1
            self._free(message)

    cdef void _free(self, SerializedMessage * message) noexcept:
        self.librcl.array_fini(message)
        free(message)

    def __dealloc__(self):
        while self.n_spare:
            self.n_spare -= 1
            self._free(self.spare[self.n_spare])


@cython.final
@cython.no_gc
@cython.freelist(64)
cdef class Payload:
    """One message; when nobody refers to it, its memory goes back."""

    cdef Pool pool
    cdef SerializedMessage * message
    cdef readonly int64_t received

    def content(self):
        """The message's bytes where they lie: writable, and valid as long as the payload."""
        return PyMemoryView_FromMemory(<char *>self.message.buffer, self.message.length, 0x200)

    def __dealloc__(self):
        if self.message != NULL:
            self.pool.give_back(self.message)


# As dataflow.deliveries.Deliveries. `least_way` is INT64_MAX until a message came since it was last read.
ctypedef struct Count:
    uint8_t gid[GID]
    uint64_t first
    uint64_t newest
    uint64_t delivered
    uint64_t longest_gap
    uint64_t seen
    int64_t published
    int64_t least_way


@cython.final
@cython.no_gc_clear
cdef class Source:
    """A subscription drained by librcl."""

    cdef public int64_t waited
    cdef public uint64_t pending
    cdef readonly Pool pool
    cdef Librcl librcl
    cdef const void * subscription
    cdef object owner
    cdef RoomyInfo info
    cdef Count counts[MOST_COUNTED]
    cdef Count * counted
    cdef int n_counts
    cdef uint64_t seen
    cdef sr_signal * signal
    cdef SerializedMessage * next
    cdef Payload held
    cdef object _deliver
    cdef Deliver _by_header

    def __init__(self, Librcl librcl, subscription, deliver):
        self.librcl, self.owner, self.pool = librcl, subscription, Pool(librcl)
        self.subscription = <const void *><uintptr_t>subscription.handle.pointer
        memset(&self.info, UNTOUCHED, sizeof(RoomyInfo))
        self.next = self.pool.lend()
        self.deliver = deliver

    @property
    def deliver(self):
        return self._deliver

    @deliver.setter
    def deliver(self, deliver):
        self._deliver = deliver
        self._by_header = deliver if isinstance(deliver, Deliver) else None

    def take(self):
        """Take its oldest message; None if there is none after all. Raises RclCallError."""
        return self._take()

    cdef Payload _take(self):
        cdef SerializedMessage * message = self.next
        cdef int code
        with nogil:
            code = self.librcl.take(self.subscription, message, &self.info.info, NULL)
            if not code:
                self._note()
        if code:
            if code != NOTHING_TAKEN:
                self.librcl.require(code, "rcl_take_serialized_message")
            # A full history has replaced some of those that were pending.
            self.pending = 0
            return None
        self.pending -= 1
        self.next = self.pool.lend()
        cdef Payload payload = Payload.__new__(Payload)
        payload.pool, payload.message, payload.received = self.pool, message, self.info.info.received_timestamp
        return payload

    cdef void _note(self) noexcept nogil:
        """Count the message that was taken: as dataflow.deliveries.Tally.note."""
        cdef const MessageInfo * info = &self.info.info
        cdef uint64_t number = info.publication_sequence_number
        if number == NOT_NUMBERED:
            return
        cdef Count * count = self.counted
        if count == NULL or memcmp(count.gid, info.publisher_gid.data, GID):
            count = self.counted = self._count_of(info)
        self.seen += 1
        count.seen = self.seen
        if number > count.newest and number - count.newest - 1 <= MOST_SKIPPED:
            if number - count.newest - 1 > count.longest_gap:
                count.longest_gap = number - count.newest - 1
        elif count.delivered:
            count.first, count.delivered = number, 0
        count.newest = number
        count.published = info.source_timestamp
        count.delivered += 1
        if info.received_timestamp - info.source_timestamp < count.least_way:
            count.least_way = info.received_timestamp - info.source_timestamp

    cdef Count * _count_of(self, const MessageInfo * info) noexcept nogil:
        """The count of a publisher: a new one, in the place of the longest silent, where it has none."""
        cdef Count * count = NULL
        cdef int n
        for n in range(self.n_counts):
            if not memcmp(self.counts[n].gid, info.publisher_gid.data, GID):
                return &self.counts[n]
            if count == NULL or self.counts[n].seen < count.seen:
                count = &self.counts[n]
        if self.n_counts < MOST_COUNTED:
            count = &self.counts[self.n_counts]
            self.n_counts += 1
        memcpy(count.gid, info.publisher_gid.data, GID)
        count.first = count.newest = info.publication_sequence_number
        count.delivered = count.longest_gap = 0
        count.least_way = INT64_MAX
        return count

    def deliveries(self):
        """Give what came of each publisher."""
        cdef Count * count
        cdef int n
        told = []
        for n in range(self.n_counts):
            count = &self.counts[n]
            least_way = None if count.least_way == INT64_MAX else count.least_way
            told.append(
                Deliveries(
                    (<char *>count.gid)[:GID],
                    count.first,
                    count.newest,
                    count.delivered,
                    count.published,
                    count.longest_gap,
                    least_way,
                )
            )
            count.longest_gap, count.least_way = 0, INT64_MAX
        return told

    def require_margin(self):
        """Raise RclCallError where librcl wrote more of a message's information than MessageInfo has."""
        if not _is_untouched(self.info.margin):
            raise RclCallError("rmw_message_info_t is larger than expected")

    cdef int _give(self, Payload payload, int64_t until) except -1:
        if until - payload.received > self.waited:
            self.waited = until - payload.received
        # Its own reference: what is called may have another put in its place.
        cdef Deliver by_header = self._by_header
        if by_header is not None:
            by_header.give(payload)
        else:
            self._deliver(payload)
        return 0

    cdef int _listen(self, sr_bell * bell) except -1:
        """Have the bell rung when messages come; what is there already is found by the next poll."""
        if self.signal != NULL:
            raise ValueError("it is drained already")
        self.signal = <sr_signal *>calloc(1, sizeof(sr_signal))
        if self.signal == NULL:
            raise MemoryError
        self.signal.bell = bell
        cdef int code = self.librcl.set_on_new_message(self.subscription, sr_on_new_message, self.signal)
        if code:
            free(self.signal)
            self.signal = NULL
            self.librcl.require(code, "rcl_subscription_set_on_new_message_callback")
        self.pending = ALL
        return 0

    cdef bint _leave(self) noexcept:
        """Have no bell rung; whether that is certain. Else what DDS would write to stays."""
        cdef int code = self.librcl.set_on_new_message(self.subscription, NULL, NULL)
        if not code:
            free(self.signal)
        self.signal = NULL
        # Who leaves it in the midst of a delivery may destroy it.
        self.pending = 0
        return not code

    def __dealloc__(self):
        if self.next != NULL:
            self.pool.give_back(self.next)


@cython.final
cdef class Inbox:
    """Waits for what DDS reports and delivers it by the time of receipt; as PolledInbox on an EventWatch."""

    cdef readonly dict failed
    cdef list sources
    cdef Py_ssize_t n_held
    cdef sr_bell * bell
    cdef Py_ssize_t n_ringers
    cdef int64_t force_every, forced_at

    def __cinit__(self):
        self.bell = <sr_bell *>calloc(1, sizeof(sr_bell))
        if self.bell == NULL:
            raise MemoryError

    def __init__(self, *, force_ns=SECOND):
        self.failed, self.sources, self.force_every = {}, [], force_ns
        self.forced_at = sr_clock(CLOCK_REALTIME)

    def __dealloc__(self):
        # What DDS might still write to is left.
        if not self.n_ringers:
            free(self.bell)

    def add(self, Source source):
        """Drain one more source; raises RclCallError."""
        source._listen(self.bell)
        self.n_ringers += 1
        self.sources.append(source)
        sr_wake(self.bell)

    def remove(self, Source source):
        """Deliver what is held of a source, and drain it no longer."""
        cdef Payload payload
        if source.held is not None:
            payload = self._release(source)
            self._hand_on(source, payload, payload.received)
        self.failed.pop(source, None)
        if source in self.sources:
            self._leave(source)

    cdef int _leave(self, Source source) except -1:
        self.sources.remove(source)
        if source._leave():
            self.n_ringers -= 1
        return 0

    def receive(self, int64_t longest_ns):
        """Deliver what comes for so long, or until a wake or a failure."""
        cdef int64_t end = sr_clock(CLOCK_MONOTONIC) + longest_ns
        cdef int64_t rest = longest_ns
        while rest > 0 and not (self._turn(rest) or self.failed):
            rest = end - sr_clock(CLOCK_MONOTONIC)

    def receive_once(self, int64_t longest_ns):
        """Wait for messages, for so long at most or until a wake, and deliver them."""
        self._turn(longest_ns)

    cdef int _turn(self, int64_t longest_ns) except -1:
        """Receive once; whether there was a wake."""
        cdef Source source, only = None
        cdef Py_ssize_t n_ready = 0
        cdef int64_t now, due
        if not sr_heard(self.bell) and not self.n_held:
            with nogil:
                sr_sleep(self.bell, longest_ns)
                sr_heard(self.bell)
        cdef int woken = sr_was_woken(self.bell)
        now = sr_clock(CLOCK_REALTIME)
        # Now and then all are polled: a report that was never made must not silence a topic.
        cdef bint force = now - self.forced_at >= self.force_every or now < self.forced_at
        if force:
            self.forced_at = now
        for source in self.sources:
            source.pending = ALL if force else source.pending + sr_reported(source.signal)
            if source.pending:
                n_ready += 1
                only = source
        if n_ready == 1 and not self.n_held:
            self._deliver_alone(only, now)
        elif n_ready or self.n_held:
            due = self._due(now)
            self._fill()
            self._deliver(due, now, BATCH)
        return woken

    def deliver_all(self):
        """Deliver what was received until now, however much it is."""
        cdef Source source
        for source in self.sources:
            source.pending = ALL
        self._fill()
        cdef int64_t now = sr_clock(CLOCK_REALTIME)
        self._deliver(now, now, -1)

    def deliver_held(self):
        """Deliver what was taken and held, at the end: nothing more is taken."""
        cdef Source source = self._first()
        cdef Payload payload
        while source is not None:
            payload = self._release(source)
            self._hand_on(source, payload, payload.received)
            source = self._first()

    cdef int _deliver_alone(self, Source source, int64_t until) except -1:
        """Deliver what one source has, a batch at most: nearly always, and without any sorting."""
        cdef Payload payload
        cdef int n
        try:
            for n in range(BATCH + 1):
                if not source.pending:
                    return 0
                payload = source._take()
                if payload is None:
                    return 0
                if n == BATCH or payload.received > until:
                    source.held = payload
                    self.n_held += 1
                    return 0
                source._give(payload, until)
        except Exception as error:
            self.failed[source] = error
        return 0

    cdef int _fill(self) except -1:
        """Take one message of each source of which none is held."""
        cdef Source source
        for source in list(self.sources):
            if source.held is None:
                self._hold(source)
        return 0

    cdef int64_t _due(self, int64_t now) noexcept:
        """Until when messages may be delivered: as Backlog.deliver."""
        cdef Source source
        if self.n_held:
            for source in self.sources:
                if source.held is not None and source.held.received > now:
                    now = source.held.received
        return now

    cdef int _deliver(self, int64_t due, int64_t now, int most) except -1:
        """Deliver the oldest first, up to a time; so many at most, or without end if that is negative."""
        cdef Source source
        while most:
            source = self._first()
            if source is None or source.held.received > due:
                return 0
            self._hand_on(source, self._release(source), now)
            self._hold(source)
            most -= 1
        return 0

    cdef Source _first(self):
        """The source of which the oldest message is held."""
        cdef Source source, first = None
        if self.n_held:
            for source in self.sources:
                if source.held is not None and (first is None or source.held.received < first.held.received):
                    first = source
        return first

    cdef Payload _release(self, Source source):
        cdef Payload payload = source.held
        source.held = None
        self.n_held -= 1
        return payload

    cdef int _hold(self, Source source) except -1:
        if not source.pending:
            return 0
        try:
            source.held = source._take()
        except Exception as error:
            self.failed[source] = error
            return 0
        if source.held is not None:
            self.n_held += 1
        return 0

    cdef int _hand_on(self, Source source, Payload payload, int64_t until) except -1:
        try:
            source._give(payload, until)
        except Exception as error:
            self.failed[source] = error
        return 0

    def wake(self):
        """Have `receive` return. Any thread."""
        sr_wake(self.bell)

    def close(self):
        """Leave the sources that are left."""
        cdef Source source
        for source in list(self.sources):
            self._leave(source)


cdef class Outlet:
    """A publisher that librcl sends through."""

    cdef readonly object topic
    cdef public uint64_t sent
    cdef Librcl librcl
    cdef object owner
    cdef const void * publisher

    def __init__(self, Librcl librcl, publisher):
        self.librcl, self.owner, self.topic = librcl, publisher, publisher.topic_name
        self.publisher = <const void *><uintptr_t>publisher.handle.pointer

    cdef int _send(self, Payload payload) except -1:
        return self._publish(payload.message)

    cdef int _publish(self, const SerializedMessage * message) except -1:
        cdef int code
        with nogil:
            code = self.librcl.publish(self.publisher, message, NULL)
        if code:
            try:
                self.librcl.require(code, "rcl_publish_serialized_message")
            except RclCallError as error:
                raise PublishError(str(error)) from error
        self.sent += 1
        return 0

    cdef int _send_stamped(self, Payload payload, object stamp) except -1:
        cdef uint8_t * place = payload.message.buffer
        cdef uint8_t own[8]
        if payload.message.length < 12 or place[0] or place[1] not in (0, 1, 6, 7):
            raise ValueError("the payload has no stamp to patch")
        seconds, nanoseconds = divmod(stamp, SECOND)
        if not -(2**31) <= seconds < 2**31:
            raise ValueError(f"a stamp of {stamp} ns does not fit builtin_interfaces/Time")
        memcpy(own, place + 4, 8)
        _write(place + 4, <uint32_t><int32_t>seconds, <uint32_t>nanoseconds, place[1] & 1)
        try:
            self._send(payload)
        finally:
            memcpy(place + 4, own, 8)
        return 0

    def send(self, Payload payload):
        """Publish a payload unchanged. Raises PublishError."""
        self._send(payload)

    def send_stamped(self, Payload payload, stamp):
        """Publish a payload with this stamp, and put its own back: another set may hold it too."""
        self._send_stamped(payload, stamp)

    def send_content(self, bytes content):
        """Publish a message that was serialized here. Raises PublishError."""
        cdef SerializedMessage message
        message.buffer, message.length = <uint8_t *><char *>content, len(content)
        message.capacity, message.allocator = message.length, self.librcl.allocator
        self._publish(&message)


cdef void _write(uint8_t * place, uint32_t seconds, uint32_t nanoseconds, bint is_little) noexcept nogil:
    cdef int n, shift
    for n in range(4):
        shift = 8 * n if is_little else 24 - 8 * n
        place[n] = <uint8_t>(seconds >> shift)
        place[4 + n] = <uint8_t>(nanoseconds >> shift)


cdef uint32_t _number(const uint8_t * place, bint is_little) noexcept nogil:
    if is_little:
        return place[0] | <uint32_t>place[1] << 8 | <uint32_t>place[2] << 16 | <uint32_t>place[3] << 24
    return place[3] | <uint32_t>place[2] << 8 | <uint32_t>place[1] << 16 | <uint32_t>place[0] << 24


cdef bint read_stamp(const uint8_t * content, size_t length, int64_t * stamp) noexcept nogil:
    """As cdr.read_stamp; whether there is one."""
    if length < 12 or content[0] or content[1] not in (0, 1, 6, 7):
        return False
    cdef int32_t seconds = <int32_t>_number(content + 4, content[1] & 1)
    cdef uint32_t nanoseconds = _number(content + 8, content[1] & 1)
    stamp[0] = seconds * SECOND + nanoseconds
    return nanoseconds < SECOND


def stamp_of(bytes content):
    """Return the stamp of a payload, or None; for tests."""
    cdef int64_t stamp
    return stamp if read_stamp(content, len(content), &stamp) else None


@cython.final
cdef class Deliver:
    """What takes an input's payloads that begin with a Header; what it raises goes to `fail`."""

    cdef Flow flow
    cdef Py_ssize_t index
    cdef object fail

    def __call__(self, Payload payload):
        self.give(payload)

    cdef int give(self, Payload payload) except -1:
        cdef int64_t stamp
        try:
            if read_stamp(payload.message.buffer, payload.message.length, &stamp):
                self.flow.take(self.index, payload, stamp, payload.received)
            else:
                self.flow.reject(self.index, payload)
        except Exception as error:
            self.fail(error)
        return 0


include "lent.pxi"
include "searched.pxi"

cdef enum:
    # So many sets leave before an engine is asked again that had to match itself.
    SETS_UNTIL_ASKED = 8


cdef class Flow:
    """As dataflow.flow.Flow, and forms sets itself while an engine lends and nobody wants more of them."""

    cdef public object manifests, bundle
    cdef public list outlets, restamped, keys
    cdef readonly int64_t n_sets
    cdef readonly dict unpublished
    cdef object _engine, _config, _now, _refusals, _tape, _last, _watched, _note_left, _note_set
    cdef list _note_arrival
    cdef Lent _lent
    cdef int _sets_until_asked

    def __init__(self, config, *, now, refusals, tape):
        n_inputs = len(config.topics)
        self.manifests, self.bundle, self.n_sets = None, None, 0
        self._config, self._tape = config, tape
        self._refusals, self.unpublished = refusals, refusals.unpublished
        self.outlets, self.restamped, self.keys = [None] * n_inputs, [False] * n_inputs, [None] * n_inputs
        self._last = deque(maxlen=RECENT)
        self._note_left = self._last.append
        self._now = None if now is time.monotonic_ns else now
        self._watch()
        self.engine = config.engine()

    @property
    def engine(self):
        if self._lent is not None:
            self._take_back(self._lent.sets_until_asked())
        return self._engine

    @engine.setter
    def engine(self, engine):
        self._take_back(0)
        self._engine, self._lent, self._sets_until_asked = engine, None, 0
        if isinstance(engine, SyncGroup):
            if engine.at_once is not None:
                self._lent = AtOnce(len(self.outlets), engine.at_once)
            elif engine.search_terms is not None:
                self._lent = Searched(len(self.outlets), engine.search_terms)

    @property
    def last(self):
        self._tell()
        return self._last

    def watched(self):
        """Give what came and left since this was last asked for."""
        self._tell()
        watched = self._watched
        self._watch()
        return watched

    def _watch(self):
        self._watched = Watched.none_of(len(self.outlets))
        self._note_arrival = [arrivals.append for arrivals in self._watched.arrivals]
        self._note_set = self._watched.sets.append

    def by_header(self, index, fail):
        """What takes an input's payloads that begin with a Header."""
        cdef Deliver deliver = Deliver.__new__(Deliver)
        deliver.flow, deliver.index, deliver.fail = self, index, fail
        return deliver

    def receive(self, Py_ssize_t index, payload, stamp, key=None, frame=None):
        """Take in a message of one input, whose stamp, in nanoseconds, is None where it or the key cannot be read."""
        if stamp is None:
            self.reject(index, payload)
        elif key is None and frame is None and 0 <= stamp <= INT64_MAX:
            self.take(index, payload, stamp, payload.received)
        else:
            self.feed(index, payload, stamp, key, frame)

    cdef int take(self, Py_ssize_t index, object payload, int64_t stamp, int64_t received) except -1:
        """Take in a message that has no key and no frame."""
        cdef Lent lent = self._lent
        if lent is None or (not lent.is_lent and (self._sets_until_asked or not self._borrow())):
            return self.feed(index, payload, stamp, None, None)
        if not lent.fits(index, stamp) or (lent.may_leave(index) and self._is_told_of()):
            return self.feed(index, payload, stamp, None, None)
        if lent.is_full():
            self._tell()
        cdef Py_ssize_t n_left = lent.n_left
        lent.take(index, payload, stamp, received)
        if lent.whole:
            self._leave(n_left)
        return 0

    cdef bint _borrow(self) except -1:
        """Ask the engine to lend; whether it does."""
        if not self._is_told_of() and self._lent.begin(self._engine):
            return True
        self._sets_until_asked = SETS_UNTIL_ASKED
        return False

    cdef bint _is_told_of(self) except -1:
        """Whether more is to be done of a set than to publish its messages."""
        return self._tape.is_on or (self.manifests is not None and self.manifests.is_heard)

    cdef int _leave(self, Py_ssize_t at) except -1:
        """Publish the sets among what left, from there on."""
        cdef Lent lent = self._lent
        cdef Left * last
        cdef Py_ssize_t index, n = 0
        payloads, lent.whole = lent.whole, []
        while at < lent.n_left:
            if lent.left[at].way != WHOLE:
                at += 1
                continue
            if self.bundle is not None:
                messages = [
                    Message(index, lent.left[at + index].stamp, payloads[n + index]) for index in range(lent.n_inputs)
                ]
                self.bundle.send(Match(tuple(messages)), self.n_sets + 1)
                del messages
            for index in range(lent.n_inputs):
                payload, payloads[n] = payloads[n], None
                self._publish(index, payload, None)
                n += 1
            at += lent.n_inputs
            last = &lent.left[at - 1]
            last.way, last.time = SENT, sr_clock(CLOCK_REALTIME) - last.time
            self.n_sets += 1
        return 0

    cdef int _tell(self) except -1:
        """Have objects of Python tell of what came and left while the engine lent."""
        cdef Lent lent = self._lent
        cdef Py_ssize_t at = 0, n
        cdef Left * last
        if lent is None:
            return 0
        for n in range(lent.n_came):
            self._note_arrival[lent.came[n].index]((lent.came[n].stamp, lent.came[n].received))
        while at < lent.n_left:
            last = &lent.left[at]
            if last.way in (SUPERSEDED, TOO_FAR):
                self._note_left(RecentDrop(last.index, last.stamp, _REASONS[last.way]))
                at += 1
                continue
            told = tuple([lent.left[n].stamp for n in range(at, at + lent.n_inputs)])
            at += lent.n_inputs
            last = &lent.left[at - 1]
            # What could not be published has stopped the group.
            if last.way == SENT:
                self._note_set((told, last.time))
                self._note_left(told)
        lent.n_came = lent.n_left = 0
        return 0

    cdef int _take_back(self, int sets_until_asked) except -1:
        """Have the engine match, and ask it again after so many sets."""
        if self._lent is not None and self._lent.is_lent:
            self._sets_until_asked = sets_until_asked
            self._tell()
            self._lent.end(self._engine)
        return 0

    cdef int reject(self, Py_ssize_t index, object payload) except -1:
        self.conclude((self.engine.reject(Message(index, 0, payload), DropReason.MALFORMED),))
        return 0

    cdef int feed(self, Py_ssize_t index, object payload, object stamp, object key, object frame) except -1:
        self._take_back(SETS_UNTIL_ASKED)
        cdef object now = sr_clock(CLOCK_MONOTONIC) if self._now is None else self._now()
        self._note_arrival[index]((stamp, payload.received))
        if key is not None:
            self.keys[index] = key
        outcomes = self._engine.add(Message(index, stamp, payload, key, frame), now=now)
        if outcomes:
            self.conclude(outcomes)
        return 0

    cpdef conclude(self, outcomes):
        """Publish the sets among these, and note what left."""
        cdef object latency
        cdef int64_t left
        cdef bint is_tapped = self._tape.is_on
        for outcome in outcomes:
            if isinstance(outcome, Match):
                newest = self._send(outcome)
                stamps = tuple([None if message is None else message.stamp for message in outcome.messages])
                left = sr_clock(CLOCK_REALTIME)
                latency = left - newest
                self._note_set((stamps, latency))
                self._note_left(stamps)
                self.n_sets += 1
                if self._sets_until_asked:
                    self._sets_until_asked -= 1
                if self.manifests is not None:
                    self.manifests.tell(self, outcome, latency)
                if is_tapped:
                    self._tape.note(self._config, stamps, left, newest)
            else:
                message = outcome.message
                drop = RecentDrop(message.input, message.stamp, outcome.reason)
                self._note_left(drop)
                if is_tapped:
                    self._tape.note(self._config, drop, sr_clock(CLOCK_REALTIME), message.payload.received)

    cdef object _send(self, match):
        """Publish a set; when its newest message was received."""
        if self.bundle is not None:
            self.bundle.send(match, self.n_sets + 1)
        newest = 0
        common = match.stamp
        for message in match.messages:
            if message is None:
                continue
            index, payload = message.input, message.payload
            newest = max(newest, payload.received)
            self._publish(index, payload, common)
        return newest

    cdef int _publish(self, Py_ssize_t index, object payload, object common) except -1:
        outlet = self.outlets[index]
        if outlet is None:
            return 0
        try:
            if common is not None and self.restamped[index]:
                outlet.send_stamped(payload, common)
            elif isinstance(outlet, Outlet):
                (<Outlet>outlet)._send(payload)
            else:
                outlet.send(payload)
        except PublishError as error:
            self._refusals.refused(index, outlet, str(error))
        else:
            if self.unpublished:
                self._refusals.accepted(index, outlet)
        return 0
