"""The alarm: dwell, hysteresis, what a gate does to both, and that the stream and arrays agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from twin.anomaly.alarm import AlarmRule, AlarmState, after_tick, dwell_score, is_alarm, onsets

RULE = AlarmRule(threshold=10.0, dwell_ticks=2, clear_fraction=0.8)
CASES = {
    # scores as digits (a = 10), g = gated, ? = not known: alarm (#)
    "nothing": ("000000", "......"),
    "one tick is no alarm": ("0a0a0a", "......"),
    "the dwell'th tick is": ("0aaa00", "..###."),
    "it stays on above what clears": ("aa999a", ".#####"),
    "it clears after as many ticks": ("aa7700", ".##..."),
    "one low tick clears nothing": ("aa07a0a0", ".##....."),
    "one low tick between high ones": ("aa0aa00", ".#####."),
    "a gate interrupts the dwell": ("agaa", "...#"),
    "a gate clears nothing": ("aaggggaa", ".#######"),
    "nor does silence": ("aa????aa", ".#######"),
    "a gate interrupts the clearing": ("aa0g0g0a", ".#######"),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_when_it_is_on(case: tuple[str, str]) -> None:
    marks, expected = case
    state, told = AlarmState(), ""
    for mark in marks:
        score = None if mark == "?" else float(int(mark, 11)) if mark != "g" else 0.0
        state = after_tick(RULE, state, score, mark == "g")
        told += "#" if state.is_on else "."
    assert told == expected


@pytest.mark.parametrize(
    ("marks", "expected"),
    [
        ("aa00aa000", ".########"),  # what shows again within the time is one alarm
        ("aa0000aa", ".####..#"),
        ("aa0g0?00aa", ".######..#"),  # a gate and silence are waited for
    ],
)
def test_an_alarm_is_waited_for_where_calm_ticks_are_asked(marks: str, expected: str) -> None:
    rule, state, told = AlarmRule(10.0, 2, 0.8, calm_ticks=4), AlarmState(), ""
    for mark in marks:
        state = after_tick(rule, state, None if mark == "?" else float(int(mark, 11)) if mark != "g" else 0.0, mark == "g")
        told += "#" if state.is_on else "."
    assert told == expected


@given(
    ticks=st.lists(st.tuples(st.one_of(st.none(), st.floats(-20, 20)), st.booleans()), min_size=1, max_size=60),
    dwell=st.integers(1, 6),
    fraction=st.sampled_from([0.5, 0.8, 1.0]),
    calm=st.sampled_from([0, 1, 2, 7]),
)
def test_the_stream_and_arrays_agree(ticks: list[tuple[float | None, bool]], dwell: int, fraction: float, calm: int) -> None:
    rule, state, told = AlarmRule(3.0, dwell, fraction, calm), AlarmState(), []
    for score, is_gated in ticks:
        state = after_tick(rule, state, score, is_gated)
        told.append(state.is_on)
    scores = np.array([np.nan if score is None else score for score, _ in ticks])
    assert is_alarm(rule, scores, np.array([gated for _, gated in ticks])).tolist() == told


def test_machines_are_judged_each_by_itself() -> None:
    scores = np.array([[10.0, 0.0], [10.0, 10.0], [0.0, 10.0], [0.0, 10.0]])
    on = is_alarm(RULE, scores, np.zeros(scores.shape, dtype=bool))
    assert on.T.astype(int).tolist() == [[0, 1, 1, 0], [0, 0, 1, 1]]
    assert onsets(on[:, 0]).tolist() == [1]


def test_a_dwell_longer_than_the_recording_alarms_never() -> None:
    assert (dwell_score(np.ones(3), np.zeros(3, dtype=bool), 5) == -np.inf).all()


@pytest.mark.parametrize("wrong", [{"threshold": 0.0}, {"dwell_ticks": 0}, {"clear_fraction": 1.1}, {"calm_ticks": -1}])
def test_rules_that_mean_nothing_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        AlarmRule(**({"threshold": 1.0} | wrong))  # type: ignore[arg-type]
