"""Sets that leave at once, formed in place of an engine that lends its messages; see SyncGroup.lend.

Code that runs once in some milliseconds finds nothing in the processor's caches, so it costs by how much memory it
touches. Here a message is a row in an array, and becomes objects of Python when somebody asks what came and left.
"""

cdef enum:
    ROWS = 1024

# A message that came. While the engine lends, each set is a run of so many rows as there are inputs; the last of them
# has its latency.
ctypedef struct Row:
    Py_ssize_t index
    int64_t stamp
    int64_t received
    int64_t latency

cdef int64_t NOT_LEFT = -INT64_MAX


@cython.final
cdef class Lent:
    """What came while an engine lends: what is in no set yet, and what was not told of yet."""

    cdef Py_ssize_t n_inputs, n_held
    cdef bint is_lent
    cdef int64_t span, least, greatest, n_sets
    cdef int64_t * newest
    cdef list payloads
    cdef Row * rows
    cdef Py_ssize_t n_rows, n_told

    def __cinit__(self, Py_ssize_t n_inputs):
        self.n_inputs = n_inputs
        self.newest = <int64_t *>calloc(n_inputs, sizeof(int64_t))
        self.rows = <Row *>calloc(ROWS + n_inputs, sizeof(Row))
        if self.newest == NULL or self.rows == NULL:
            raise MemoryError
        self.payloads = [None] * n_inputs

    def __dealloc__(self):
        free(self.newest)
        free(self.rows)

    cdef int begin(self, object at_once, object newest) except -1:
        cdef Py_ssize_t n
        for n in range(self.n_inputs):
            # What a field gives as a stamp may be any number.
            self.newest[n] = min(newest[n], INT64_MAX)
        self.span = min(at_once, INT64_MAX)
        self.n_sets, self.is_lent = 0, True
        return 0

    cdef bint fits(self, Py_ssize_t index, int64_t stamp) noexcept:
        """Whether a message may be in the next set."""
        if stamp <= self.newest[index] or self.payloads[index] is not None:
            return False
        return not self.n_held or max(self.greatest, stamp) - min(self.least, stamp) <= self.span

    cdef bint hold(self, Py_ssize_t index, object payload, int64_t stamp, int64_t received) noexcept:
        """Take one that fits; whether the set is whole."""
        cdef Row * row = &self.rows[self.n_rows]
        row.index, row.stamp, row.received, row.latency = index, stamp, received, NOT_LEFT
        self.payloads[index] = payload
        self.least = min(self.least, stamp) if self.n_held else stamp
        self.greatest = max(self.greatest, stamp) if self.n_held else stamp
        self.n_rows += 1
        self.n_held += 1
        return self.n_held == self.n_inputs

    cdef int64_t close(self) noexcept:
        """Count the whole set; when its newest message was received."""
        cdef Row * row
        cdef Py_ssize_t n
        cdef int64_t received = 0
        for n in range(self.n_rows - self.n_inputs, self.n_rows):
            row = &self.rows[n]
            self.newest[row.index] = row.stamp
            received = max(received, row.received)
        self.n_sets += 1
        self.n_held = 0
        return received

    cdef list held(self):
        """The messages that are in no set, in the order in which they came."""
        cdef Row * row
        cdef Py_ssize_t n
        messages = []
        for n in range(self.n_rows - self.n_held, self.n_rows):
            row = &self.rows[n]
            messages.append(Message(row.index, row.stamp, self.payloads[row.index]))
        return messages

    cdef int forget(self) except -1:
        """Forget all that was told of, but for what is in no set."""
        memmove(self.rows, &self.rows[self.n_rows - self.n_held], self.n_held * sizeof(Row))
        self.n_rows = self.n_told = self.n_held
        return 0

    cdef object end(self):
        """Hold nothing more; the newest stamp of each input in a set."""
        self.is_lent = False
        self.n_rows = self.n_told = self.n_held = 0
        self.payloads = [None] * self.n_inputs
        return [self.newest[n] for n in range(self.n_inputs)]
