"""Numbers in sentences: those that differ never read alike, and those that need no digits get none."""

import math

from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core.units import METRES, MORE_DIGITS, NEWTONS, SECONDS, Measured, degrees_meant, told_apart

numbers = st.builds(
    Measured,
    st.one_of(st.floats(-10.0, 10.0), st.sampled_from([3.0, 3.2, 3.207, math.nan, math.inf])),
    st.sampled_from([METRES, NEWTONS, SECONDS]),
    st.sampled_from(["", ".2f", "g", ".1e"]),
)


@given(st.lists(numbers, max_size=5))
def test_those_that_differ_never_read_alike(shown):
    plain, texts = [number.text() for number in shown], told_apart(shown)
    for a, said_a, plain_a in zip(shown, texts, plain, strict=True):
        assert plain_a == said_a or plain.count(plain_a) > 1
        for b, said_b in zip(shown, texts, strict=True):
            if a.text(MORE_DIGITS) != b.text(MORE_DIGITS) and a.unit is b.unit and a.spec == b.spec:
                assert said_a != said_b


@given(st.lists(st.sampled_from([3.0, 3.2, 3.207, 4.0]), min_size=2, max_size=4))
def test_equal_numbers_read_alike(values):
    texts = told_apart([Measured(value, NEWTONS) for value in values])
    for a, said_a in zip(values, texts, strict=True):
        for b, said_b in zip(values, texts, strict=True):
            assert (a == b) == (said_a == said_b)


def test_only_what_is_more_than_a_turn_may_be_degrees():
    assert degrees_meant(-90) == ": values are radians, and -90 degrees are -1.57"
    assert degrees_meant(2 * math.pi) == degrees_meant(math.inf) == degrees_meant(math.nan) == ""
