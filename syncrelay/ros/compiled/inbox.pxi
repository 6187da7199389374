"""The way in: subscriptions that are drained, and the wait for what DDS reports."""

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
