"""The search of approximate_time in arrays; the words are those of ApproximateTime."""

# The queue of an input, and what was done with its messages.
ctypedef struct Queue:
    int64_t * stamps
    int64_t * received
    Py_ssize_t length, cursor
    int64_t newest, given, least_period, fed
    int64_t dropped[WAYS]
    # The way in which the first was dropped.
    int first

ctypedef struct Head:
    int64_t stamp
    Py_ssize_t place


@cython.final
cdef class Searched(Lent):
    """The search of approximate_time, as ApproximateTime has it, but for what is rare: the engine does that."""

    cdef Py_ssize_t queue_size, n_heads, pivot
    cdef int64_t slop, numerator, denominator, n_sets
    cdef int64_t pivot_stamp, start, end_of_it, proof_end
    cdef Queue * queues
    cdef list payloads
    cdef Head * heads
    cdef Head * ahead

    def __init__(self, Py_ssize_t n_inputs, terms):
        cdef Py_ssize_t place
        self.queue_size, self.slop = terms.queue_size, min(terms.slop_ns, INT64_MAX)
        self.numerator, self.denominator = terms.scale
        self.queues = <Queue *>calloc(n_inputs, sizeof(Queue))
        self.heads = <Head *>calloc(2 * n_inputs + 1, sizeof(Head))
        if self.queues == NULL or self.heads == NULL:
            raise MemoryError
        self.ahead = self.heads + n_inputs
        self.payloads = [[] for _ in range(n_inputs)]
        for place in range(n_inputs):
            self.queues[place].least_period = terms.min_periods_ns[place]
            self.queues[place].stamps = <int64_t *>calloc(2 * self.queue_size, sizeof(int64_t))
            if self.queues[place].stamps == NULL:
                raise MemoryError
            self.queues[place].received = self.queues[place].stamps + self.queue_size

    def __dealloc__(self):
        cdef Py_ssize_t place
        if self.queues != NULL:
            for place in range(self.n_inputs):
                free(self.queues[place].stamps)
        free(self.queues)
        free(self.heads)

    cdef bint begin(self, object engine) except -1:
        cdef Py_ssize_t place, n
        cdef Queue * queue
        search = engine.lend_search()
        if search is None:
            return False
        self.n_heads = 0
        for place in range(self.n_inputs):
            queue, messages = &self.queues[place], search.queues[place]
            queue.newest, queue.given = min(search.newest[place], INT64_MAX), -INT64_MAX
            queue.fed = queue.dropped[SUPERSEDED] = queue.dropped[TOO_FAR] = 0
            queue.first = SUPERSEDED
            queue.length, queue.cursor = len(messages), search.cursors[place]
            self.payloads[place] = [message.payload for message in messages]
            for n, message in enumerate(messages):
                queue.stamps[n], queue.received[n] = message.stamp, received_of(message.payload)
            self._add_head(place)
        self.pivot = -1
        if search.candidate is not None:
            self.pivot, self.pivot_stamp, self.start, self.end_of_it, self.proof_end = search.candidate
        self.n_sets, self.is_lent = 0, True
        return True

    cdef int end(self, object engine) except -1:
        cdef Py_ssize_t place, n
        cdef Queue * queue
        self.is_lent = False
        queues, inputs = [], []
        for place in range(self.n_inputs):
            queue, payloads = &self.queues[place], self.payloads[place]
            queues.append([Message(place, queue.stamps[n], payloads[n]) for n in range(queue.length)])
            ways = (queue.first, SUPERSEDED + TOO_FAR - queue.first)
            dropped = {_REASONS[n]: queue.dropped[n] for n in ways if queue.dropped[n]}
            inputs.append(Fed(queue.fed, dropped, queue.given))
            self.payloads[place] = []
        cursors = [self.queues[place].cursor for place in range(self.n_inputs)]
        candidate = (self.pivot, self.pivot_stamp, self.start, self.end_of_it, self.proof_end)
        newest = [self.queues[place].newest for place in range(self.n_inputs)]
        search = Search(queues, cursors, newest, None if self.pivot < 0 else candidate)
        engine.take_back_search(search, self.n_sets, inputs)
        return 0

    cdef bint fits(self, Py_ssize_t index, int64_t stamp) noexcept:
        cdef Queue * queue = &self.queues[index]
        return queue.newest < stamp < LARGEST and queue.length < self.queue_size

    cdef bint may_leave(self, Py_ssize_t index) noexcept:
        return self.n_heads + 1 == self.n_inputs and self.queues[index].cursor == self.queues[index].length

    cdef int take(self, Py_ssize_t index, object payload, int64_t stamp, int64_t received) except -1:
        cdef Queue * queue = &self.queues[index]
        self.note_came(index, stamp, received)
        (<list>self.payloads[index]).append(payload)
        queue.stamps[queue.length], queue.received[queue.length] = stamp, received
        queue.length += 1
        queue.newest = stamp
        queue.fed += 1
        if queue.cursor == queue.length - 1:
            self._add_head(index)
            self._search()
        return 0

    cdef int _search(self) except -1:
        cdef Head first
        cdef Queue * queue
        cdef int64_t end, later_end, later_start
        cdef int steps = 0
        while self.n_heads == self.n_inputs:
            steps += 1
            if steps > STEPS:
                self._stride()
            first, end = self.heads[0], self.heads[self.n_heads - 1].stamp
            if self.pivot < 0:
                if end - first.stamp > self.slop:
                    self._drop_heads(first.place, min(self.heads[1].stamp, end - self.slop))
                    continue
                self.pivot, self.pivot_stamp = self.heads[self.n_heads - 1].place, end
                self._take_candidate(first.stamp, end)
            else:
                later_end, later_start = end - self.end_of_it, first.stamp - self.start
                if later_end < later_start and (
                    <sr_wide>later_end * self.numerator < <sr_wide>later_start * self.denominator
                ):
                    self._drop_skipped()
                    self._take_candidate(first.stamp, end)
            queue = &self.queues[first.place]
            queue.cursor += 1
            self._remove_head(first.place)
            self._add_head(first.place)
            if (
                first.place == self.pivot
                or end >= self.proof_end
                or (queue.cursor == queue.length and self._is_proved(first.place))
            ):
                self._emit()
        return 0

    cdef void _add_head(self, Py_ssize_t place) noexcept:
        """Put the head of an input, if it has one, in its place among the others: by stamp, then by input."""
        cdef Queue * queue = &self.queues[place]
        if queue.cursor < queue.length:
            self.n_heads = _insert(self.heads, self.n_heads, queue.stamps[queue.cursor], place)

    cdef void _remove_head(self, Py_ssize_t place) noexcept:
        cdef Py_ssize_t n = 0
        while self.heads[n].place != place:
            n += 1
        self.n_heads -= 1
        memmove(&self.heads[n], &self.heads[n + 1], (self.n_heads - n) * sizeof(Head))

    cdef void _take_candidate(self, int64_t start, int64_t end) noexcept:
        cdef sr_wide before = <sr_wide>(start - self.pivot_stamp) * self.denominator
        self.start, self.end_of_it = start, end
        self.proof_end = end - <int64_t>sr_floor(before, self.numerator)

    cdef int _drop_heads(self, Py_ssize_t place, int64_t before) except -1:
        """Drop the head of an input, and those behind it that are older than `before`, while there is no candidate."""
        cdef Queue * queue = &self.queues[place]
        cdef Py_ssize_t count = 1
        while count < queue.length and queue.stamps[count] < before:
            count += 1
        self._remove_head(place)
        self._drop(place, count, TOO_FAR)
        self._add_head(place)
        return 0

    cdef int _stride(self) except -1:
        """Pass at once what single steps would pass: they would drop the same, in another order."""
        cdef int64_t end = self.heads[self.n_heads - 1].stamp
        cdef int64_t target = end - self.slop if self.pivot < 0 else self.pivot_stamp
        cdef Py_ssize_t n, at
        cdef Queue * queue
        if self.pivot >= 0 and end >= self.proof_end:
            return 0
        for n in range(self.n_inputs):
            queue = &self.queues[n]
            at = queue.length - 1
            while self.pivot >= 0 and queue.stamps[at] > end:
                at -= 1
            target = min(target, queue.stamps[at])
        memcpy(self.ahead, self.heads, self.n_heads * sizeof(Head))
        for n in range(self.n_inputs):
            if self.ahead[n].stamp >= target:
                continue
            if self.pivot < 0:
                self._drop_heads(self.ahead[n].place, target)
                continue
            queue = &self.queues[self.ahead[n].place]
            while queue.stamps[queue.cursor] < target:
                queue.cursor += 1
            self._remove_head(self.ahead[n].place)
            self._add_head(self.ahead[n].place)
        return 0

    cdef int _drop_skipped(self) except -1:
        cdef Py_ssize_t place
        for place in range(self.n_inputs):
            if self.queues[place].cursor:
                self._drop(place, self.queues[place].cursor, SUPERSEDED)
                self.queues[place].cursor = 0
        return 0

    cdef int _drop(self, Py_ssize_t place, Py_ssize_t count, int way) except -1:
        cdef Queue * queue = &self.queues[place]
        cdef Py_ssize_t n
        for n in range(count):
            self.note_left(way, place, queue.stamps[n], queue.received[n])
        if not queue.dropped[SUPERSEDED] + queue.dropped[TOO_FAR]:
            queue.first = way
        queue.dropped[way] += count
        self._shift(place, count)
        return 0

    cdef int _shift(self, Py_ssize_t place, Py_ssize_t count) except -1:
        """Take the oldest messages out of a queue."""
        cdef Queue * queue = &self.queues[place]
        queue.length -= count
        memmove(queue.stamps, queue.stamps + count, queue.length * sizeof(int64_t))
        memmove(queue.received, queue.received + count, queue.length * sizeof(int64_t))
        del (<list>self.payloads[place])[:count]
        return 0

    cdef int _emit(self) except -1:
        cdef Queue * queue
        cdef Py_ssize_t place
        cdef int64_t received = 0
        for place in range(self.n_inputs):
            received = max(received, self.queues[place].received[0])
        self.n_heads = 0
        self.pivot = -1
        for place in range(self.n_inputs):
            queue = &self.queues[place]
            self.note_left(WHOLE, place, queue.stamps[0], received)
            self.whole.append((<list>self.payloads[place])[0])
            queue.given, queue.cursor = queue.stamps[0], 0
            self._shift(place, 1)
            self._add_head(place)
        self.n_sets += 1
        return 0

    cdef bint _is_proved(self, Py_ssize_t awaited) noexcept:
        """Whether no later message can make a better set than the candidate; `awaited` has no head yet."""
        cdef Py_ssize_t n, place, n_ahead = 0
        cdef int64_t end
        cdef sr_wide reach
        cdef Queue * queue
        memcpy(self.ahead, self.heads, self.n_heads * sizeof(Head))
        n_ahead = _insert(self.ahead, self.n_heads, self._bound(awaited), awaited)
        while True:
            end = self.ahead[n_ahead - 1].stamp
            if end >= self.proof_end:
                return True
            reach = self.start + sr_floor(<sr_wide>(end - self.end_of_it) * self.numerator, self.denominator)
            if self.ahead[0].stamp > reach:
                return False
            # The earliest head that can be passed is; it comes back behind those that cannot.
            place = self.ahead[0].place
            queue = &self.queues[place]
            n = queue.cursor
            while n < queue.length and queue.stamps[n] <= reach:
                n += 1
            n_ahead -= 1
            memmove(self.ahead, self.ahead + 1, n_ahead * sizeof(Head))
            end = queue.stamps[n] if n < queue.length else self._bound(place)
            n_ahead = _insert(self.ahead, n_ahead, end, place)

    cdef int64_t _bound(self, Py_ssize_t place) noexcept:
        """The least stamp that the next message of an input can have, but at least the pivot's."""
        cdef Queue * queue = &self.queues[place]
        return max(queue.stamps[queue.length - 1] + queue.least_period, self.pivot_stamp)


cdef Py_ssize_t _insert(Head * heads, Py_ssize_t count, int64_t stamp, Py_ssize_t place) noexcept:
    """Put a head in its place among others; how many there are then."""
    cdef Py_ssize_t n = count
    while n and (heads[n - 1].stamp > stamp or (heads[n - 1].stamp == stamp and heads[n - 1].place > place)):
        heads[n] = heads[n - 1]
        n -= 1
    heads[n].stamp, heads[n].place = stamp, place
    return count + 1
