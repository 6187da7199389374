"""Compare what a relayed message costs: `python bench/compare.py [--load NAME] A B [C ...]`, in ratios to A.

A candidate is a checkout of syncrelay (`.`, `/path/to/another`), `c` (bench/floor.c, bare C on rcl) or `typed`
(bench/typed_relay.py). Settings follow an @, with commas between: environment variables (`.@SYNCRELAY_RECEIVE=rclpy`)
and the interpreter (`.@PYTHON=/path/to/python`); for a checkout also `heard` (its
manifest has a subscriber), `scalars` (on /diagnostics), `tapped` (by `syncrelay tap`), `untold` (it neither watches
itself nor tells of it) and `bundled` (each set leaves as one message). `c@bundled` joins the bytes of the messages, and
`c@held` passes them on when the last input has come, as whatever matches them must.

Each is started once, between processes that publish and receive, and all are loaded at once, in rounds of a second. CPU
is what all threads of its process ran, by the scheduler's count, per message that came out. Rounds in which neighbours
took over 5 % of the machine are dropped. It ends when the 95 % confidence interval of each ratio is narrower than
--width, or after --rounds.
"""

import argparse
import math
import statistics
import sys
import tempfile
from pathlib import Path

from candidates import LOADS, Workshop
from intervals import Interval
from rounds import medians, ratios, side_by_side
from spent import PURPOSES


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--load",
        action="append",
        choices=LOADS,
        metavar="LOAD",
        help=f"one of {', '.join(LOADS)}; may be repeated (default: the first)",
    )
    parser.add_argument("--rounds", type=int, default=200, help="rounds at most (default: %(default)s)")
    parser.add_argument("--width", type=float, default=0.05, help="of an interval, to its ratio (default: %(default)s)")
    parser.add_argument(
        "--most", type=float, help="end with 1 where a candidate costs more than so many times the first for certain"
    )
    parser.add_argument("candidates", nargs="+", metavar="CANDIDATE")
    asked = parser.parse_args()
    dear = []
    with tempfile.TemporaryDirectory() as folder:
        workshop = Workshop(Path(folder))
        for name in asked.load or [next(iter(LOADS))]:
            try:
                candidates = [workshop.candidate(word, LOADS[name]) for word in asked.candidates]
            except ValueError as error:
                parser.error(str(error))
            print(f"{name}:", flush=True)
            kept, n_rounds = side_by_side(candidates, most=asked.rounds, width=asked.width)
            show(candidates, kept, n_rounds)
            costs = zip(candidates, ratios(kept, "cpu_us") if kept else (), strict=False)
            dear += [(name, each.name, cost) for each, cost in costs if asked.most and cost.is_above(asked.most)]
    for name, candidate, cost in dear:
        print(f"{name}: {candidate} costs {shown(cost)} times the first, more than {asked.most:g} times for certain")
    return int(bool(dear))


def show(candidates, kept, n_rounds):
    """Print a table of the candidates' figures, and how many rounds they are of."""
    if not kept:
        print(f"all of {n_rounds} rounds were disturbed by neighbours\n", flush=True)
        return
    print(f"| candidate | CPU a message | {' | '.join(PURPOSES)} | to the first | p50 latency | to the first | lost |")
    print("|---" * (len(PURPOSES) + 6) + "|")
    threads = [
        [statistics.median(turn.threads_us[purpose] for turn in column) for purpose in PURPOSES]
        for column in zip(*(turns for turns, _ in kept), strict=True)
    ]
    lines = zip(
        candidates,
        *(medians(kept, "cpu_us"), threads, ratios(kept, "cpu_us")),
        *(medians(kept, "latency_ms"), ratios(kept, "latency_ms"), medians(kept, "lost")),
        strict=True,
    )
    for candidate, cpu_us, threads_us, cost, latency_ms, lateness, lost in lines:
        print(
            f"| {candidate.name} | {cpu_us:.1f} us | {' | '.join(f'{us:.1f}' for us in threads_us)} | {shown(cost)} "
            f"| {latency_ms:.2f} ms | {shown(lateness)} | {lost:.1%} |"
        )
    counted = medians(kept, "instructions")
    if any(map(math.isnan, counted)):
        print("the kernel counts no instructions here")
    else:
        print("instructions a message:", ", ".join(f"{each:,.0f}" for each in counted))
    print(f"{len(kept)} of {n_rounds} rounds kept\n", flush=True)


def shown(ratio: Interval):
    if ratio.low == ratio.high:
        return "1"
    between = f"{ratio.low:.3f} to {ratio.high:.3f}" if math.isfinite(ratio.width) else "too few rounds for an interval"
    return f"{ratio.median:.3f} ({between})"


if __name__ == "__main__":
    sys.exit(main())
