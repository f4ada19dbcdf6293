"""Air that is warmer at the spindle than at the thermometer, for an hour or two, is no effect of the machine."""

import numpy as np
import pytest

from tests.twin.gap.small_case import HOT, case_of
from twin.case import Case, RunKind
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Effected
from twin.gap.fitting import fitted
from twin.gap.naming.of_the_air import unless_of_the_air
from twin.gap.search import Explained, bare_fit
from twin.gap.stages.heat import HeatStage, heat_runs
from twin.gap.stages.plan import ground_of
from twin.gap.stages.stage import Model
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants

BIAS = Effected("sensor_bias", "spindle_temp_c")
HOURS, AIR_C = {"fit": 4.0, "check": 2.0}, 21.5


def production(warmer_k: float, step_c: float = 0.1, hours: dict[str, float] = HOURS) -> Case:
    """Hours of production in which the air at the spindle is warmer than is read, while it is judged."""
    assert HOT.thermal is not None
    columns = {}
    for number, (name, length) in enumerate(hours.items()):
        t_s = np.arange(0.0, 3600.0 * length, 2.0)
        rpm = np.where(t_s % 900.0 < 600.0, 8000.0 + 1000.0 * (t_s // 900.0 % 3.0), 0.0)
        load = np.where(rpm > 0.0, 20.0, 0.0)
        air = np.full(len(t_s), AIR_C + number * warmer_k)
        true = spindle_temperature_c(thermal_constants(HOT.thermal), Warming(t_s, load, rpm, air), 30.0)[0]
        read = true + 0.03 * np.random.default_rng(number).standard_normal(len(t_s))
        heats = {"spindle_rpm": rpm, "spindle_load_pct": load, "ambient_temp_c": np.full(len(t_s), AIR_C)}
        columns[name] = {"t_s": t_s, "spindle_temp_c": np.round(read / step_c) * step_c, **heats}
    machine = HOT.model_copy(update={"noise": {"spindle_temp_c": 0.04}})
    return case_of(machine, columns, RunKind.WARMUP)


def with_a_bias(case: Case) -> tuple[HeatStage, Explained]:
    """The heat of a case, and an answer that names a bias for it."""
    ground = ground_of(case, frozenset())
    stage = HeatStage(case.machine, heat_runs(case.machine, ground.runs), ground.floors)
    model = Model(stage.constants, (BIAS,))
    return stage, Explained(stage, bare_fit(stage), fitted(stage, model, model.null_theta()), (), {BIAS: ()}, {})


@pytest.mark.parametrize(
    ("warmer_k", "hours", "step_c", "named"),
    [
        (0.2, HOURS, 0.1, False),
        (1.5, HOURS, 0.1, True),  # more than air does
        (0.2, {"fit": 1.0, "check": 0.5}, 0.1, True),  # too short for it
        (0.2, HOURS, 0.001, True),  # a thermometer where it matters
    ],
)
def test_what_air_may_do_from_hour_to_hour_has_no_name(
    warmer_k: float, hours: dict[str, float], step_c: float, named: bool
) -> None:
    stage, found = with_a_bias(production(warmer_k, step_c, hours))
    kept = unless_of_the_air(stage, found)
    assert kept.best.effects == ((BIAS,) if named else ())
    assert kept.alike == (() if named else (BIAS,))


def test_air_that_is_a_little_warmer_where_the_spindle_is_judged_is_no_cause() -> None:
    assert diagnose(production(0.25)).diagnosis.causes == ()
