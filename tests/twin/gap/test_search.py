"""The search for effects, on a line that is read with a bias or a scale."""

import numpy as np
import pytest

from tests.twin.gap.one_line import BIAS, SAMPLES, SCALE, OneLine
from twin.gap.diagnosis import Effected, Verdict
from twin.gap.search import explain
from twin.gap.verdict import judged, overall


def test_a_healthy_stage_has_no_effect() -> None:
    found = explain(OneLine(slope=1.03))
    assert found.best.effects == ()
    assert judged(found).verdict is Verdict.HEALTHY


@pytest.mark.parametrize("bias", [0.5, -2.0, 40.0])
def test_the_effect_that_is_there_is_found_with_its_size(bias: float) -> None:
    found = explain(OneLine(bias=bias))
    assert found.best.effects == (BIAS,)
    assert found.best.values[BIAS]["bias"] == pytest.approx(bias, abs=0.05)
    assert judged(found).verdict is Verdict.EXPLAINED


def test_a_sensor_in_another_unit_is_found_with_its_factor() -> None:
    found = explain(OneLine(slope=1000.0))
    assert found.best.effects == (SCALE,)
    assert found.best.values[SCALE]["scale"] == pytest.approx(1000.0, rel=0.2)  # and the slope is known to 5 %


def test_a_machine_that_is_known_exactly_can_be_searched_too() -> None:
    assert explain(OneLine(constants=())).best.effects == ()
    assert explain(OneLine(bias=2.0, constants=())).best.effects == (BIAS,)


def test_two_effects_are_both_found() -> None:
    found = explain(OneLine(slope=1.6, bias=-1.0))
    assert set(found.best.effects) == {BIAS, SCALE}


def test_an_effect_that_is_left_out_is_not_named_and_leaves_a_gap() -> None:
    found = explain(OneLine(bias=2.0, candidates=()))
    assert found.best.effects == ()
    assert judged(found).verdict is Verdict.UNKNOWN


def test_all_candidates_are_in_what_was_tried_best_first() -> None:
    found = explain(OneLine(bias=2.0))
    assert {t.effected for t in found.tried} == {BIAS, SCALE}
    gains = [-np.inf if t.over is None else t.over.gain for t in found.tried]
    assert gains == sorted(gains, reverse=True)


def test_the_machine_is_as_well_known_as_its_stages() -> None:
    healthy, named, unknown = (
        judged(explain(stage)) for stage in (OneLine(), OneLine(bias=2.0), OneLine(bias=2.0, candidates=()))
    )
    assert overall([healthy]) is Verdict.HEALTHY
    assert overall([healthy, named]) is Verdict.EXPLAINED
    assert overall([named, unknown]) is Verdict.PARTLY
    assert overall([healthy, unknown]) is Verdict.UNKNOWN


def test_what_a_few_samples_within_their_floor_cannot_tell_apart_is_one_class() -> None:
    def told(floor: float) -> set[Effected]:
        stage = OneLine(bias=2.0)
        judged = stage.observed[1]
        judged.floor[:] = judged.sigma[:] = floor
        judged.measured[~np.isin(np.arange(SAMPLES), np.arange(340, SAMPLES, 8))] = np.nan
        found = explain(stage)
        return {e for one in found.best.effects for e in (one, *found.rivals.get(one, ()))}

    assert told(0.7) == {BIAS, SCALE}
    assert told(0.02) == {BIAS}
