"""The start of a short stretch: the twin begins as its recording does, whatever the spindle does in the first seconds."""

from math import exp

import numpy as np
import pytest

from tests.twin.gap.small_case import HOT, case_of
from twin.case import RunKind
from twin.gap.search import explain
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.gap.stages.observed_through import Sensing
from twin.gap.stages.plan import ground_of
from twin.gap.stages.warming import behind_k
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants

assert HOT.thermal is not None
QUICK = HOT.thermal.model_copy(update={"capacity_j_per_k": 3000.0})
SPINDLE = HOT.model_copy(update={"thermal": QUICK, "noise": {"spindle_temp_c": 0.02}})
SECONDS, RUNS_UP_S, LOAD_PCT = {"fit": 85.0, "check": 45.0}, 6.0, 12.0
SLOPE_K_PER_S = 0.01


def healthy_stage() -> HeatStage:
    """Two minutes of a healthy spindle that begins to turn a few seconds after each stretch does."""
    columns = {}
    for number, (name, seconds) in enumerate(SECONDS.items()):
        t_s = np.arange(0.0, seconds, 1.0)
        rpm = np.where(t_s < RUNS_UP_S, 0.0, 12_000.0)
        load, ambient = np.where(rpm > 0.0, LOAD_PCT, 0.0), np.full(len(t_s), 21.5)
        true = spindle_temperature_c(thermal_constants(QUICK), Warming(t_s, load, rpm, ambient), 30.0)[0]
        noise = SPINDLE.noise["spindle_temp_c"] * np.random.default_rng(number).standard_normal(len(t_s))
        heats = {"spindle_rpm": rpm, "spindle_load_pct": load, "ambient_temp_c": ambient}
        columns[name] = {"t_s": t_s, "spindle_temp_c": true + noise, **heats}
    ground = ground_of(case_of(SPINDLE, columns, RunKind.WARMUP), frozenset())
    return HeatStage(SPINDLE, heat_runs(SPINDLE, ground.runs), ground.floors)


def test_a_healthy_spindle_that_begins_to_turn_as_a_short_stretch_begins_is_followed_and_nothing_is_named() -> None:
    stage = healthy_stage()
    found = explain(stage)
    assert found.best.effects == ()
    assert found.base.left.gap() < stage.healthy_rms


@pytest.mark.parametrize(
    ("effect", "values", "behind"),
    [
        ("sensor_bias", {"bias": 7.0}, 0.0),
        ("sensor_scale", {"scale": 1.3}, 0.0),
        ("sensor_delay", {"delay_s": 60.0}, 60.0),
        ("sensor_lag", {"time_constant_s": 60.0}, 60.0 * (1.0 - exp(-1200.0 / 60.0))),
    ],
)
def test_only_a_late_sensor_is_behind_an_even_warming(effect: str, values: dict[str, float], behind: float) -> None:
    sensing = Sensing({effect: {name: np.array([value]) for name, value in values.items()}})
    assert behind_k(sensing, SLOPE_K_PER_S, 1)[0] == pytest.approx(SLOPE_K_PER_S * behind, abs=0.03)
