"""Candidates that are started once and loaded in turns, and what a message cost each of them in each round."""

import contextlib
import json
import random
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from candidates import HERE, clean_environment
from intervals import median_interval, stolen_share, undisturbed
from spent import Instructions, by_purpose, threads_ns

# Fifty processes may have to start on two cores.
PATIENCE_S = 90.0
# The relay looks at its groups once a second. What counts has as many looks as seconds, and the lead gives the first
# one a whole second of messages to look at: what is left to a look is no cheaper than it is.
ROUND_S = 1.0
LEAD_S = 1.0
# By then each of fifty groups has been looked at since the last publisher or subscriber came.
WARM_UP_S = 5.0
MIN_ROUNDS = 10


class Turn(NamedTuple):
    """What a candidate did in a round: CPU of its process a message by thread, and in all; median age of sets."""

    threads_us: Mapping[str, float]
    cpu_us: float
    latency_ms: float
    lost: float
    stolen: float
    instructions: float


class Child:
    """A process that is talked to line by line, and ended."""

    def __init__(self, argv, environ, log, cwd=None):
        self.process = subprocess.Popen(
            argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=environ, cwd=cwd, text=True
        )

    def read(self, patience_s):
        ready, _, _ = select.select([self.process.stdout], [], [], patience_s)
        line = self.process.stdout.readline() if ready else ""
        if not line:
            raise RuntimeError(f"{self.process.args} said nothing")
        return line.rstrip("\n")

    def tell(self, line):
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def end(self):
        """End it by the end of its stdin; if that does not help, by signals."""
        self.process.stdin.close()
        for insist in (self.process.terminate, self.process.kill):
            try:
                self.process.wait(2)
            except subprocess.TimeoutExpired:
                insist()
        self.process.wait()


class Station:
    """A candidate's relay between a publisher and a receiver of its own, on a ROS domain of its own."""

    def __init__(self, candidate, domain, start):
        load = self._load = candidate.load
        environ = {**load.environ, "ROS_DOMAIN_ID": str(domain)}
        rig = [sys.executable, str(HERE / "rig.py")]
        pace = [f"--size={load.size}", f"--rate={load.rate}", f"--apart={load.apart_s}", f"--together={load.topics}"]
        hear = [f"--hear={topic}" for topic in candidate.hear]
        self.relay = start(candidate.argv, {**environ, **candidate.environ}, candidate.folder)
        rig_environ = {**environ, "PYTHONPATH": str(HERE.parent)}
        self._publisher = start([*rig, "publish", load.type_name, *pace, *load.inputs], rig_environ)
        told = [*rig, "receive", load.type_name, f"--together={load.topics}", *hear, *load.outputs]
        self._receiver = start(told, rig_environ)
        self._instructions = None

    def wait_ready(self):
        for child in (self._publisher, self._receiver):
            child.read(PATIENCE_S)

    def turn(self, seconds):
        """Load the relay, and return what a message cost it; raises RuntimeError where a process fails."""
        if self._instructions is None:
            self._instructions = Instructions(self.relay.process.pid)
        counted_from = time.time_ns() + int(LEAD_S * 1e9)
        self._receiver.tell(counted_from)
        self._publisher.tell(json.dumps([counted_from, counted_from + int(seconds * 1e9)]))
        time.sleep(max(0.0, counted_from / 1e9 - time.time()))
        before, instructions, machine = threads_ns(self.relay.process.pid), self._instructions.read(), machine_time()
        due = int(self._publisher.read(seconds + PATIENCE_S)) * len(self._load.outputs) / len(self._load.inputs)
        self._receiver.tell(int(due))
        came, latency_ns = json.loads(self._receiver.read(PATIENCE_S))
        if came == 0:
            raise RuntimeError(f"{self.relay.process.args} relayed nothing")
        ran = {thread: ns - before.get(thread, 0) for thread, ns in threads_ns(self.relay.process.pid).items()}
        return Turn(
            {purpose: ns / came / 1e3 for purpose, ns in by_purpose(ran, self.relay.process.pid).items()},
            sum(ran.values()) / came / 1e3,
            latency_ns / 1e6,
            1 - came / due,
            stolen_share(machine, machine_time()),
            (self._instructions.read() - instructions) / came,
        )


def machine_time():
    with Path("/proc/stat").open() as file:
        return file.readline()


@contextlib.contextmanager
def processes():
    """Yield what starts a process, and end all in the end; what they said is shown where one failed."""
    children = []
    with tempfile.TemporaryDirectory() as name, (Path(name) / "log").open("w+") as log:
        kept = clean_environment() | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOG_DIR": name}

        def start(argv, environ, folder=None):
            children.append(Child(argv, kept | environ, log, folder))
            return children[-1]

        try:
            yield start
        except RuntimeError:
            sys.stderr.write((Path(name) / "log").read_text())
            raise
        finally:
            for child in children:
                child.process.terminate()
            for child in children:
                child.end()


def free_domains():
    """Return domains that nobody uses: the first participant of a domain has a port of its own."""
    taken = {int(line.split()[1].rpartition(":")[2], 16) for line in Path("/proc/net/udp").read_text().splitlines()[1:]}
    free = [domain for domain in range(1, 102) if 7410 + 250 * domain not in taken]
    random.shuffle(free)
    return iter(free)


def in_turns(candidates, *, seconds=ROUND_S, most=100, width=0.05):
    """Load the candidates in turns, until each ratio to the first is known narrowly enough, or for so many rounds.

    Returns the rounds that nothing disturbed, each a Turn per candidate, and how many there were.
    """
    rounds = []
    with processes() as start:
        domains = free_domains()
        started = [Station(candidate, next(domains), start) for candidate in candidates]
        for station in started:
            station.wait_ready()
        time.sleep(WARM_UP_S)
        for number in range(-1, most):
            # There and back, so that none is always behind the same one.
            order = started if number % 2 else started[::-1]
            turns = {station: station.turn(seconds) for station in order}
            # The first round is for what happens once.
            if number >= 0:
                rounds.append([turns[station] for station in started])
            kept = undisturbed(rounds)
            if len(kept) >= MIN_ROUNDS and all(ratio.width < width for ratio in ratios(kept, "cpu_us")):
                break
    return undisturbed(rounds), len(rounds)


def ratios(rounds, what):
    """Return for each candidate the median of its figures to the first one's, round by round, and its interval."""
    shares = [[getattr(turn, what) / getattr(turns[0], what) for turn in turns] for turns in rounds]
    return [median_interval(column) for column in zip(*shares, strict=True)]


def medians(rounds, what):
    """Return for each candidate the median of its figures."""
    return [statistics.median(getattr(turn, what) for turn in column) for column in zip(*rounds, strict=True)]
