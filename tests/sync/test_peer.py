"""The engine against the real C++ message_filters, set for set and moment for moment."""

import random
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from syncrelay.sync import ApproximateTime, ExactTime, Match, Message, SyncGroup
from tests.cpp_peers import built
from tests.faults.extent import chosen
from tests.sync.support.streams import AGE_PENALTIES, MS, in_order

DRIVER = Path(__file__).parent / "peer" / "message_filters_driver.cpp"
HEADER = Path("/usr/include/message_filters/sync_policies/approximate_time.h")
STREAMS = chosen(short=50, long=2_000)


@pytest.fixture
def driver(request):
    return built(
        request,
        DRIVER,
        package="libmessage-filters-dev",
        headers=(HEADER, HEADER.with_name("exact_time.h")),
        libraries=("message_filters", "rosconsole", "rostime", "boost_thread"),
    )


@dataclass(frozen=True)
class Stream:
    seed: int
    n_inputs: int
    queue_size: int
    age_penalty: float
    slop_ns: int | None
    min_periods_ns: tuple
    events: list

    def as_approximate(self):
        options = (self.age_penalty, -1 if self.slop_ns is None else self.slop_ns, *self.min_periods_ns)
        return " ".join(map(str, ("approximate", self.n_inputs, self.queue_size, *options, self.fed())))

    def as_exact(self):
        return f"exact {self.n_inputs} {self.queue_size} {self.fed()}"

    def fed(self):
        return f"{len(self.events)} " + " ".join(f"{index} {stamp}" for index, stamp in self.events)

    def approximate_time(self):
        return ApproximateTime(
            n_inputs=self.n_inputs,
            queue_size=self.queue_size,
            slop_ns=self.slop_ns,
            age_penalty=self.age_penalty,
            min_periods_ns=self.min_periods_ns,
        )

    def exact_time(self):
        return ExactTime(n_inputs=self.n_inputs, queue_size=self.queue_size)


def draw(seed):
    rng = random.Random(seed)
    n_inputs = rng.randint(2, 9)
    bounded = rng.random() < 0.3
    return Stream(
        seed=seed,
        n_inputs=n_inputs,
        queue_size=rng.choice((2, 3, 5, 10, 20, 50, 100)),
        age_penalty=rng.choice(AGE_PENALTIES),
        slop_ns=rng.choice((0, 5 * MS, 20 * MS, 50 * MS, 200 * MS, 1_000 * MS, None)),
        min_periods_ns=tuple(rng.choice((0, 5 * MS, 50 * MS)) if bounded else 0 for _ in range(n_inputs)),
        events=in_order(rng, n_inputs, rng.randint(50, 450)),
    )


def peers_lines(driver, requests):
    output = subprocess.run([driver], input="\n".join(requests), capture_output=True, text=True, check=True).stdout
    return [block.split("\n")[:-1] for block in output.split("end\n")[:-1]]


def our_lines(add, events):
    for event, (index, stamp) in enumerate(events):
        for outcome in add(Message(index, stamp, event)):
            if isinstance(outcome, Match):
                yield f"set {event} " + " ".join(
                    str(message.payload) for message in outcome.messages if message is not None
                )
            else:
                yield f"drop {event} {outcome.message.payload}"


def sets(lines):
    return [line for line in lines if line.startswith("set")]


def through_group(policy):
    group = SyncGroup(policy, required=(True,) * policy.n_inputs)
    return lambda message: group.add(message, now=0)


@pytest.mark.first
@pytest.mark.peer
def test_approximate_and_exact_time_agree_with_message_filters(driver):
    streams = [draw(seed) for seed in range(STREAMS)]
    approximate = peers_lines(driver, [stream.as_approximate() for stream in streams])
    exact = peers_lines(driver, [stream.as_exact() for stream in streams])
    assert len(approximate) == len(exact) == STREAMS
    assert sum(len(sets(lines)) for lines in approximate) > 10 * STREAMS, "too few sets to prove anything"
    assert sum(len(sets(lines)) for lines in exact) > STREAMS
    for stream, approximate_lines, exact_lines in zip(streams, approximate, exact, strict=True):
        told = f"seed {stream.seed}"
        for add in (stream.approximate_time().add, through_group(stream.approximate_time())):
            assert sets(our_lines(add, stream.events)) == approximate_lines, told
        for add in (stream.exact_time().add, through_group(stream.exact_time())):
            # message_filters reports a set before what it superseded.
            assert sorted(our_lines(add, stream.events)) == sorted(exact_lines), told
