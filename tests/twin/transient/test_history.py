"""A history is a value, whatever is appended to it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from twin.transient.history import History
from twin.transient.matching import append

wholes = st.lists(st.integers(-(2**19), 2**19).map(float), max_size=60)


def appended(history: History, values: list[float]) -> History:
    for value in values:
        history = history.with_room()
        append(history.rows, history.end, value, value + 1.0, -1.0)
        history = history.grown()
    return history


@given(values=wholes)
def test_it_keeps_the_last_samples_and_their_exact_sums(values: list[float]) -> None:
    history = appended(History.empty(10, 2), values)
    kept = values[-10:]
    assert history.kept()[0].tolist()[-len(kept) :] == kept
    assert history.seen == len(values)
    for n in range(len(kept) + 1):
        window = values[len(values) - n :]
        sums, squares = history.rows[1], history.rows[2]
        assert sums[history.end] - sums[history.end - n] == sum(window)
        assert squares[history.end] - squares[history.end - n] == sum(value * value for value in window)


@given(before=wholes, one=wholes, other=wholes)
def test_two_histories_that_go_on_from_one_do_not_touch_each_other(
    before: list[float], one: list[float], other: list[float]
) -> None:
    base = appended(History.empty(10, 2), before)
    first = appended(base, one)
    said = first.kept().tolist()
    second = appended(base, other)
    assert first.kept().tolist() == said
    assert base.kept()[0].tolist()[-min(10, len(before)) :] == before[-10:] or not before
    assert second.kept()[0].tolist() == (before + other)[len(before + other) - second.kept().shape[1] :]


@given(values=wholes, more=wholes)
def test_it_comes_back_from_what_it_kept(values: list[float], more: list[float]) -> None:
    history = appended(History.empty(10, 2), values)
    again = History.of(history.kept().tolist(), 10, history.seen)
    np.testing.assert_array_equal(appended(again, more).kept()[:, -5:], appended(history, more).kept()[:, -5:])
