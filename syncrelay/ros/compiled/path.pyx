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

include "librcl.pxi"
include "inbox.pxi"


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


cdef inline object received_of(object payload):
    return payload.received


include "../../sync/compiled/lent.pxi"
include "../../sync/compiled/searched.pxi"

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
