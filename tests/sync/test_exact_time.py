import pytest
from timeline import play_policy

from syncrelay.sync import ExactTime

CASES = {
    "equal stamps on all inputs are a set": (
        ExactTime(n_inputs=2, queue_size=10),
        """
        left  |ab.c
        right |.B.C
        arrive: a B b C c
        -> b: a superseded, bB
        -> c: cC
        """,
    ),
}


@pytest.mark.parametrize(("subject", "drawing"), CASES.values(), ids=CASES)
def test_drawn(subject, drawing):
    left, drawn = play_policy(subject, drawing)
    assert left == drawn
