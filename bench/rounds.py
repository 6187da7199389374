"""Starts candidates once, loads them side by side, and measures what a message costs each of them in each round."""

import contextlib
import json
import random
import select
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from candidates import HERE, clean_environment
from intervals import median_interval, stolen_share, undisturbed
from spent import Instructions, by_purpose, threads_ns

# Fifty processes may have to start on two cores.
PATIENCE_S = 90.0
# A round takes so long. All are loaded at once, so that what else runs here disturbs all alike, and without a pause: a
# relay does some of its work once a second, and more of it where messages come and go.
ROUND_S = 1.0
# By then each of fifty groups has been looked at since the last publisher or subscriber came.
WARM_UP_S = 5.0
# By then the windows of a relay's figures are full.
SETTLING_ROUNDS = 10
MIN_ROUNDS = 10


class Turn(NamedTuple):
    """A candidate in a round: CPU of its process for each message, by thread and in all; median age of sets."""

    threads_us: Mapping[str, float]
    cpu_us: float
    latency_ms: float
    lost: float
    instructions: float


class Round(NamedTuple):
    """A turn of each candidate, and the share of CPU time that the hypervisor gave to other machines."""

    turns: Sequence[Turn]
    stolen: float


class Child:
    """A process with which lines are exchanged."""

    def __init__(self, argv, environ, log, cwd=None):
        self.process = subprocess.Popen(
            argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=environ, cwd=cwd, text=True
        )
        self._told: Any = self.process.stdin
        self._said: Any = self.process.stdout

    def read(self, patience_s):
        ready, _, _ = select.select([self._said], [], [], patience_s)
        line = self._said.readline() if ready else ""
        if not line:
            raise RuntimeError(f"{self.process.args!r} said nothing")
        return line.rstrip("\n")

    def tell(self, line):
        self._told.write(f"{line}\n")
        self._told.flush()

    def end(self):
        """End it by the end of its stdin; if that does not help, by signals."""
        self._told.close()
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
        pace += ["--own-stamps"] if load.own_stamps else []
        hear = [f"--hear={topic}" for topic in candidate.hear]
        relay_environ = {**environ, **candidate.environ}
        self.relay = start(candidate.argv, relay_environ, candidate.folder)
        rig_environ = {**environ, "PYTHONPATH": str(HERE.parent)}
        if candidate.bundles:
            rig_environ |= candidate.environ
        self._publisher = start([*rig, "publish", load.type_name, *pace, *load.inputs], rig_environ)
        told = [*rig, "receive", load.type_name, f"--together={load.topics}", *hear]
        told += [f"--bundled={candidate.bundle_type}", *candidate.bundles] if candidate.bundles else load.outputs
        self._receiver = start(told, rig_environ)
        # Once the relay is there.
        self._start_tap = lambda: start(candidate.tap, relay_environ, candidate.folder) if candidate.tap else None
        # From when it is ready.
        self._instructions: Any = None
        self._before: Any = None
        self._due = 0

    def wait_ready(self):
        for child in (self._publisher, self._receiver):
            child.read(PATIENCE_S)
        self._start_tap()

    def count_instructions(self):
        """Count the instructions of the threads that the relay has now."""
        self._instructions = Instructions(self.relay.process.pid)

    def begin(self):
        """Load the relay for a round."""
        n_sets = max(1, round(self._load.rate * ROUND_S))
        self._due = n_sets * len(self._load.outputs)
        self._before = self._ran(), self._instructions.read()
        self._receiver.tell(json.dumps([time.time_ns(), self._due]))
        self._publisher.tell(n_sets)

    def end(self):
        """Return what a message cost in this round, once all that was sent came out, or is lost.

        Raises RuntimeError where a process fails.
        """
        self._publisher.read(PATIENCE_S)
        came, latency_ns = json.loads(self._receiver.read(PATIENCE_S))
        ran, instructions = self._ran() - self._before[0], self._instructions.read() - self._before[1]
        if came == 0:
            raise RuntimeError(f"{self.relay.process.args} relayed nothing")
        return Turn(
            {purpose: ns / came / 1e3 for purpose, ns in by_purpose(ran, self.relay.process.pid).items()},
            ran.total() / came / 1e3,
            latency_ns / 1e6,
            1 - came / self._due,
            instructions / came,
        )

    def _ran(self):
        return Counter(threads_ns(self.relay.process.pid))


def machine_time():
    with Path("/proc/stat").open() as file:
        return file.readline()


@contextlib.contextmanager
def processes():
    """Yield a function that starts a process; end all at the end, and print what they said if one failed."""
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


def side_by_side(candidates, *, most=200, width=0.05):
    """Load the candidates until the interval of each ratio to the first is narrow, or for `most` rounds.

    Returns the rounds that nothing disturbed, and how many there were; Ctrl-C ends it early.
    """
    rounds: list = []
    with contextlib.suppress(KeyboardInterrupt), processes() as start:
        domains = free_domains()
        started = [Station(candidate, next(domains), start) for candidate in candidates]
        for station in started:
            station.wait_ready()
        time.sleep(WARM_UP_S)
        for station in started:
            station.count_instructions()
        for _ in range(SETTLING_ROUNDS):
            one_round(started)
        while len(rounds) < most:
            rounds.append(one_round(started))
            kept = undisturbed(rounds)
            if len(kept) >= MIN_ROUNDS and all(ratio.width < width for ratio in ratios(kept, "cpu_us")):
                break
    return undisturbed(rounds), len(rounds)


def one_round(started):
    machine = machine_time()
    for station in started:
        station.begin()
    turns = [station.end() for station in started]
    return Round(turns, stolen_share(machine, machine_time()))


def ratios(rounds, what):
    """Return for each candidate the median of its figures to the first one's, round by round, and its interval."""
    shares = [[getattr(turn, what) / getattr(turns[0], what) for turn in turns] for turns, _ in rounds]
    return [median_interval(column) for column in zip(*shares, strict=True)]


def medians(rounds, what):
    """Return for each candidate the median of its figures."""
    columns = zip(*(turns for turns, _ in rounds), strict=True)
    return [statistics.median(getattr(turn, what) for turn in column) for column in columns]
