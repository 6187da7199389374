"""Plays worlds by seed: `python -m tests.simulated --seed 1 --hours 1`, or `make simulate SEED=1 HOURS=1`.

For a seed whose world breaks a promise it prints what, and the smallest world found that still does. Exits with 1 then.
Ctrl-C ends it with the figures so far.
"""

import argparse
import sys
import time
from contextlib import suppress
from typing import Final

from tests.simulated.play import Played, play, shrunk, world_of

_HOUR_S: Final = 3600.0
_MOST: Final = 10


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.simulated", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="the first seed")
    parser.add_argument("--count", type=int, help="play so many worlds")
    parser.add_argument("--hours", type=float, help="play worlds until so many hours have been simulated")
    parser.add_argument("--cpu", type=float, help="play worlds until so many seconds of CPU have been used")
    parser.add_argument("--log", action="store_true", help="print the log of each world")
    parser.add_argument("--keep-on", action="store_true", help="go on after a world that breaks a promise")
    parser.add_argument("--as-drawn", action="store_true", help="do not look for a smaller world")
    asked = parser.parse_args()
    count = asked.count or (None if asked.hours or asked.cpu else 1)
    seed, simulated, failed, began = asked.seed, 0.0, 0, time.process_time()
    # A run may be cut short.
    with suppress(KeyboardInterrupt):
        while (
            (count is None or seed < asked.seed + count)
            and (asked.hours is None or simulated < asked.hours * _HOUR_S)
            and (asked.cpu is None or time.process_time() - began < asked.cpu)
        ):
            plan = world_of(seed)
            played = play(plan)
            simulated += played.seconds
            if asked.log:
                _print_log(played)
            if played.broken:
                failed += 1
                _say(f"seed {seed} breaks a promise:", *played.broken[:_MOST])
                if not asked.as_drawn:
                    small = shrunk(plan)
                    _say("the smallest world that was found:", small.plan.described(), *small.broken[:_MOST])
                if not asked.keep_on:
                    break
            seed += 1
    used = time.process_time() - began
    _say(
        f"{seed - asked.seed + bool(failed and not asked.keep_on)} worlds, {simulated / _HOUR_S:.2f} hours,"
        f" {simulated / used:.0f} times real time; {failed} broke a promise"
    )
    return int(failed > 0)


def _print_log(played: Played) -> None:
    for line in played.lines:
        _say(f"{line.at:10.4f} {line.level} {line.text}")


def _say(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
