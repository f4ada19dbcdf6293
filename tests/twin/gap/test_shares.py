"""Shares of the causes, and the closure that they add up to."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.gap.diagnosis import Effected, closure_of
from twin.gap.shares import shapley

NAMES = tuple(Effected("gravity", letter) for letter in "xyzabc")
RMS = st.floats(0.0, 1e6)


@given(st.integers(0, 6), st.integers(0, 10_000))
def test_shares_add_up_to_what_all_causes_close(count: int, seed: int) -> None:
    draw = np.random.default_rng(seed)
    closed = {frozenset(): 0.0}

    def value(some: frozenset[Effected]) -> float:
        return closed.setdefault(some, float(draw.uniform(0.0, 1.0)))

    shares = shapley(NAMES[:count], value)
    whole = value(frozenset(NAMES[:count]))
    alone = [value(frozenset(NAMES[:count]) - {n}) < whole for n in NAMES[:count]]
    if count <= 4 or any(alone):
        assert sum(shares.values()) == pytest.approx(whole if count else 0.0)


def test_causes_that_do_the_same_share_it_alike() -> None:
    shares = shapley(NAMES[:2], lambda some: 0.8 * bool(some))
    assert list(shares.values()) == pytest.approx([0.4, 0.4])


@given(RMS, RMS, RMS)
def test_closure_is_the_formula_and_between_none_and_all(before: float, after: float, floor: float) -> None:
    closure = closure_of(before, after, floor)
    assert 0.0 <= closure <= 1.0
    reducible = before**2 - floor**2
    if reducible > 0.0:
        assert closure == pytest.approx(np.clip(1.0 - (after**2 - floor**2) / reducible, 0.0, 1.0))
    else:
        assert closure == 0.0


@given(st.floats(1.1, 1e3), st.floats(0.0, 1.0))
def test_what_leaves_less_closes_more(before: float, part: float) -> None:
    less, more = 1.0 + part * (before - 1.0), before
    assert closure_of(before, less, 1.0) >= closure_of(before, more, 1.0)
