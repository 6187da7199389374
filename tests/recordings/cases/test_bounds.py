"""A measured value is written so that its difference from the bound shows."""

from decimal import Decimal

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.recordings.cases.bounds import Bound, Quantity
from syncrelay.recordings.cases.models import Expectation

COMPARISONS = st.sampled_from(("", "=", "==", "<", "<=", ">", ">="))
COUNTS = st.integers(0, 2_000).map(Decimal)
SHARES = st.integers(1, 200_000).flatmap(lambda of: st.integers(0, of).map(lambda count: Decimal(count) / of))
DURATIONS = st.integers(0, 10**13).map(Decimal)
UNITS = st.sampled_from(("ns", "us", "ms", "s", "min"))
EITHER = st.one_of(
    st.builds(lambda *parts: ("sets", Quantity.COUNT, *parts), COMPARISONS, COUNTS, st.just(""), COUNTS),
    st.builds(
        lambda *parts: ("match_rate", Quantity.SHARE, *parts),
        COMPARISONS,
        SHARES,
        st.sampled_from("%,").map(lambda unit: unit.strip(",")),
        SHARES,
    ),
    st.builds(lambda *parts: ("span_max", Quantity.DURATION, *parts), COMPARISONS, DURATIONS, UNITS, DURATIONS),
)


@given(EITHER)
def test_a_value_that_breaks_a_bound_breaks_it_as_it_is_written_too(drawn):
    key, quantity, comparison, value, unit, found = drawn
    bound = Bound(quantity, comparison, value, unit)
    if not bound.holds(found):
        written = getattr(Expectation.model_validate({key: bound.told(found)}), key)
        assert not bound.holds(written.value)
