"""Measures how fast the engine is: `python bench/engine.py` prints tables, with ratios taken in one run.

Times are CPU times of this process, the best of five runs.
"""

import argparse
import gc
import random
import resource
import sys
import time

from slop_baseline import SlopSynchronizer, Stamp

from syncrelay.sync import ApproximateTime, ApproximateTimeEager, ExactTime, Message, SyncGroup

MS = 1_000_000
SECOND = 1_000 * MS
SLOP = 50 * MS
INPUTS = (2, 3, 5, 9)
QUEUES = (10, 50, 200)
RUNS = 5
BASELINE_SECONDS = 1.0
TARGETS = {  # events a second: through the policy, through SyncGroup
    "approximate_time": (150_000, 100_000),
    "approximate_time_eager": (150_000, 100_000),
    "exact_time": (400_000, 200_000),
}


def jittered(n_inputs, count, seed=1):
    """Inputs of 5 to 100 Hz, spread evenly on a log scale: jitter 30 %, latency up to 25 ms; in order of arrival."""
    rng = random.Random(seed)
    rates = [5 * 20 ** (index / (n_inputs - 1)) for index in range(n_inputs)]
    seconds = count / sum(rates)
    arrivals = []
    for index, rate in enumerate(rates):
        period = SECOND / rate
        latency = rng.random() * 20 * MS
        for number in range(int(seconds * rate)):
            stamp = int(SECOND + (number + rng.uniform(-0.3, 0.3)) * period)
            arrivals.append((stamp + latency + rng.random() * 5 * MS, index, stamp))
    return in_order(arrivals)


