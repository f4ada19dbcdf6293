"""The load meter and its effects explain the recorded load of an independent reference machine down to its noise.

The power of the cut comes from the recorded motion and the stated tool; the efficiency takes up what the coefficient is off.
"""

from functools import cache

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.optimize import least_squares

from tests.recordings import recording
from twin.machine import read_machine
from twin.process.milling import Milling, milling_force, tool_constants
from twin.spindle.load import Array, spindle_constants, spindle_load_pct

NOMINAL = {"efficiency": 0.85, "idle_power_kw": 0.25}
HOLD = {"load_peak_hold__hold_s": 0.5}
DROP = {"load_dependent_efficiency__drop": 0.3, "load_dependent_efficiency__knee_kw": 0.6}


@cache
def cut(case: str, name: str) -> tuple[Array, Array, Array]:
    """Power of the cut at each tick, spindle speed, and the load where there is a sample."""
    table = pq.read_table(recording(f"../cases/{case}/runs/{name}.parquet"))
    log = {column: table[column].to_numpy() for column in table.column_names}
    speed = [np.gradient(log[f"{axis}_ref_mm"]) / 0.001 for axis in "xy"]
    arc = [log[name] for name in ("axial_depth_mm", "entry_angle_rad", "exit_angle_rad")]
    machine = read_machine(recording(f"../cases/{case}/machine.toml"))
    assert machine.tool is not None
    motion = Milling(log["spindle_angle_rad"], log["spindle_rpm"], *speed, *arc)
    force = milling_force(tool_constants(machine.tool), machine.tool.teeth, motion)
    return force.cutting_power_w()[0], log["spindle_rpm"], log["spindle_load_pct"]


def residual(case: str, name: str, values: dict[str, float], effects: tuple[str, ...]) -> Array:
    machine = read_machine(recording(f"../cases/{case}/machine.toml"))
    assert machine.spindle is not None
    power, rpm, load = cut(case, name)
    shown = spindle_load_pct(spindle_constants(machine.spindle) | values, power, rpm, effects=effects)[0]
    return (shown - load)[np.isfinite(load)]


def fitted(case: str, effects: tuple[str, ...], start: dict[str, float]) -> tuple[dict[str, float], float, float]:
    """Return what was found, and the rms on the run that was fitted and on another program."""
    names = tuple(NOMINAL | start)
    first = np.array(list((NOMINAL | start).values()))

    def off(values: Array, name: str = "cut_fit") -> Array:
        return residual(case, name, dict(zip(names, values.tolist(), strict=True)), effects)

    found = least_squares(off, first).x
    rms = [float(np.sqrt(np.mean(off(found, name) ** 2))) for name in ("cut_fit", "cut_check")]
    return dict(zip(names, found.tolist(), strict=True)), rms[0], rms[1]


NOISE_PCT = 0.153
"""0.15 % of the sensor, and its last digit of 0.1 %."""


@pytest.mark.parametrize("case", ["case_09", "case_16", "case_18"])
def test_two_constants_explain_the_load_of_a_healthy_meter(case: str) -> None:
    values, fit, check = fitted(case, (), {})
    assert fit < 1.25 * NOISE_PCT and check < 1.25 * NOISE_PCT
    assert values["idle_power_kw"] == pytest.approx(0.25, rel=0.06)


@pytest.mark.parametrize(
    ("case", "effect", "start", "stated"),
    [("case_11", "load_peak_hold", HOLD, 0.98617), ("case_12", "load_dependent_efficiency", DROP, 0.47712)],
)
def test_an_effect_explains_what_constants_cannot(case: str, effect: str, start: dict[str, float], stated: float) -> None:
    _, without, _ = fitted(case, (), {})
    values, fit, check = fitted(case, (effect,), start)
    assert without > 3.0 * NOISE_PCT
    assert fit < 1.25 * NOISE_PCT and check < 1.25 * NOISE_PCT
    assert values[next(iter(start))] == pytest.approx(stated, rel=0.06)
