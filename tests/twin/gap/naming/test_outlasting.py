"""A lag that is longer than the recording is a trend: it is not named, whatever it fits."""

import numpy as np
import pytest

from tests.twin.gap.small_case import HOT, case_of
from twin.case import Case, RunKind
from twin.gap.diagnosis import Effected
from twin.gap.naming.outlasting import outlasts
from twin.gap.search import explain
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.gap.stages.plan import ground_of
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants

LAG = Effected("sensor_lag", "spindle_temp_c")
MORE_COOLING = {"speed_convection__gain": 3.0, "speed_convection__exponent": 0.7}
SECONDS = 110.0


def short_case() -> Case:
    """Two minutes of a spindle that is cooled more while it turns, as production turns it."""
    assert HOT.thermal is not None
    columns = {}
    for number, name in enumerate(("fit", "check")):
        t_s = np.arange(0.0, SECONDS, 0.5)
        rpm = np.where((t_s // (14.0 + 5.0 * number)) % 2 == 1.0, 8000.0, 2500.0)
        load, ambient = np.full(len(t_s), 4.0), np.full(len(t_s), 21.5)
        constants = thermal_constants(HOT.thermal) | MORE_COOLING
        true = spindle_temperature_c(constants, Warming(t_s, load, rpm, ambient), 30.0, effects=["speed_convection"])[0]
        noise = HOT.noise["spindle_temp_c"] * np.random.default_rng(number).standard_normal(len(t_s))
        heats = {"spindle_rpm": rpm, "spindle_load_pct": load, "ambient_temp_c": ambient}
        columns[name] = {"t_s": t_s, "spindle_temp_c": true + noise, **heats}
    return case_of(HOT, columns, RunKind.WARMUP)


@pytest.fixture(scope="module")
def stage() -> HeatStage:
    case = short_case()
    ground = ground_of(case, frozenset())
    return HeatStage(HOT, heat_runs(HOT, ground.runs), ground.floors)


def test_a_lag_longer_than_the_recording_outlasts_it_and_a_shorter_one_does_not(stage: HeatStage) -> None:
    assert stage.lasts_s == pytest.approx(SECONDS, abs=1.0)
    assert outlasts(stage, LAG, {"time_constant_s": SECONDS + 1.0})
    assert not outlasts(stage, LAG, {"time_constant_s": 0.5 * SECONDS})
    assert not outlasts(stage, Effected("sensor_bias", "spindle_temp_c"), {"bias": 1000.0})


def test_what_cools_the_spindle_is_not_taken_for_a_sensor_of_twenty_minutes(stage: HeatStage) -> None:
    found = explain(stage)
    assert [e.effect for e in found.best.effects] == ["speed_convection"]
    assert all(
        t.found is None or t.found.values[LAG]["time_constant_s"] <= stage.lasts_s for t in found.tried if t.effected == LAG
    )
