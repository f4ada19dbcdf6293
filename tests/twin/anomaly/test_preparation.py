"""Features beside what is usual, smoothed, and beside those of the peers: the stream and arrays agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.anomaly.common_features import left_over, left_over_rows, length, with_tails
from twin.anomaly.preparation import (
    STANDING,
    Preparation,
    Smoothed,
    fit_preparation,
    regime_name,
    smoothed_after,
    smoothed_rows,
    standardised_row,
    standardised_rows,
    unsmoothed,
)

SIGNALS = ("spindle_load_pct", "spindle_rpm", "spindle_temp_c")
NAMES = (STANDING, "O1|1|100", "O1|2|100", "O1|2|50")


def recorded(seconds: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Rows and regimes: two operations of other loads, a standing spindle, and the temperature of a day."""
    rng = np.random.default_rng(1)
    codes = np.arange(seconds) // 100 % 3
    load = np.array([0.0, 20.0, 60.0])[codes] + rng.normal(0.0, 1.0, seconds)
    rpm = np.array([0.0, 8000.0, 3000.0])[codes]
    temp = 30.0 + 5.0 * np.sin(np.arange(seconds) / 700.0) + rng.normal(0.0, 0.2, seconds)
    return np.stack([load, rpm, temp], axis=1), codes


@pytest.fixture(scope="module")
def fitted() -> Preparation:
    return fit_preparation(*recorded(), NAMES, SIGNALS, 1.0)


def test_a_regime_is_what_is_usual_in_it(fitted: Preparation) -> None:
    assert set(fitted.regimes) == set(NAMES[:3]), "of the third there are no rows"
    light, heavy = fitted.regimes["O1|1|100"], fitted.regimes["O1|2|100"]
    assert (light.center[0], heavy.center[0]) == pytest.approx((20.0, 60.0), abs=0.2)
    assert light.spread[0] == pytest.approx(2.97, rel=0.1), "not below a tenth of the spread over all, 29.7"


def test_a_signal_that_the_regime_does_not_explain_has_one_baseline(fitted: Preparation) -> None:
    assert fitted.regimes["O1|1|100"].center[2] == fitted.regimes["O1|2|100"].center[2] == fitted.overall.center[2]


@pytest.mark.parametrize(
    ("row", "context", "name"),
    [
        ((0.0, 49.0, 20.0), ("O1", 1, 100.0), STANDING),
        ((0.0, 50.0, 20.0), ("O1", 1, 100.0), "O1|1|100"),
        ((0.0, 900.0, 20.0), ("O1", 1.0, 96.0), "O1|1|100"),
        ((0.0, 900.0, 20.0), (None, 12, None), "?|12|?"),
    ],
)
def test_what_names_a_regime(fitted: Preparation, row: tuple, context: tuple, name: str) -> None:
    assert regime_name(fitted, row, context) == name


def test_a_program_that_was_not_learned_is_not_judged_and_says_so(fitted: Preparation) -> None:
    other = standardised_row(fitted, (60.0, 3000.0, 30.0), ("O2", 2, 100))
    assert other.unknown == "no baseline for program O2, tool_number 2, feed_override_pct 100"
    assert smoothed_after(fitted, unsmoothed(fitted), other, False, 1, 1.0) == unsmoothed(fitted)


def test_while_the_spindle_stands_only_temperature_tells(fitted: Preparation) -> None:
    now = standardised_row(fitted, (5.0, 0.0, 60.0), ("O1", 1, 100))
    after = smoothed_after(fitted, unsmoothed(fitted), now, False, 3, 1.0)
    assert now.tells == (False, False, True)
    assert after.values[:2] == (0.0, 0.0)
    assert after.values[2] > 0.0
    assert after.ticks[2] == 3


def test_a_gate_freezes_what_was_smoothed(fitted: Preparation) -> None:
    now = standardised_row(fitted, (90.0, 3000.0, 30.0), ("O1", 2, 100))
    before = Smoothed((1.0, 0.0, 0.5), (1, 1, 1))
    assert smoothed_after(fitted, before, now, True, 2, 1.0) == before


