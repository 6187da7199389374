"""What counts as left in shared memory by the processes of a test."""

import mmap
import secrets
from pathlib import Path

from tests.ros.shared_memory import left_of


def test_what_a_living_process_has_mapped_is_not_left(ros_domain):
    segment = Path("/dev/shm") / f"fastrtps_{secrets.token_hex(8)}"  # noqa: S108
    segment.write_bytes(bytes(mmap.PAGESIZE))
    try:
        with segment.open("r+b") as file, mmap.mmap(file.fileno(), 0):
            assert left_of(ros_domain, {segment}) == set()
        assert left_of(ros_domain, {segment}) == {segment}
    finally:
        segment.unlink()
