"""Matches the rows of CSV files by their first column, a time in seconds: the engine without ROS and recordings.

python3 match_csv.py 0.02 left.csv right.csv > matched.csv     (a slop of 20 ms; says on stderr what became of all rows)
"""

import csv
import sys
from decimal import Decimal
from pathlib import Path

from syncrelay.sync import ApproximateTime, DropReason, Match, Message, SyncGroup

AN_HOUR = 3600 * 10**9


def messages(index, name):
    with Path(name).open(newline="") as file:
        for row in csv.reader(file):
            yield Message(index, int(Decimal(row[0]) * 10**9), row)


def matched(slop_ns, names):
    policy = ApproximateTime(n_inputs=len(names), queue_size=1000, slop_ns=slop_ns)
    group = SyncGroup(policy, max_wait_ns=AN_HOUR)
    rows = sorted((each for index, name in enumerate(names) for each in messages(index, name)), key=lambda m: m.stamp)
    outcomes = [outcome for row in rows for outcome in group.add(row, now=row.stamp)]
    outcomes += group.expire(now=rows[-1].stamp + AN_HOUR)  # nothing closer can come any more
    outcomes += group.flush(DropReason.SHUTDOWN)
    return [outcome for outcome in outcomes if isinstance(outcome, Match)], group.counts()


if __name__ == "__main__":
    slop, *names = sys.argv[1:]
    sets, counts = matched(int(Decimal(slop) * 10**9), names)
    csv.writer(sys.stdout).writerows([cell for each in one.messages for cell in each.payload] for one in sets)
    for name, count in zip(names, counts, strict=True):
        dropped = ", ".join(f"{number} {reason.meaning}" for reason, number in count.dropped.items())
        print(f"{name}: {count.fed} rows, {count.matched} matched; {dropped or 'none dropped'}", file=sys.stderr)
