"""Small documents as `analyze --json` prints them, made from what a test says of a recording."""

import random
from collections.abc import Iterator
from typing import Any

from syncrelay.recordings.analysis.buckets import counted_in_buckets

MS = 1_000_000
SECOND = 1_000_000_000
MAY_1 = 1_714_521_600 * SECOND
"""2024-05-01 00:00 UTC."""


def quantity(values: list[int]) -> dict[str, Any] | None:
    """A quantity of sets as an analysis tells it; keys are text, as JSON has them."""
    if not values:
        return None
    ordered = sorted(values)
    counts = {str(floor): count for floor, count in counted_in_buckets(ordered).items()}
    middle = ordered[len(ordered) // 2]
    return {
        "least": ordered[0],
        "low": ordered[0],
        "median": middle,
        "high": ordered[-1],
        "greatest": ordered[-1],
        "counts": counts,
    }


def spread(median: int, greatest: int) -> dict[str, int]:
    return {"least": min(0, median), "low": 0, "median": median, "high": greatest, "greatest": greatest}


def topic(name: str, **told: Any) -> dict[str, Any]:
    plain = {
        "topic": name,
        "type": "sensor_msgs/msg/Image",
        "messages": 100,
        "rate_hz": 10.0,
        "period": 100 * MS,
        "jitter": MS,
        "least_period": 90 * MS,
        "gaps": 0,
        "longest_gap": None,
        "duplicates": 0,
        "out_of_order": 0,
        "unstamped": 0,
        "unreadable": 0,
        "delay": None,
        "drift_ppm": None,
    }
    return {**plain, **told}


def an_input(name: str, matched: int, dropped: dict[str, int] | None = None, unneeded: int = 0) -> dict[str, Any]:
    dropped = dropped or {}
    received = matched + sum(dropped.values())
    return {"topic": name, "received": received, "matched": matched, "dropped": dropped, "unneeded": unneeded}


def finding(code: str, seconds: int = 10, *, severity: str = "warn", about: int | None = None) -> dict[str, Any]:
    return {
        "code": code,
        "severity": severity,
        "text": f"{code} for {seconds} s",
        "suggestion": f"mend `{code}`",
        "input": about,
        "seconds": seconds,
    }


def change(key: str, value: str | int, about: int | None = None) -> dict[str, Any]:
    return {"group": "front", "topic": about, "key": key, "value": value, "reason": "measured"}


def group(
    now: int,
    possible: int,
    *changes: dict[str, Any],
    name: str = "front",
    sets: int | None = None,
    then: int | None = None,
    topics: tuple[str, ...] = ("/camera", "/lidar"),
    inputs: list[dict[str, Any]] | None = None,
    findings: list[dict[str, Any]] | None = None,
    spans: list[int] | None = None,
    latencies: list[int] | None = None,
) -> dict[str, Any]:
    sets = now if sets is None else sets
    lost = {"too_far": possible - now} if possible > now else {}
    suggestion = {
        "possible": possible,
        "now": now,
        "then": now if then is None else then,
        "hints": [],
        "changes": list(changes),
    }
    return {
        "name": name,
        "policy": "approximate_time",
        "sets": sets,
        "span": quantity(spans or [3 * MS] * sets),
        "latency": quantity(latencies or [MS] * sets),
        "inputs": inputs if inputs is not None else [an_input(each, now, lost) for each in topics],
        "pairs": [{"first": topics[0], "second": topics[1], "signed": spread(0, MS), "distance": spread(MS, 2 * MS)}],
        "by_slop": [],
        "by_queue_size": [],
        "tried": None,
        "findings": findings or [],
        "suggestion": suggestion,
    }


def document(
    *groups: dict[str, Any], begin: int = MAY_1, lasts: int = 10 * SECOND, topics: list[dict[str, Any]] | None = None
) -> dict[str, Any]:
    return {
        "recording": "made",
        "begin": begin,
        "end": begin + lasts,
        "topics": topics if topics is not None else [topic("/camera"), topic("/lidar")],
        "groups": list(groups),
    }


def fleet(count: int, *, days: int = 30) -> Iterator[tuple[str, dict[str, Any]]]:
    """Recordings of 40 robots on some days, each a little different: robot 3 is bad, robot 7 drifts."""
    chance = random.Random(19)
    spans = [quantity([chance.randrange(1, 9 * MS) for _ in range(60)]) for _ in range(20)]
    wider = {value: [change("slop", value)] for value in ("6ms", "7ms", "9ms")}
    for number in range(count):
        robot, day = number % 40, number // 40 % days
        now = 100 - chance.randrange(20) - (50 if robot == 3 else 0)
        values = wider[chance.choice(list(wider))] if now < 90 else []
        found = [finding("over_slop", chance.randrange(4, 90))] if values else []
        if robot == 7:
            found.append(finding("clock_drift", 60, about=1))
        made = group(now, 100, *values, then=99 if values else now, findings=found, spans=[MS], latencies=[MS])
        made["span"] = chance.choice(spans)
        clocks = [topic("/camera"), topic("/lidar", drift_ppm=chance.uniform(30, 40) if robot == 7 else None)]
        place = f"/data/fleet/robot_{robot:02}/2024-05-{day + 1:02}/run_{chance.randrange(10**8):08}.mcap"
        yield place, document(made, begin=MAY_1 + day * 86_400 * SECOND + number, topics=clocks)
