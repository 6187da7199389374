"""What a relayed message costs: `python bench/relay.py`, printed as tables, ratios taken in this one run.

Publishers and receivers are processes of their own over DDS. CPU is user and system time of the relay's process, all
threads, divided by the messages that it had to relay; runs are interleaved and medians given, so that what else runs
matters less. The floor is bench/floor.c, where a compiler and the wheels' headers are.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

from relay_runs import (
    Load,
    floor,
    in_turns,
    interleaved,
    ours,
    ours_telling_all,
    ours_telling_nothing,
    ours_through_rclpy,
    start_and_idle,
    typed,
)

LARGE = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).parents[1] / "configs/large_messages.xml")}
COSTS = {
    "2 x 200 Hz x 1 kB": Load("Image", 1_000, 200),
    "4 x 100 Hz Imu": Load("Imu", 0, 100, topics=4),
    "2 x 20 Hz x 1 MB": Load("Image", 1_000_000, 20, seconds=8, environ=LARGE),
}
LARGE_LOADS = {
    "2 x 20 Hz x 1 MB, default transport": Load("Image", 1_000_000, 20),
    "2 x 20 Hz x 1 MB, large_messages": Load("Image", 1_000_000, 20, environ=LARGE),
    "2 x 20 Hz x 6 MB, large_messages": Load("Image", 6_000_000, 20, environ=LARGE),
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


def cost(runs, relays):
    print("| load | relay | CPU a message | to typed | to C | p50 latency | to typed | lost |")
    print("|---|---|---|---|---|---|---|---|")
    for name, load in COSTS.items():
        figures = interleaved(relays, load, runs)
        plain, bare = figures["typed rclpy"], figures.get("C on rcl")
        for relay, each in figures.items():
            to_c = f"{each.cpu_us / bare.cpu_us:.2f}" if bare else "-"
            print(
                f"| {name} | {relay} | {each.cpu_us:.0f} us | {each.cpu_us / plain.cpu_us:.2f} | {to_c} "
                f"| {each.latency_ms:.2f} ms | {each.latency_ms / plain.latency_ms:.2f} | {each.lost:.1%} |",
                flush=True,
            )


def large(runs):
    print("\n| large messages | CPU a message | p50 latency | lost |\n|---|---|---|---|")
    for name, load in LARGE_LOADS.items():
        each = interleaved({"ours": ours}, load, runs)["ours"]
        print(f"| {name} | {each.cpu_us:.0f} us | {each.latency_ms:.1f} ms | {each.lost:.1%} |", flush=True)


def telling(runs):
    print("\n| what it tells | CPU a message | to nothing |\n|---|---|---|")
    load = COSTS["2 x 200 Hz x 1 kB"]
    figures = interleaved({"nothing": ours_telling_nothing, "all, as scalars too": ours_telling_all}, load, runs)
    for name, each in figures.items():
        print(f"| {name} | {each.cpu_us:.0f} us | {each.cpu_us / figures['nothing'].cpu_us:.2f} |", flush=True)


def scale(runs):
    print("\n| scale | CPU a message | to the first | p50 latency | lost |\n|---|---|---|---|---|")
    figures = in_turns({name: (ours, load) for name, load in SCALES.items()}, runs)
    first = next(iter(figures.values()))
    for name, each in figures.items():
        ratio = each.cpu_us / first.cpu_us
        print(f"| {name} | {each.cpu_us:.0f} us | {ratio:.2f} | {each.latency_ms:.2f} ms | {each.lost:.1%} |")


def rest():
    started = start_and_idle(Load("Image", 1_000, 1), seconds=1)
    print(f"\nfrom the command to both subscriptions: {started.took_s:.2f} s, of them {started.cpu_s:.2f} s of CPU")
    idle = start_and_idle(Load("Image", 1_000, 1, groups=20), seconds=10)
    print(f"20 groups of 2 topics, subscribed and silent: {idle.idle_share:.1%} of a core")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="runs of each relay and load (default: %(default)s)")
    parser.add_argument("parts", nargs="*", metavar="PART", help="of cost, telling, large, scale, rest (default: all)")
    options = parser.parse_args()
    parts = options.parts or ["cost", "telling", "large", "scale", "rest"]
    print(f"Python {sys.version.split()[0]}, {os.cpu_count()} cores\n")
    with tempfile.TemporaryDirectory() as folder:
        relays = {"typed rclpy": typed, "syncrelay through rclpy": ours_through_rclpy, "syncrelay": ours}
        if bare := floor(Path(folder)):
            relays["C on rcl"] = bare
        if "cost" in parts:
            cost(options.runs, relays)
    if "telling" in parts:
        telling(options.runs)
    if "large" in parts:
        large(options.runs)
    if "scale" in parts:
        scale(options.runs)
    if "rest" in parts:
        rest()
    return 0


if __name__ == "__main__":
    sys.exit(main())
