"""What a relayed message costs: `python bench/relay.py` prints tables, with ratios taken in this one run.

Measured as compare.py does. There is no relay in C++ on rclcpp among them: neither PyPI nor Debian has rclcpp.
"""

import argparse
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from candidates import HERE, LOADS, Load, Workshop
from compare import show
from rounds import PATIENCE_S, free_domains, processes, side_by_side
from spent import threads_ns

SMALL = "2 x 200 Hz x 1 kB"
ONE_MB = {"2 x 20 Hz x 1 MB": LOADS["2 x 20 Hz x 1 MB"]}
LARGE_LOADS = {
    "2 x 20 Hz x 1 MB, large_messages": LOADS["2 x 20 Hz x 1 MB"],
    "2 x 20 Hz x 1 MB, default transport": Load("Image", 1_000_000, 20),
    "2 x 20 Hz x 6 MB, large_messages": LOADS["2 x 20 Hz x 6 MB"],
}
# All of 400 messages a second, but for the last two.
SCALES = {
    "1 group of 2 topics": Load("Image", 1_000, 200),
    "10 groups of 2 topics": Load("Image", 1_000, 20, groups=10),
    "50 groups of 2 topics": Load("Image", 1_000, 4, groups=50),
    "1 group of 4 topics": Load("Image", 1_000, 100, topics=4),
    "1 group of 8 topics": Load("Image", 1_000, 50, topics=8),
    "1 group of 16 topics": Load("Image", 1_000, 25, topics=16),
    "2 topics of 1 kHz": Load("Image", 1_000, 1_000),
    "2 topics, each in 10 groups": Load("Image", 1_000, 20, groups=10, shared=True),
}
CHECKOUT = str(HERE.parent)


class Tables:
    """The tables by their names."""

    def __init__(self, workshop, rounds):
        self._workshop, self._rounds = workshop, rounds

    def cost(self):
        words = [CHECKOUT, f"{CHECKOUT}@SYNCRELAY_RECEIVE=rclpy", "typed"]
        try:
            self._workshop.candidate("c", LOADS[SMALL])
            words.insert(0, "c")
        except ValueError as error:
            print(error)
        for load in LOADS:
            # The typed relay cannot keep up with 2,000 messages a second.
            self._compare(load, [word for word in words if (word, load) != ("typed", "2 x 1 kHz x 1 kB")])

    def telling(self):
        for load in (SMALL, "4 x 100 Hz Imu"):
            self._compare(load, [f"{CHECKOUT}@untold", CHECKOUT, f"{CHECKOUT}@scalars", f"{CHECKOUT}@heard"])

    def tapped(self):
        for load in (SMALL, "2 x 1 kHz x 1 kB"):
            self._compare(load, [CHECKOUT, f"{CHECKOUT}@tapped"])

    def bundled(self):
        middle = replace(LOADS["2 x 20 Hz x 1 MB"], size=100_000)
        for name, load in {SMALL: LOADS[SMALL], "2 x 20 Hz x 100 kB": middle, **ONE_MB}.items():
            words = (CHECKOUT, f"{CHECKOUT}@bundled", "c", "c@bundled")
            self._show(name, [self._workshop.candidate(word, load) for word in words])

    def large(self):
        self._loads("large messages", LARGE_LOADS)

    def scale(self):
        self._loads("scale", SCALES)

    def rest(self):
        took_s, cpu_s, _ = self._start_and_idle(Load("Image", 1_000, 1), seconds=1)
        print(f"from the command to both subscriptions: {took_s:.2f} s, of them {cpu_s:.2f} s of CPU")
        _, _, idle_share = self._start_and_idle(Load("Image", 1_000, 1, groups=20), seconds=10)
        print(f"20 groups of 2 topics, subscribed and silent: {idle_share:.1%} of a core")

    def _compare(self, load, words):
        self._show(load, [self._workshop.candidate(word, LOADS[load]) for word in words])

    def _loads(self, title, loads):
        self._show(
            title, [replace(self._workshop.candidate(CHECKOUT, load), name=name) for name, load in loads.items()]
        )

    def _show(self, title, candidates):
        print(f"{title}:", flush=True)
        show(
            [replace(each, name=each.name.replace(CHECKOUT, "syncrelay")) for each in candidates],
            *side_by_side(candidates, most=self._rounds),
        )

    def _start_and_idle(self, load, seconds):
        """Start a relay whose publishers are there, and leave it alone.

        Returns the time and the CPU time until all is subscribed, and the share of a core that it uses then, in s.
        """
        relay = self._workshop.candidate(CHECKOUT, load)
        rig = [sys.executable, str(HERE / "rig.py"), "publish", load.type_name, "--size=0", "--together=1"]
        with processes() as start:
            domain = {"ROS_DOMAIN_ID": str(next(free_domains()))}
            publisher = start([*rig, *load.inputs], {**domain, "PYTHONPATH": CHECKOUT})
            time.sleep(3)
            began = time.monotonic()
            process = start(relay.argv, {**domain, **relay.environ}, relay.folder).process
            publisher.read(PATIENCE_S)
            took_s, cpu_s = time.monotonic() - began, cpu_s_of(process)
            time.sleep(5)
            before = cpu_s_of(process)
            time.sleep(seconds)
            return took_s, cpu_s, (cpu_s_of(process) - before) / seconds


def cpu_s_of(process):
    return sum(threads_ns(process.pid).values()) / 1e9


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=30, help="rounds of a table at most (default: %(default)s)")
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help="cost, telling, tapped, bundled, large, scale or rest (default: all)"
    )
    asked = parser.parse_args()
    print(f"Python {sys.version.split()[0]}, {os.cpu_count()} cores\n")
    with tempfile.TemporaryDirectory() as folder:
        tables = Tables(Workshop(Path(folder)), asked.rounds)
        there = (tables.cost, tables.telling, tables.tapped, tables.bundled, tables.large, tables.scale, tables.rest)
        parts = {each.__name__: each for each in there}
        if unknown := set(asked.parts) - set(parts):
            parser.error(f"no part is called {', '.join(sorted(unknown))}")
        for part in asked.parts or parts:
            parts[part]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
