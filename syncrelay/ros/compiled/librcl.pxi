"""librcl's functions and structures, and the memories of the messages that it fills."""

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

# setup.py's fingerprint of these files.
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
