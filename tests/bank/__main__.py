"""Draws faults by seed, and prints how each kind is told: `python -m tests.bank --draws 2000 --seed 1`.

`--show SEED` prints what a draw is, and what was said when. `--known > tests/bank/known.txt` writes down what is said
of draws with fixed seeds, `--limits known > tests/bank/limits.txt` where it becomes another: read what has changed
before you keep it. `--limits drawn` looks for limits anew.
"""

import argparse
import sys
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import NamedTuple

from tests.bank.kinds import KINDS
from tests.bank.known import fixed, known
from tests.bank.limits import drawn_limits, known_limits
from tests.bank.mended import mended
from tests.bank.play import Score, described, drawn, play


class Row(NamedTuple):
    """What is kept of a draw."""

    seed: int
    kind: str
    score: Score
    why: str
    cure: str
    is_cure_tried: bool
    lasted: float
    after: tuple[Score, str] | None = None
    """How the second fault was told once the first was mended."""


def row(kinds: tuple[str, ...], n_faults: int, seed: int) -> Row:
    result = play(drawn(seed, kinds, n_faults))
    then = mended(result.drawn, result)
    first = result.first[1].code.value if result.first else ""
    why = result.why or ("" if result.score is Score.TOLD else first)
    kind, tried = " + ".join(result.drawn.kinds) or "well", any(each.moments for each in result.drawn.truths)
    after = None if then is None else (then.result.score, then.why)
    return Row(seed, kind, result.score, why, result.cure or "", tried, result.lasted, after)


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.bank", description=__doc__)
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1, help="the first seed")
    parser.add_argument("--faults", type=int, choices=[0, 1, 2], default=1)
    parser.add_argument("--kinds", help="of these only, separated by commas", default=",".join(KINDS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--show", type=int, help="print one draw, and what was said of it")
    parser.add_argument("--known", action="store_true", help="print what is known of fixed draws")
    parser.add_argument("--limits", choices=["known", "drawn"], help="print where what is said becomes another")
    asked = parser.parse_args()
    if asked.known:
        _say("\n\n".join(map(known, fixed())))
        return 0
    if asked.limits is not None:
        for limit in known_limits() if asked.limits == "known" else drawn_limits():
            _say(limit.line())
        return 0
    kinds = tuple(asked.kinds.split(","))
    if asked.show is not None:
        draw = drawn(asked.show, kinds, asked.faults)
        result = play(draw)
        _say(described(draw), *(f"  {second:6.2f} {text}" for second, text in result.said))
        _say(f"{result.score.value} {result.why}; cure: {result.cure or 'well'}; logged at {result.logged}")
        if (then := mended(draw, result)) is not None:
            _say(f"{then.kind} mended at {then.at:.2f} s; then true: {then.result.drawn.truths[0]}")
            _say(*(f"  {second:6.2f} {text}" for second, text in then.result.said))
            _say(f"{then.result.score.value} {then.why}")
        return 0
    began = time.monotonic()
    with ProcessPoolExecutor(asked.jobs) as pool:
        rows = list(
            pool.map(partial(row, kinds, asked.faults), range(asked.seed, asked.seed + asked.draws), chunksize=8)
        )
    _table(rows)
    took = time.monotonic() - began
    _say(f"{len(rows)} draws in {took:.0f} s, {1000 * took / len(rows):.0f} ms each")
    return 0


def _table(rows: list[Row]) -> None:
    kinds = defaultdict(list)
    for each in rows:
        kinds[each.kind].append(each)
    names = sorted(kinds) if " + " not in "".join(kinds) else []
    for kind in names:
        _say(_counted(kind, kinds[kind]))
    _say(_counted("all", rows))
    told = [each for each in rows if each.score in (Score.TOLD, Score.LATE) and each.is_cure_tried]
    offered = [each for each in told if each.cure != "nothing offered"]
    wrong = [each for each in offered if each.cure]
    fails = "; ".join(f"{each.seed} {each.kind}: {each.cure}" for each in wrong[:12])
    _say(f"of {len(told)} that were told, {len(offered)} were offered a cure, which fails in {len(wrong)}. {fails}")
    after = [each for each in rows if each.after is not None]
    if after:
        named = sum(score is Score.TOLD for score, _ in filter(None, (each.after for each in after)))
        _say(f"of {len(after)} whose first fault was mended, the second was named in {named}")
        _say(
            *(
                f"  {each.seed} {each.kind}: {each.after[0].value} {each.after[1]}"
                for each in after
                if each.after and each.after[0] is not Score.TOLD
            )
        )
    if rows[0].kind == "well":
        _say(f"longest false warning: {max(each.lasted for each in rows):.0f} s")


def _counted(kind: str, rows: list[Row]) -> str:
    scores = Counter(each.score for each in rows)
    wrong = [each for each in rows if each.score is not Score.TOLD]
    whys = Counter(
        f"{each.score.value} {each.why}".strip() for each in wrong if each.score is not Score.NOTHING
    ).most_common(6)
    figures = " ".join(f"{scores[each]:5d}" for each in Score)
    seeds = ",".join(str(each.seed) for each in wrong[:6])
    return f"{kind:20s} {len(rows):5d} {scores[Score.TOLD] / len(rows):5.0%} {figures}  {dict(whys)} {seeds}"


def _say(*lines: str) -> None:
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
