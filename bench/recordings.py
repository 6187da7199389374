"""Measures commands on a recording of small messages: `python bench/recordings.py` prints CPU time and memory.

Three inputs of 100, 100 and 200 Hz with jitter, messages of 312 bytes, one group.
"""

import argparse
import heapq
import os
import random
import struct
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from syncrelay.config.profile import Profile
from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput

MS = 1_000_000
SECOND = 1_000 * MS
TYPE = "sensor_msgs/msg/Imu"
RATES_HZ = {"/left": 100, "/right": 100, "/imu": 200}
FILE = """version: 1
groups:
  front:
    policy: approximate_time
    slop: 10ms
    topics: [{topic: /left}, {topic: /right}, {topic: /imu}]
"""


def record(path, count, seed=1):
    """Write a recording of so many messages, received 2 ms or a little more after their stamps."""
    rng = random.Random(seed)
    clocks = [(1_700_000_000 * SECOND + rng.randrange(5 * MS), topic) for topic in RATES_HZ]
    received: list[tuple[int, str, int]] = []
    with McapOutput(path) as recording:
        outputs = {topic: recording.add(topic, TYPE, *jazzy_definition(TYPE), Profile()) for topic in RATES_HZ}
        while recording.count < count:
            now, topic = heapq.heappop(clocks)
            heapq.heappush(clocks, (now + SECOND // RATES_HZ[topic], topic))
            stamp = now + round(rng.gauss(0, MS / 2))
            heapq.heappush(received, (stamp + 2 * MS + round(rng.expovariate(1 / MS)), topic, stamp))
            if len(received) > 30:
                at, topic, stamp = heapq.heappop(received)
                header = struct.pack("<4BiI", 0, 1, 0, 0, *divmod(stamp, SECOND))
                recording.write(outputs[topic], header + bytes(300), at)


def measure(*words):
    """Return the CPU seconds that a command takes, and the most memory in MB."""
    started = subprocess.Popen([sys.executable, "-m", "syncrelay", *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode:
        sys.exit(f"{words[0]} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1000


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--messages", type=int, nargs="+", default=[200_000, 1_000_000])
    counts = parser.parse_args().messages
    print("| command | messages | CPU | messages/s | memory |")
    print("|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        bag, file, sets = (Path(folder, name) for name in ("drive.mcap", "fusion.yaml", "sets.mcap"))
        file.write_text(FILE)
        for count in counts:
            bag.unlink(missing_ok=True)
            record(bag, count)
            for command, more in (("replay", ()), ("replay -o", ("-o", sets)), ("analyze", ())):
                sets.unlink(missing_ok=True)
                seconds, memory = measure(command.split()[0], bag, "--config", file, *more)
                print(f"| `{command}` | {count:,} | {seconds:.1f} s | {count / seconds:,.0f} | {memory:.0f} MB |")


if __name__ == "__main__":
    main()
