"""Measures commands on recordings: `python bench/recordings.py` prints CPU time and memory.

Small messages: three inputs of 100, 100 and 200 Hz with jitter, messages of 312 bytes, one group. Images: colours and
depths of 640 x 480 at 30 Hz, beside what reading alone takes with mcap.
"""

import argparse
import heapq
import os
import random
import shutil
import struct
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import PIL.Image

from syncrelay.config.profile import Profile
from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput

MS = 1_000_000
SECOND = 1_000 * MS
TYPE = "sensor_msgs/msg/Imu"
IMAGE = "sensor_msgs/msg/Image"
RATES_HZ = {"/left": 100, "/right": 100, "/imu": 200}
FILE = """version: 1
groups:
  front:
    policy: approximate_time
    slop: 10ms
    topics: [{topic: /left}, {topic: /right}, {topic: /imu}]
"""

IMAGES_FILE = """version: 1
groups:
  front:
    policy: exact_time
    topics: [{topic: /rgb}, {topic: /depth}]
"""
READ = """
import sys
from mcap.reader import make_reader
for _ in make_reader(open(sys.argv[1], "rb")).iter_messages(): pass
"""
EXPORTS = (
    ("--images", "png"),
    ("--images", "/rgb=jpeg"),
    (),
    ("--compression", "none"),
    ("--format", "mcap", "--compression", "none"),
)


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


def record_images(path, count, seed=1):
    """Write a recording of so many pairs of images: soft shapes, and noise as a sensor's."""
    random_numbers = np.random.default_rng(seed)
    rgb, depth = (_image(random_numbers, *kind) for kind in (("rgb8", 3, 0.6, 0), ("16UC1", 1, 60, 500)))
    with McapOutput(path) as recording:
        outputs = [recording.add(topic, IMAGE, *jazzy_definition(IMAGE), Profile()) for topic in ("/rgb", "/depth")]
        for number in range(count):
            stamp = 1_700_000_000 * SECOND + number * SECOND // 30
            header = struct.pack("<4BiI", 0, 1, 0, 0, *divmod(stamp, SECOND))
            for output, (head, pixels) in zip(outputs, (rgb, depth), strict=True):
                recording.write(output, header + head + np.roll(pixels, 7 * number, 1).tobytes(), stamp + 2 * MS)


def _image(random_numbers, encoding, channels, scale, offset):
    """Return what stands between the stamp and the pixels of an Image, and its pixels."""
    small = PIL.Image.fromarray(random_numbers.integers(0, 255, (30, 40, 3), dtype=np.uint8))
    soft = np.asarray(small.resize((640, 480), PIL.Image.Resampling.BICUBIC))[:, :, :channels]
    noisy = np.clip(soft + random_numbers.normal(0, 2, soft.shape), 0, 255) * scale + offset
    pixels = noisy.astype("<u2" if channels == 1 else np.uint8)
    name = encoding.encode() + b"\0"
    text = struct.pack("<I4sIII", 4, b"cam", 480, 640, len(name)) + name + b"\0"
    text += bytes(-len(text) % 4)
    return text + struct.pack("<II", pixels.strides[0], pixels.nbytes), pixels


def measure(*words):
    """Return the CPU seconds that a command of syncrelay takes, and the most memory in MB."""
    return spent("-m", "syncrelay", *words)


def spent(*words):
    started = subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    if started.returncode:
        sys.exit(f"{words} failed")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1000


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--messages", type=int, nargs="+", default=[200_000, 1_000_000])
    parser.add_argument("--images", type=int, default=900, help="pairs of images; 0 for none (default: %(default)s)")
    asked = parser.parse_args()
    print("| command | messages | CPU | messages/s | memory |")
    print("|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        bag, file, sets = (Path(folder, name) for name in ("drive.mcap", "fusion.yaml", "sets.mcap"))
        file.write_text(FILE)
        for count in asked.messages:
            bag.unlink(missing_ok=True)
            record(bag, count)
            for command, more in (("replay", ()), ("replay -o", ("-o", sets)), ("analyze", ())):
                sets.unlink(missing_ok=True)
                seconds, memory = measure(command.split()[0], bag, "--config", file, *more)
                print(f"| `{command}` | {count:,} | {seconds:.1f} s | {count / seconds:,.0f} | {memory:.0f} MB |")
    if asked.images:
        show_images(asked.images)


def show_images(count):
    """Print what exports of so many pairs of images take, and how fast they are beside mcap's reading."""
    with TemporaryDirectory() as folder:
        bag, file, sets = (Path(folder, name) for name in ("drive.mcap", "fusion.yaml", "sets"))
        file.write_text(IMAGES_FILE)
        record_images(bag, count)
        reading, _ = spent("-c", READ, bag)
        print(f"\n{count} pairs of images, {bag.stat().st_size / 1e6:.0f} MB; mcap reads them in {reading:.1f} s")
        print("| export | CPU | of the speed of reading | memory |")
        print("|---|---|---|---|")
        for words in EXPORTS:
            shutil.rmtree(sets, ignore_errors=True)
            seconds, memory = measure("export", bag, "--config", file, "-o", sets, "--jobs", "1", *words)
            name, speed = " ".join(words) or "raw pixels", reading / seconds
            print(f"| `{name}` | {seconds:.1f} s | {speed:.2f} | {memory:.0f} MB |")


if __name__ == "__main__":
    main()
