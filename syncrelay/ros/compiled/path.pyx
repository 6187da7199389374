# cython: language_level=3
"""A stub, in the place of the compiled path: it is here so that the build can be tried."""

cdef extern from *:
    """
    #ifndef SYNCRELAY_SOURCE
    #define SYNCRELAY_SOURCE ""
    #endif
    """
    const char* SYNCRELAY_SOURCE

SOURCE = SYNCRELAY_SOURCE.decode()


def answer():
    return 42
