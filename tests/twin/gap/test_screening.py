"""Signatures: what to fit, and where to start."""

import numpy as np
import pytest

from tests.twin.gap.one_line import BIAS, SAMPLES, SCALE, OneLine
from twin.gap.diagnosis import Effected
from twin.gap.fitting import fitted
from twin.gap.screening import guesses, sensitivities
from twin.gap.stages.stage import Model


def screened(stage: OneLine) -> dict[object, tuple[float, float]]:
    """Candidate → (what its first guess closes, its value there)."""
    bare = Model(stage.constants, ())
    parent = fitted(stage, bare, bare.null_theta())
    slopes = sensitivities(stage, parent)
    found = {}
    for candidate in stage.candidates:
        best = guesses(stage, parent, candidate, slopes)[0]
        values = bare.with_effect(candidate).values(best.theta[None, :])[candidate]
        found[candidate] = (best.closes, float(next(iter(values.values()))[0]))
    return found


def test_the_signature_of_the_effect_closes_most_and_says_where_to_start() -> None:
    found = screened(OneLine(bias=2.0))
    assert found[BIAS][0] > 0.9 > found[SCALE][0]
    assert found[BIAS][1] == pytest.approx(2.0, abs=0.3)


class Suggesting(OneLine):
    """A line whose recordings suggest a bias twenty times too large."""

    def first_guesses(self, candidate: Effected) -> tuple[dict[str, float], ...]:
        """A bias of 40."""
        return ({"bias": 40.0},) if candidate == BIAS else ()


def test_a_suggested_size_that_is_far_too_large_hides_no_effect() -> None:
    closes, start = screened(Suggesting(bias=2.0))[BIAS]
    assert closes > 0.9
    assert start == pytest.approx(40.0)
    assert screened(Suggesting(bias=-2.0))[BIAS][0] == 0.0, "the other way round it does not help"


def test_what_the_constants_can_do_is_no_merit_of_a_candidate() -> None:
    found = screened(OneLine(slope=1.04))
    assert found[SCALE][0] < 0.2
    assert found[BIAS][0] < 0.2


def test_samples_that_were_not_recorded_hide_no_signature() -> None:
    stage = OneLine(bias=2.0)
    for observed in stage.observed:
        observed.measured[np.arange(SAMPLES) % 50 != 0] = np.nan
    found = screened(stage)
    assert found[BIAS][0] > 0.9 > found[SCALE][0]
    assert found[BIAS][1] == pytest.approx(2.0, abs=0.3)


def test_a_free_number_at_its_bound_is_not_probed_beyond_it() -> None:
    stage = OneLine(bias=1.0)
    model = Model(stage.constants, (SCALE,))
    parent = fitted(stage, model, model.null_theta())
    parent.theta[1] = model.free[1].high
    assert all(np.isfinite(slope).all() for slope in sensitivities(stage, parent))
    assert model.free[1].value(parent.theta[1:2]) == pytest.approx(1e4)
