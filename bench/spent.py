"""The CPU time of a process by thread, and its instructions where the kernel counts them."""

import contextlib
import ctypes
import math
import os
import struct
from pathlib import Path
from typing import NamedTuple

PURPOSES = ("receive", "DDS listener", "dds.ev", "main", "other")
# include/uapi/linux/perf_event.h: struct perf_event_attr of 64 bytes, its first version.
PERF_TYPE_HARDWARE, PERF_COUNT_HW_INSTRUCTIONS = 0, 1
EXCLUDE_KERNEL, EXCLUDE_HV = 1 << 5, 1 << 6
SYSCALL_NUMBERS = {"x86_64": 298, "aarch64": 241}


class Thread(NamedTuple):
    number: int
    name: str


def threads_ns(pid):
    """The CPU time of each thread of a process so far, in nanoseconds."""
    ran = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        # A thread may end meanwhile.
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            thread = Thread(int(task.name), (task / "comm").read_text().strip())
            ran[thread] = int((task / "schedstat").read_text().split()[0])
    return ran


def by_purpose(ran, pid):
    """Sum the CPU time of threads by their purpose.

    DDS names its threads. Of the others, the busiest takes the messages, be it the main thread or not.
    """
    sums = dict.fromkeys(PURPOSES, 0)
    receiving = max((thread for thread in ran if not thread.name.startswith("dds.")), key=ran.get)
    for thread, ns in ran.items():
        if thread == receiving:
            sums["receive"] += ns
        elif thread.name.startswith(("dds.shm", "dds.udp")):
            sums["DDS listener"] += ns
        elif thread.name.startswith("dds.ev"):
            sums["dds.ev"] += ns
        else:
            sums["main" if thread.number == pid else "other"] += ns
    return sums


class Instructions:
    """Counts the instructions in user space of the threads that a process has now; NaN where the kernel counts none."""

    def __init__(self, pid, kind=(PERF_TYPE_HARDWARE, PERF_COUNT_HW_INSTRUCTIONS)):
        attributes = struct.pack("IIQQQQQIIQ", kind[0], 64, kind[1], 0, 0, 0, EXCLUDE_KERNEL | EXCLUDE_HV, 0, 0, 0)
        number, call = SYSCALL_NUMBERS.get(os.uname().machine), ctypes.CDLL(None).syscall
        threads = [int(task.name) for task in Path(f"/proc/{pid}/task").iterdir()] if number else []
        self._counters = [call(number, attributes, thread, -1, -1, 0) for thread in threads]

    def read(self):
        """Return how many there were so far."""
        if not self._counters or min(self._counters) < 0:
            return math.nan
        return sum(struct.unpack("Q", os.read(counter, 8))[0] for counter in self._counters)
