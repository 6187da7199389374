"""What a process takes of its machine, as the kernel says."""

from pathlib import Path


def memory_mb(pid: int) -> float:
    """Resident memory, without what is shared with others: DDS's segments belong to nobody alone."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1]) / 1024
    raise ValueError(f"the kernel does not tell the memory of process {pid}")


def descriptors(pid: int) -> int:
    """How many file descriptors are open."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))