def test_the_stream_and_arrays_smooth_alike(fitted: Preparation) -> None:
    rows, codes = recorded(900)
    gated = np.random.default_rng(2).random(900) < 0.2
    values, tells, judged = standardised_rows(fitted, rows, codes, NAMES)
    smooth, last = smoothed_rows(fitted, values, tells & ~gated[:, None], 1.0)
    state = unsmoothed(fitted)
    contexts = [(None, None, None), ("O1", 1, 100), ("O1", 2, 100)]
    for tick in range(900):
        now = standardised_row(fitted, rows[tick].tolist(), contexts[codes[tick]])
        state = smoothed_after(fitted, state, now, bool(gated[tick]), tick, 1.0)
        assert now.values == tuple(values[tick].tolist())
        assert (now.unknown is None) == judged[tick]
        assert state.values == pytest.approx(smooth[tick], abs=1e-12)
        assert state.ticks == tuple(last[tick].tolist())


CELLS = st.integers(1, 8).flatmap(
    lambda machines: st.lists(
        st.tuples(*[st.tuples(st.floats(-9, 9), st.integers(0, 300)) for _ in range(2)]), min_size=machines, max_size=machines
    )
)


@settings(max_examples=200)
@given(cell=CELLS)
def test_the_stream_and_arrays_leave_alike(cell: list) -> None:
    smooth = np.array([[[value for value, _ in machine] for machine in cell]])
    last = np.array([[[tick for _, tick in machine] for machine in cell]])
    left = left_over_rows(smooth, last, np.array([300]), 1.0)
    members = [Smoothed(tuple(value for value, _ in machine), tuple(tick for _, tick in machine)) for machine in cell]
    for place, own in enumerate(members):
        assert left_over(own, [*members[:place], *members[place + 1 :]], 300, 1.0) == tuple(left[0, place].tolist())
        assert all(
            abs(rest) <= abs(value) and rest * value >= 0.0 for rest, value in zip(left[0, place], own.values, strict=True)
        )


LEFT = {
    # own, peers: left
    "no peer": (6.0, [], 6.0),
    "a peer that is quiet": (6.0, [-3.0], 6.0),
    "a peer that feels half of it": (6.0, [3.0], 0.0),
    "a peer that feels a third of it": (6.0, [2.0], 2.0),
    "downwards": (-6.0, [-2.0], -2.0),
    "of five peers the largest": (6.0, [0.0, 0.0, 0.0, 0.0, 9.0], 0.0),
    "of six the second: one broken peer hides nothing": (6.0, [0.0, 0.0, 0.0, 0.0, 1.0, 9.0], 4.0),
}


@pytest.mark.parametrize("case", LEFT.values(), ids=LEFT.keys())
def test_what_is_left(case: tuple) -> None:
    own, peers, expected = case
    members = [Smoothed((value,), (5,)) for value in peers]
    assert left_over(Smoothed((own,), (5,)), members, 5, 1.0) == (expected,)


def test_a_peer_is_remembered_for_two_minutes() -> None:
    own, peer = Smoothed((6.0,), (500,)), Smoothed((6.0,), (380,))
    assert left_over(own, [peer], 500, 1.0) == (0.0,)
    assert left_over(own, [peer], 501, 1.0) == (6.0,)


def test_the_length_is_in_tails_of_either_side(fitted: Preparation) -> None:
    rng = np.random.default_rng(3)
    left = np.abs(rng.normal(0.0, 1.0, (5000, 3))) * np.array([1.0, 2.0, 3.0]) * rng.choice([1.0, -0.1], (5000, 3))
    tailed = with_tails(fitted, left)
    assert tailed.up == pytest.approx((3.2, 6.1, 9.0), rel=0.15)
    assert tailed.down == pytest.approx((0.59, 0.88, 1.17), rel=0.15)
    assert length(tailed, (0.0, 0.0, 0.0)) == 0.0
    tails = left[:50] / np.where(left[:50] > 0.0, tailed.up, tailed.down)
    assert [length(tailed, row.tolist()) for row in left[:50]] == pytest.approx(np.sqrt((tails**2).sum(axis=1)))


def test_a_spindle_that_never_turns_teaches_nothing() -> None:
    with pytest.raises(ValueError, match="turns in none of 500 rows"):
        fit_preparation(np.zeros((500, 3)), np.zeros(500, dtype=int), NAMES, SIGNALS, 1.0)
