"""The words for faults: what they mean, and what is said of others."""

import pytest

from syncrelay.rig.what_if import parse_fault


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "`` is not a fault, expected one such as `late: /lidar/points 80ms`"),
        ("lat: /x 3ms", "`lat: /x 3ms` is not a fault, did you mean `late`?"),
        ("quiet: /x", "`quiet: /x` is not a fault, expected late, drop, offset, drift or dead, as in"),
        ("late:", "`late:` names no topic, expected `late: /lidar/points 80ms`"),
        ("late: /x", "`late: /x` does not say how much, expected `late: /lidar/points 80ms`"),
        ("late: x//y 3ms", "a topic name has one `/` between its parts"),
        ("late: /x 3", "`3` has no unit, expected one such as `3ms`"),
        ("late: /x 61s", "`61s` is out of range, expected 0 to 60s"),
        ("drop: /x 10", "expected a share such as 10% (0% to 100%, at most 4 decimals), found `10`"),
        ("drop: /x 101%", "expected a share such as 10% (0% to 100%, at most 4 decimals), found `101%`"),
        ("drift: /x 5", "expected a drift such as 100ppm (at most 100000ppm, 3 decimals), found `5`"),
        ("drift: /x 0.0004ppm", "found `0.0004ppm`"),
        ("dead: /x after 5s", "`after` in `dead: /x after 5s`: expected `from 12s`, `until 20s` or both"),
        ("dead: /x from 1s from 2s", "`from` in `dead: /x from 1s from 2s`: expected"),
        ("dead: /x from 5s until 5s", "never applies: `from` must be 0s or later, and `until` later than `from`"),
    ],
)
def test_what_is_no_fault_is_told_with_what_to_write(text, error):
    with pytest.raises(ValueError) as raised:
        parse_fault(text)
    assert error in str(raised.value)
