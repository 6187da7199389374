# cython: language_level=3, boundscheck=False, wraparound=False
"""Messages in columns, matched while an engine lends; see lent.pxi. Their payload is the time when they were received."""

from syncrelay.sync.lending import LARGEST_NS, MOST_LENT, Fed, Search
from syncrelay.sync.messages import DropReason, Message

cimport cython
from cpython cimport array
from libc.stdint cimport INT64_MAX, int64_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy, memmove


cdef extern from *:
    const char * SYNCRELAY_SOURCE

# setup.py's fingerprint of these files.
SOURCE = SYNCRELAY_SOURCE.decode()


cdef inline object received_of(object payload):
    return payload


include "lent.pxi"
include "searched.pxi"

cdef int64_t[WAYS] NUMBERS
for _way, _reason in enumerate(_REASONS):
    NUMBERS[_way] = -1 if _reason is None else [*DropReason].index(_reason)


def feed(
    engine,
    const int64_t[::1] inputs,
    const int64_t[::1] stamps,
    const int64_t[::1] received,
    Py_ssize_t at,
    array.array sets,
    array.array drops,
    int64_t no_tick,
):
    """Feed messages from `at` on as far as the engine lends; return the place of the first that is for the engine.

    What leaves is added to `sets` (the stamps of a set, `no_tick`, when it left, its latency) and to `drops` (input,
    stamp, time of receipt, number of the reason).
    """
    cdef Lent lent
    cdef Py_ssize_t n_inputs = len(engine.counts())
    if engine.at_once is not None:
        lent = AtOnce(n_inputs, engine.at_once)
    elif engine.search_terms is not None:
        lent = Searched(n_inputs, engine.search_terms)
    else:
        return at
    if not lent.begin(engine):
        return at
    while at < inputs.shape[0] and lent.fits(inputs[at], stamps[at]):
        lent.take(inputs[at], received[at], stamps[at], received[at])
        _tell(lent, received[at], sets, drops, no_tick)
        at += 1
    lent.end(engine)
    return at


cdef int _tell(Lent lent, int64_t now, array.array sets, array.array drops, int64_t no_tick) except -1:
    """Write down what left, at a time."""
    cdef Left * row = lent.left
    cdef Left * end = lent.left + lent.n_left
    cdef Py_ssize_t n
    cdef int64_t[4] numbers
    while row < end:
        if row.way == WHOLE:
            for n in range(lent.n_inputs):
                array.extend_buffer(sets, <char *>&row.stamp, 1)
                row += 1
            numbers = [no_tick, now, now - row[-1].time, 0]
            array.extend_buffer(sets, <char *>numbers, 3)
        else:
            numbers = [row.index, row.stamp, row.time, NUMBERS[row.way]]
            array.extend_buffer(drops, <char *>numbers, 4)
            row += 1
    lent.n_came = lent.n_left = 0
    lent.whole.clear()
    return 0
