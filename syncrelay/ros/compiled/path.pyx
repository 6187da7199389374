# cython: language_level=3
"""A STUB in the place of the compiled path: it is here so that the build can be tried."""

cdef extern from *:
    const char * SYNCRELAY_SOURCE  # setup.py's fingerprint of this file

SOURCE = SYNCRELAY_SOURCE.decode()
