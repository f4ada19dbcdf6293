"""The gate opens early, is confirmed or retracted, and does not care about restarts."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import synthetic_changes as drive
from tests.twin.transient.synthetic import small
from twin.transient.detector import Detector, Phase, State, restored
from twin.transient.replay import Outcome, replayed
from twin.transient.stream import Stream

Floats = NDArray[np.float64]


def quiet(seconds: float) -> Floats:
    return np.ones(round(seconds / 0.1))


def stream_of(*pieces: Floats) -> Stream:
    values = np.concatenate(pieces)
    return Stream(0.1, 0.0, values, np.full(len(values), -1.0), np.full(len(values), -1.0))


def outcome_of(*pieces: Floats) -> Outcome:
    return replayed(small().detector, stream_of(*pieces))


def phases(detector: Detector, values: Floats) -> list[Phase]:
    state, seen = detector.begun(), []
    for value in values:
        state, _ = detector.advanced(state, value, -1.0, -1.0)
        if not seen or seen[-1] is not state.gate.phase:
            seen.append(state.gate.phase)
    return seen


@pytest.mark.parametrize("stretch", [0.7, 0.85, 1.0, 1.2, 1.5])
@pytest.mark.parametrize(("stall_s", "stall_at_s"), [(0.0, 3.0), (2.0, 3.5), (4.0, 2.2), (4.0, 6.5)])
def test_a_change_is_confirmed_however_it_is_stretched_and_stalled(stretch: float, stall_s: float, stall_at_s: float) -> None:
    change = drive.changed(stretch, stall_s, stall_at_s)
    outcome = outcome_of(quiet(30.0), change, quiet(20.0))
    assert len(outcome.confirmed) == 1
    found = outcome.confirmed[0]
    assert found.begun_s == pytest.approx(30.0, abs=2.0)
    assert found.at_s == pytest.approx(30.0 + 0.1 * len(change), abs=3.0)


def test_the_gate_opens_while_the_spindle_stops_and_is_confirmed_when_it_runs_again() -> None:
    change = drive.changed(1.0, 0.0, 3.0)
    outcome = outcome_of(quiet(30.0), change, quiet(20.0))
    opened_s = outcome.confirmed[0].opened_s
    assert opened_s is not None and opened_s < 30.0 + 4.0
    active_s = 0.1 * np.flatnonzero(outcome.active)
    assert active_s[0] == pytest.approx(opened_s) and np.all(np.diff(active_s) < 0.11)
    values = np.concatenate([quiet(30.0), change, quiet(20.0)])
    assert phases(small().detector, values) == [Phase.NONE, Phase.PROVISIONAL, Phase.CONFIRMED, Phase.NONE]


def test_a_stop_without_a_restart_is_retracted() -> None:
    stop = drive.changed(1.0, 0.0, 3.0)[:22]
    values = np.concatenate([quiet(30.0), stop, np.full(600, stop[-1])])
    assert phases(small().detector, values) == [Phase.NONE, Phase.PROVISIONAL, Phase.RETRACTED, Phase.NONE]


def test_two_changes_soon_after_one_another_are_two() -> None:
    change = drive.changed(1.0, 0.0, 3.0)
    assert len(outcome_of(quiet(30.0), change, quiet(3.0), change, quiet(20.0)).confirmed) == 2


def test_a_change_of_another_size_is_none() -> None:
    change = drive.changed(1.0, 0.0, 3.0)
    assert outcome_of(quiet(30.0), 1.0 + 0.2 * (change - 1.0), quiet(20.0)).confirmed == ()
    assert outcome_of(quiet(30.0), 1.0 + 6.0 * (change - 1.0), quiet(20.0)).confirmed == ()


def test_what_lies_between_has_to_look_right() -> None:
    change = drive.changed(1.0, 0.0, 3.0)
    between = change.copy()
    between[28:62] = 4.0
    assert len(outcome_of(quiet(30.0), change, quiet(20.0)).confirmed) == 1
    assert outcome_of(quiet(30.0), between, quiet(20.0)).confirmed == ()


def carried_over(state: State) -> State:
    """Through the JSON of a snapshot."""
    kept = [[int(value) for value in row] for row in state.history.kept()]
    return restored(kept, state.history.length, state.history.seen, list(state.gate))


@pytest.mark.parametrize("cut", [1, 37, 310, 350, 395, 420, 700])
@pytest.mark.parametrize("period_s", [0.1, 0.01])
def test_a_restart_in_the_middle_changes_nothing_to_the_bit(cut: int, period_s: float) -> None:
    detector = small().detector
    if period_s < 0.1:  # as if it were ten times as fast: the bank is matched at each fourth sample only
        detector = replace(detector, template=replace(detector.template, period_s=period_s, stall_s=0.4))
    rng = np.random.default_rng(cut)
    values = np.concatenate([quiet(30.0), drive.changed(1.1, 0.1, 3.0), quiet(40.0)])
    values = values + drive.noise(len(values), 10.0, rng)
    whole = again = detector.begun()
    for n, value in enumerate(values):
        if n == cut:
            again = carried_over(again)
        whole, found = detector.advanced(whole, value, float(n % 7), -1.0)
        again, same = detector.advanced(again, value, float(n % 7), -1.0)
        assert found == same and whole.gate == again.gate


def test_a_step_that_is_taken_again_gives_the_same() -> None:
    detector = small().detector
    state = detector.begun()
    for value in drive.changed(1.0, 0.0, 3.0):
        other, _ = detector.advanced(state, -5.0, -1.0, -1.0)
        del other
        first, _ = detector.advanced(state, value, -1.0, -1.0)
        second, _ = detector.advanced(state, value, -1.0, -1.0)
        assert first.gate == second.gate and first.history.kept().tolist() == second.history.kept().tolist()
        state = second
