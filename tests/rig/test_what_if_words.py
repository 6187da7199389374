"""The words for faults: what they mean, and what is said of others."""

import pytest

from syncrelay.rig.what_if import Kind, parse_fault

S = 1_000_000_000


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("late: /lidar/points 80ms", (Kind.LATE, "/lidar/points", 80_000_000, 0, None)),
        ("late:/lidar 0.08 s from 1s", (Kind.LATE, "/lidar", 80_000_000, S, None)),
        ("drop: /imu 2.5%", (Kind.DROP, "/imu", 25_000, 0, None)),
        ("drop: /imu 100 % until 2s from 1s", (Kind.DROP, "/imu", 1_000_000, S, 2 * S)),
        ("offset: /imu -1min", (Kind.OFFSET, "/imu", -60 * S, 0, None)),
        ("drift: /imu -100ppm", (Kind.DRIFT, "/imu", -100_000, 0, None)),
        ("drift: /imu 0.25ppm", (Kind.DRIFT, "/imu", 250, 0, None)),
        ("drop: /imu 0.0001%", (Kind.DROP, "/imu", 1, 0, None)),
        ("dead: imu", (Kind.DEAD, "imu", 0, 0, None)),
        ("dead: /imu from 12s", (Kind.DEAD, "/imu", 0, 12 * S, None)),
    ],
)
def test_a_fault_is_read(text, meaning):
    fault = parse_fault(text)
    assert (fault.kind, fault.topic, fault.amount, fault.begin, fault.end) == meaning
    assert fault.written == text


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "`` is not a fault, expected one such as `late: /lidar/points 80ms`"),
        ("late /x 3ms", "`late /x 3ms` is not a fault, expected one such as `late: /lidar/points 80ms`"),
        ("lat: /x 3ms", "`lat: /x 3ms` is not a fault, did you mean `late`?"),
        ("quiet: /x", "`quiet: /x` is not a fault, expected late, drop, offset, drift or dead, as in"),
        ("late:", "`late:` names no topic, expected `late: /lidar/points 80ms`"),
        ("late: /x", "`late: /x` does not say how much, expected `late: /lidar/points 80ms`"),
        ("late: x//y 3ms", "a topic name has one `/` between its parts"),
        ("late: /x 3", "`3` has no unit, expected one such as `3ms`"),
        ("offset: /x -3", "`-3` has no unit, expected one such as `-3ms`"),
        ("dead: /x from 3", "`3` has no unit, expected one such as `3ms`"),
        ("late: /x 61s", "`61s` is out of range, expected 0 to 60s"),
        ("late: /x -1s", "`-1s` is out of range"),
        ("drop: /x 10", "expected a share such as 10% (0% to 100%, at most 4 decimals), found `10`"),
        ("drop: /x 101%", "expected a share such as 10% (0% to 100%, at most 4 decimals), found `101%`"),
        ("drop: /x 0.00004%", "found `0.00004%`"),
        ("drift: /x 5", "expected a drift such as 100ppm (at most 100000ppm, 3 decimals), found `5`"),
        ("drift: /x 100ppm 5", "found `100ppm 5`"),
        ("drift: /x 0.0004ppm", "found `0.0004ppm`"),
        ("dead: /x after 5s", "`after` in `dead: /x after 5s`: expected `from 12s`, `until 20s` or both"),
        ("dead: /x from 1s from 2s", "`from` in `dead: /x from 1s from 2s`: expected"),
        ("dead: /x from", "expected a duration such as 20ms, found an empty string"),
        ("dead: /x from 5s until 5s", "never applies: `from` must be 0s or later, and `until` later than `from`"),
    ],
)
def test_what_is_no_fault_is_told_with_what_to_write(text, error):
    with pytest.raises(ValueError) as raised:
        parse_fault(text)
    assert error in str(raised.value)
