from syncrelay.explain.distribution import keep_last, no_values


def test_the_newest_are_kept_in_order():
    values = no_values()
    keep_last(values, (1, 2), 3)
    keep_last(values, [3, 4], 3)
    assert values.tolist() == [2, 3, 4]
    keep_last(values, range(10), 3)
    assert values.tolist() == [7, 8, 9]


def test_what_64_bits_do_not_hold_is_the_most_that_they_do():
    values = no_values()
    keep_last(values, (5, 1 << 70, -(1 << 70), 6), 10)
    assert values.tolist() == [5, (1 << 63) - 1, -(1 << 63) + 1, 6]
