"""The nominal cut and its effects explain the forces of an independent reference machine down to the sensor.

The recorded reference has 5 decimals, so its speed is taken by central differences; ticks at which a rounded angle leaves open
whether a tooth is in the cut are left out.
"""

from functools import cache

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tests.recordings import recording
from twin.machine import read_machine
from twin.process.jump import at_a_jump
from twin.process.milling import Milling, milling_force, tool_constants

Array = NDArray[np.float64]
NOMINAL = ("tangential_coefficient_n_per_mm2", "radial_ratio")


@cache
def run(case: str, name: str) -> dict[str, Array]:
    table = pq.read_table(recording(f"../cases/{case}/runs/{name}.parquet"))
    return {column: table[column].to_numpy() for column in table.column_names}


def motion(log: dict[str, Array]) -> Milling:
    speed = [np.gradient(log[f"{axis}_ref_mm"]) / 0.001 for axis in "xy"]
    return Milling(
        log["spindle_angle_rad"], log["spindle_rpm"], *speed, log["axial_depth_mm"], log["entry_angle_rad"], log["exit_angle_rad"]
    )


def floor_n(case: str) -> float:
    """Repeatability: rms of the difference of two runs of one program, over √2."""
    one, other = run(case, "cut_fit"), run(case, "cut_fit_2")
    return float(np.sqrt(np.mean([(one[name] - other[name]) ** 2 for name in ("force_x_n", "force_y_n")]) / 2.0))


def residual_n(case: str, name: str, values: Array, names: tuple[str, ...], effects: tuple[str, ...]) -> Array:
    machine = read_machine(recording(f"../cases/{case}/machine.toml"))
    assert machine.tool is not None
    log = run(case, name)
    cut = motion(log)
    told = ~at_a_jump(cut, machine.tool.teeth, 2e-4)[0]
    constants = tool_constants(machine.tool) | dict(zip(names, values.tolist(), strict=True))
    force = milling_force(constants, machine.tool.teeth, cut, effects=effects)
    return np.concatenate([(force.force_x_n[0] - log["force_x_n"])[told], (force.force_y_n[0] - log["force_y_n"])[told]])


def fitted(
    case: str, effects: tuple[str, ...] = (), start: dict[str, float] | None = None
) -> tuple[dict[str, float], float, float]:
    """Constants and parameters from the first run; rms there, and on a program that was not fitted, over the floor."""
    names = (*NOMINAL, *(start or {}))
    first = np.array([900.0, 0.4, *(start or {}).values()])
    found = least_squares(lambda values: residual_n(case, "cut_fit", values, names, effects), first, x_scale=first).x
    rms = [float(np.sqrt(np.mean(residual_n(case, name, found, names, effects) ** 2))) for name in ("cut_fit", "cut_check")]
    return dict(zip(names, found.tolist(), strict=True)), rms[0] / floor_n(case), rms[1] / floor_n(case)


@pytest.mark.parametrize("case", ["case_09", "case_11", "case_12", "case_16", "case_18"])
def test_two_constants_explain_the_forces_to_the_floor(case: str) -> None:
    values, fit, check = fitted(case)
    assert fit < 1.03 and check < 1.03
    assert values["radial_ratio"] == pytest.approx(0.4, rel=0.06)


EDGE = {"edge_force__tangential_n_per_mm": 10.0, "edge_force__radial_n_per_mm": 15.0}
RUNOUT = {"runout__eccentricity_mm": 0.008, "runout__phase_rad": 0.6}


@pytest.mark.parametrize(
    ("case", "effect", "start", "stated"),
    [
        ("case_08", "edge_force", EDGE, (22.153, 35.445)),
        ("case_20", "edge_force", EDGE, (7.277, 11.643)),
        ("case_10", "runout", RUNOUT, (0.012041, 0.30971)),
    ],
)
def test_an_effect_explains_what_constants_cannot(
    case: str, effect: str, start: dict[str, float], stated: tuple[float, float]
) -> None:
    without = fitted(case)
    values, fit, check = fitted(case, (effect,), start)
    assert without[1] > 5.0
    assert fit < 1.03 and check < 1.03
    assert [values[name] for name in start] == pytest.approx(stated, rel=0.01)