def triggered(n_inputs, count, seed=1):
    """Inputs of one 100 Hz trigger, 3 % lost: equal stamps."""
    rng = random.Random(seed)
    ticks = range(count // n_inputs)
    order = [(tick, index) for tick in ticks for index in rng.sample(range(n_inputs), n_inputs)]
    return [Message(index, SECOND + tick * 10 * MS, None) for tick, index in order if rng.random() < 0.97]


def gappy(n_inputs, count, seed=1):
    """Inputs of 5 to 100 Hz that fall silent for up to 100 periods now and then; one may be seconds late."""
    rng = random.Random(seed)
    arrivals = []
    for index in range(n_inputs):
        period = SECOND / rng.uniform(5, 100)
        latency = rng.choice((0, 0, SECOND // 2, 2 * SECOND))
        stamp = SECOND + rng.random() * period
        for _ in range(count // n_inputs):
            stamp += period * (rng.uniform(20, 100) if rng.random() < 0.01 else rng.uniform(0.7, 1.3))
            arrivals.append((stamp + latency + rng.random() * 5 * MS, index, int(stamp)))
    return in_order(arrivals)


def in_order(arrivals):
    """Messages by arrival, without those that came out of order on their input."""
    messages = []
    newest: dict[int, int] = {}
    for _, index, stamp in sorted(arrivals):
        if stamp > newest.get(index, 0):
            newest[index] = stamp
            messages.append(Message(index, stamp, None))
    return messages


def through_policy(policy):
    return policy.add


def through_group(policy):
    group = SyncGroup(policy, required=(True,) * policy.n_inputs)
    return lambda message: group.add(message, now=0)


def events_a_second(makers, messages):
    """The best of RUNS for each of `makers`, which run in turns, so that disturbances hit all."""
    best = [float("inf")] * len(makers)
    for _ in range(RUNS):
        for number, make_add in enumerate(makers):
            add = make_add()
            gc.collect()
            began = time.process_time()
            for message in messages:
                add(message)
            best[number] = min(best[number], time.process_time() - began)
    return [len(messages) / seconds for seconds in best]


def plainly(n_inputs, queue_size, slop, messages, stamp_type):
    """Events a second of the plain Python synchronizer, on as many events as it manages in BASELINE_SECONDS."""
    add = SlopSynchronizer(n_inputs, queue_size, slop, stamp_type).add
    done = 0
    began = time.process_time()
    while done < len(messages) and time.process_time() - began < BASELINE_SECONDS:
        add(messages[done])
        done += 1
    return done / (time.process_time() - began)


POLICIES = {
    "approximate_time": lambda sizes, slop: ApproximateTime(**sizes, slop_ns=slop),
    "approximate_time_eager": lambda sizes, slop: ApproximateTimeEager(**sizes, slop_ns=slop),
    "exact_time": lambda sizes, _: ExactTime(**sizes),
}


def throughput(count):
    """Print a row for every policy, number of inputs and queue; return whether all meet their targets."""
    print("| policy | inputs | queue | policy, ev/s | SyncGroup, ev/s | cost to queue 10 | |")
    print("|---|---|---|---|---|---|---|")
    all_good = True
    for name, make in POLICIES.items():
        for n_inputs in INPUTS:
            messages = (triggered if name == "exact_time" else jittered)(n_inputs, count)
            makers = [
                lambda through=through, queue_size=queue_size, n_inputs=n_inputs, make=make: through(
                    make({"n_inputs": n_inputs, "queue_size": queue_size}, SLOP)
                )
                for through in (through_policy, through_group)
                for queue_size in QUEUES
            ]
            rates = events_a_second(makers, messages)
            for queue_size, policy, group in zip(QUEUES, rates, rates[len(QUEUES) :], strict=False):
                targets = TARGETS[name]
                cost = rates[0] / policy
                good = policy >= targets[0] and group >= targets[1] and cost < 1.3
                all_good &= good
                figures = f"{policy:,.0f} | {group:,.0f} | {cost:.2f} x | {said(good)}"
                print(f"| {name} | {n_inputs} | {queue_size} | {figures} |")
    return all_good


def against_plain_python(count):
    """Print how much faster the engine is than a plain Python synchronizer, by stream, queue and slop."""
    print("| stream | inputs | queue | slop | plain Python, stamps as ints | as objects | approximate_time | eager |")
    print("|---|---|---|---|---|---|---|---|")
    for stream, n_inputs, queue_size, slop in (
        (jittered, 2, 10, SLOP),
        (jittered, 3, 10, SLOP),
        (jittered, 5, 50, 10 * SLOP),
        (gappy, 3, 10, SECOND),
        (gappy, 5, 10, SECOND),
    ):
        messages = stream(n_inputs, count)
        sizes = {"n_inputs": n_inputs, "queue_size": queue_size}
        makers = [
            lambda name=name, sizes=sizes, slop=slop: POLICIES[name](sizes, slop).add
            for name in ("approximate_time", "approximate_time_eager")
        ]
        of_ints, of_objects = (plainly(n_inputs, queue_size, slop, messages, kind) for kind in (int, Stamp))
        ours = " | ".join(f"{rate:,.0f} = {rate / of_objects:.0f} x" for rate in events_a_second(makers, messages))
        print(f"| {stream.__name__} | {n_inputs} | {queue_size} | {slop // MS} ms | ", end="")
        print(f"{of_ints:,.0f} | {of_objects:,.0f} | {ours} |")


def worst_event(count, seeds):
    """The longest that one event takes: gaps, slop of 1 s or none, 5 inputs, queue 50."""
    worst = dict.fromkeys(("approximate_time", "approximate_time_eager"), 0.0)
    sizes = {"n_inputs": 5, "queue_size": 50}
    for seed in range(seeds):
        messages = gappy(5, count, seed)
        for name in worst:
            for slop in (SECOND, 10**9 * SECOND):
                policies = [POLICIES[name](sizes, slop) for _ in range(RUNS)]
                worst[name] = max(worst[name], longest(policies, messages))
    for name, took in worst.items():
        print(f"worst single event of {name}: {took * 1e6:.0f} us (5 inputs, queue 50) {said(took < 1e-3)}")
    return max(worst.values()) < 1e-3


def longest(policies, messages):
    """The slowest event; each event counts by the best of its runs, which leaves out disturbances."""
    took = [float("inf")] * len(messages)
    for policy in policies:
        gc.collect()
        gc.disable()
        for number, message in enumerate(messages):
            began = time.perf_counter()
            policy.add(message)
            took[number] = min(took[number], time.perf_counter() - began)
        gc.enable()
    return max(took)


def many_groups(count):
    """What a message costs in 50 groups of 4 topics, next to one group."""
    messages = jittered(4, count)

    def one():
        return through_group(ApproximateTime(n_inputs=4, queue_size=10, slop_ns=SLOP))

    def fifty():
        groups = [one() for _ in range(50)]

        def add_to_each(message):
            for add in groups:
                add(message)

        return add_to_each

    single, together = events_a_second([one, fifty], messages)
    ratio = single / together / 50
    print(f"a message in 50 groups of 4 topics costs {ratio:.2f} x one in one group {said(ratio <= 1.2)}")
    return ratio <= 1.2


class Payload:
    """Counts those of its kind that are alive."""

    alive = 0
    __slots__ = ("bytes",)

    def __init__(self):
        Payload.alive += 1
        self.bytes = bytes(1_000)

    def __del__(self):
        Payload.alive -= 1


def memory(events):
    """Payloads alive and memory used over a long run."""
    queue_size, n_inputs = 50, 3
    group = SyncGroup(
        ApproximateTime(n_inputs=n_inputs, queue_size=queue_size, slop_ns=SLOP), required=(True,) * n_inputs
    )
    pattern = jittered(n_inputs, 10_000)
    span = pattern[-1].stamp - pattern[0].stamp + 100 * MS
    alive, fed = 0, 0
    at_first = 0
    while fed < events:
        shift = fed // len(pattern) * span
        for message in pattern:
            group.add(Message(message.input, message.stamp + shift, Payload()), now=0)
            alive = max(alive, Payload.alive)
        fed += len(pattern)
        at_first = at_first or resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - at_first
    bound = n_inputs * (queue_size + 1)
    good = alive <= bound + 1 and grown < 2_000
    print(f"{fed:,} events: at most {alive} payloads alive (queues hold {bound}), {grown} kB grown {said(good)}")
    return good


def said(good):
    return "ok" if good else "MISSED"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=20_000, help="events a stream (default: %(default)s)")
    parser.add_argument("--long-run", type=int, default=1_000_000, help="events of the memory run")
    parser.add_argument("--check", action="store_true", help="exit 1 if a target is missed")
    options = parser.parse_args()
    print(f"Python {sys.version.split()[0]}, one core\n")
    results = [throughput(options.events)]
    print()
    against_plain_python(options.events)
    print()
    results += [worst_event(2_000, seeds=10), many_groups(options.events // 10), memory(options.long_run)]
    return 1 if options.check and not all(results) else 0


if __name__ == "__main__":
    sys.exit(main())
