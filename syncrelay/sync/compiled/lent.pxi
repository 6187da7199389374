"""Sets formed in arrays, in place of an engine that lends its messages; see SyncGroup.lend and lend_search.

Included where messages come from: there `received_of` says when a payload was received.

Code that runs once in some milliseconds finds nothing in the processor's caches, so it costs by how much memory it
touches. Here a message is a row in an array, and becomes objects of Python when somebody asks what came and left.
"""

cdef extern from *:
    """
    /* Products of stamps and the scale of an age penalty. */
    typedef __int128 sr_wide;

    static sr_wide sr_floor(sr_wide number, sr_wide by)
    {
      return number / by - (number % by < 0);
    }
    """
    ctypedef long long sr_wide
    sr_wide sr_floor(sr_wide number, sr_wide by) noexcept nogil

cdef enum:
    ROWS = 1024
    # As ApproximateTime's _STEPS.
    STEPS = 8

# How a message left: in a set that is still to be published, in one that was, or without.
cdef enum:
    WHOLE
    SENT
    SUPERSEDED
    TOO_FAR
    WAYS

assert ROWS == MOST_LENT

cdef int64_t LARGEST = LARGEST_NS

_REASONS = (None, None, DropReason.SUPERSEDED, DropReason.TOO_FAR)

ctypedef struct Came:
    Py_ssize_t index
    int64_t stamp
    int64_t received

# A set is as many of these as there are inputs. The last has when its newest message was received until it is
# published, and its latency afterwards. What left without a set has when it was received itself.
ctypedef struct Left:
    int way
    Py_ssize_t index
    int64_t stamp
    int64_t time


cdef class Lent:
    """What an engine lends, and what came and left since this was last told."""

    cdef Py_ssize_t n_inputs, n_came, n_left
    cdef bint is_lent
    cdef Came * came
    cdef Left * left
    # The payloads of the sets that are whole, input by input.
    cdef list whole

    def __cinit__(self, Py_ssize_t n_inputs, *_):
        self.n_inputs = n_inputs
        self.came = <Came *>calloc(ROWS, sizeof(Came))
        # What was held may all leave with one message.
        self.left = <Left *>calloc(2 * ROWS + n_inputs, sizeof(Left))
        if self.came == NULL or self.left == NULL:
            raise MemoryError
        self.whole = []

    def __dealloc__(self):
        free(self.came)
        free(self.left)

    cdef bint begin(self, object engine) except -1:
        """Ask the engine to lend; whether it does."""
        raise NotImplementedError

    cdef bint fits(self, Py_ssize_t index, int64_t stamp) noexcept:
        """Whether a message is to be taken here."""
        return False

    cdef bint may_leave(self, Py_ssize_t index) noexcept:
        """Whether sets may leave with a message of this input."""
        return False

    cdef int take(self, Py_ssize_t index, object payload, int64_t stamp, int64_t received) except -1:
        """Take a message that fits."""
        raise NotImplementedError

    cdef int end(self, object engine) except -1:
        """Give the engine back what it lent."""
        raise NotImplementedError

    cdef int sets_until_asked(self) noexcept:
        """After how many sets the engine may lend again, if it gets back now what it lent."""
        return 0

    cdef bint is_full(self) noexcept:
        return self.n_came == ROWS or self.n_left >= ROWS

    cdef void note_came(self, Py_ssize_t index, int64_t stamp, int64_t received) noexcept:
        cdef Came * row = &self.came[self.n_came]
        row.index, row.stamp, row.received = index, stamp, received
        self.n_came += 1

    cdef void note_left(self, int way, Py_ssize_t index, int64_t stamp, int64_t time) noexcept:
        cdef Left * row = &self.left[self.n_left]
        row.way, row.index, row.stamp, row.time = way, index, stamp, time
        self.n_left += 1


@cython.final
cdef class AtOnce(Lent):
    """Sets of the first messages of all inputs, which leave with the last of them."""

    cdef Py_ssize_t n_held
    cdef int64_t span, least, greatest, received, n_sets
    cdef int64_t * newest
    # The messages that are in no set, and in which order they came.
    cdef int64_t * stamps
    cdef Py_ssize_t * order
    cdef list payloads

    def __init__(self, Py_ssize_t n_inputs, span):
        self.span = min(span, INT64_MAX)
        self.newest = <int64_t *>calloc(n_inputs, sizeof(int64_t))
        self.stamps = <int64_t *>calloc(n_inputs, sizeof(int64_t))
        self.order = <Py_ssize_t *>calloc(n_inputs, sizeof(Py_ssize_t))
        if self.newest == NULL or self.stamps == NULL or self.order == NULL:
            raise MemoryError
        self.payloads = [None] * n_inputs

    def __dealloc__(self):
        free(self.newest)
        free(self.stamps)
        free(self.order)

    cdef bint begin(self, object engine) except -1:
        cdef Py_ssize_t n
        newest = engine.lend()
        if newest is None:
            return False
        for n in range(self.n_inputs):
            # What a field gives as a stamp may be any number.
            self.newest[n] = min(newest[n], INT64_MAX)
        self.n_sets, self.is_lent = 0, True
        return True

    cdef bint fits(self, Py_ssize_t index, int64_t stamp) noexcept:
        if stamp <= self.newest[index] or self.payloads[index] is not None:
            return False
        return not self.n_held or max(self.greatest, stamp) - min(self.least, stamp) <= self.span

    cdef bint may_leave(self, Py_ssize_t index) noexcept:
        return self.n_held + 1 == self.n_inputs

    cdef int sets_until_asked(self) noexcept:
        return 1 if self.n_held else 0

    cdef int take(self, Py_ssize_t index, object payload, int64_t stamp, int64_t received) except -1:
        self.note_came(index, stamp, received)
        self.payloads[index], self.stamps[index], self.order[self.n_held] = payload, stamp, index
        self.least = min(self.least, stamp) if self.n_held else stamp
        self.greatest = max(self.greatest, stamp) if self.n_held else stamp
        self.received = max(self.received, received) if self.n_held else received
        self.n_held += 1
        if self.n_held < self.n_inputs:
            return 0
        for index in range(self.n_inputs):
            self.newest[index] = self.stamps[index]
            self.note_left(WHOLE, index, self.stamps[index], self.received)
            self.whole.append(self.payloads[index])
            self.payloads[index] = None
        self.n_sets += 1
        self.n_held = 0
        return 0

    cdef int end(self, object engine) except -1:
        cdef Py_ssize_t n, index
        engine.take_back(self.n_sets, [self.newest[n] for n in range(self.n_inputs)])
        held = [self.order[n] for n in range(self.n_held)]
        payloads, self.payloads = self.payloads, [None] * self.n_inputs
        self.is_lent, self.n_held = False, 0
        for index in held:
            engine.add(Message(index, self.stamps[index], payloads[index]), now=0)
        return 0
