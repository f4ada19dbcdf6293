"""The curve of a life rises from 0 to 1 whatever lives were like, so that it can be inverted."""

from hypothesis import given
from hypothesis import strategies as st

from twin.wear.curve import KNOTS, LINE, at, mean_curve, slope

LEVELS = st.lists(st.floats(-0.2, 0.6), min_size=KNOTS + 1, max_size=KNOTS + 1)


@given(st.lists(LEVELS, max_size=8), st.floats(-1.0, 3.0), st.floats(0.01, 1.0))
def test_it_rises_everywhere(lives: list[list[float]], share: float, more: float) -> None:
    curve = mean_curve(lives)
    assert (curve[0], curve[-1]) == (0.0, 1.0)
    assert at(curve, share + more) > at(curve, share)
    assert slope(curve, share) > 0.0


def test_without_lives_it_is_a_line() -> None:
    assert all(abs(one - other) < 1e-12 for one, other in zip(mean_curve([]), LINE, strict=True))
