"""The twin's expectation: temperature and cutting force for a planned course of speed and load.

C dT/dt = alpha · load · rpm² + beta · rpm − (T − T_ambient) / R          (twin.thermal, exact in each step)
F = η · (load/100 · P_rated − P_idle) / v_c                               (twin.cutting)
"""

import json
from collections.abc import Sequence
from itertools import groupby
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from cnctwin.api.constants import OfMachine
from twin.cutting import cutting_force
from twin.thermal import ThermalNetwork, heat_input_w, rise_after

STEPS_MAX = 100_000
Celsius = Annotated[float, Field(ge=-50.0, le=80.0)]
LoadPct = Annotated[float, Field(ge=0.0, le=200.0)]
Figure = Annotated[float, Field(ge=-1e6, le=1e6)]
COURSES = (
    *("ambient_temp_c", "spindle_load_pct", "spindle_rpm", "feed_mm_min"),
    *("axis_x_pos_mm", "axis_y_pos_mm", "axis_z_pos_mm"),
)
CONSTANTS = {"alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w", "capacity_j_per_k"}
Rpm = Annotated[float, Field(ge=0.0, le=60_000.0)]
_EXAMPLE: JsonDict = {
    "machine": "vmc",
    "start_temp_c": 21.5,
    "ambient_temp_c": [21.0, 21.0, 21.0],
    "spindle_load_pct": [20.0, 45.0, 45.0],
    "spindle_rpm": [6000.0, 6000.0, 6000.0],
    "dt_s": 10.0,
    "tool_diameter_mm": 12.0,
}


class Plan(BaseModel):
    """A course in steps of `dt_s`: each value holds for its step."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, json_schema_extra={"examples": [_EXAMPLE]})
    machine: str = Field("", max_length=200, description="whose constants; any name, also of one that is not known")
    start_temp_c: float = Field(ge=-20.0, le=120.0, description="of the spindle, before the first step, °C")
    ambient_temp_c: list[Celsius] = Field(min_length=1, max_length=STEPS_MAX, description="°C")
    spindle_load_pct: list[LoadPct] = Field(min_length=1, max_length=STEPS_MAX, description="% of rated power")
    spindle_rpm: list[Rpm] = Field(min_length=1, max_length=STEPS_MAX, description="rev/min")
    feed_mm_min: list[Figure] | None = Field(None, max_length=STEPS_MAX, description="for a residual model that needs it")
    axis_x_pos_mm: list[Figure] | None = Field(None, max_length=STEPS_MAX, description="likewise")
    axis_y_pos_mm: list[Figure] | None = Field(None, max_length=STEPS_MAX, description="likewise")
    axis_z_pos_mm: list[Figure] | None = Field(None, max_length=STEPS_MAX, description="likewise")
    dt_s: float = Field(gt=0.0, le=60.0, description="length of a step, s")
    tool_diameter_mm: float | None = Field(None, gt=0.0, le=1000.0, description="else that of the configuration")

    @model_validator(mode="after")
    def _lengths_agree(self) -> "Plan":
        lengths = {name: len(values) for name, values in self.signals().items()}
        if len(set(lengths.values())) > 1:
            said = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise ValueError(f"lengths differ: {said}; give each as many values as there are steps")
        return self

    def signals(self) -> dict[str, list[float]]:
        """The courses that are given, by the canonical name of their signal."""
        return {name: values for name in COURSES if (values := getattr(self, name)) is not None}


class Forecast(BaseModel):
    """The result. Lists have one value for each step, as of its end; a force is null where power over speed means nothing.

    force_reasons: why it is null, by stretches of steps: `[first, last, reason]`
    corrected_temp_c: with what a residual model has learned of this machine; null where there is none, or outside its region
    """

    machine: str
    dt_s: float
    spindle_temp_c: list[float]
    cutting_force_n: list[float | None]
    force_reasons: list[tuple[int, int, str]]
    corrected_temp_c: list[float | None] | None
    constants: dict[str, Any]
    basis: dict[str, str]


def temperatures(network: ThermalNetwork, plan: Plan) -> list[float]:
    """The spindle's temperature at the end of each step, °C.

    Without heat it goes to the ambient: after one time constant, 63.2 % of the way from 40 to 20 °C are done.

    >>> still = ThermalNetwork(0.0, 0.0, 0.06, 1000.0)
    >>> plan = Plan(start_temp_c=40.0, ambient_temp_c=[20.0], spindle_load_pct=[0.0], spindle_rpm=[0.0], dt_s=60.0)
    >>> [round(value, 2) for value in temperatures(still, plan)]
    [27.36]
    """
    found, ambient_c = [], plan.ambient_temp_c[0]
    rise_k = plan.start_temp_c - ambient_c
    for now_c, load_pct, rpm in zip(plan.ambient_temp_c, plan.spindle_load_pct, plan.spindle_rpm, strict=True):
        rise_k += ambient_c - now_c  # the spindle's temperature does not jump with the ambient's
        ambient_c = now_c
        rise_k = rise_after(network, rise_k, heat_input_w(network, rpm, load_pct), plan.dt_s)
        found.append(rise_k + ambient_c)
    return found


def forces(of: OfMachine, plan: Plan, diameter_mm: float) -> tuple[list[float | None], list[tuple[int, int, str]]]:
    """The mean tangential force of each step, N, and why there is none, by stretches."""
    found = [
        cutting_force(of.force.drive, load_pct, rpm, diameter_mm)
        for load_pct, rpm in zip(plan.spindle_load_pct, plan.spindle_rpm, strict=True)
    ]
    return [None if one.force_n is None else round(one.force_n, 1) for one in found], _stretches([one.reason for one in found])


def forecast(of: OfMachine, plan: Plan, physics_c: list[float], corrected: list[float | None] | None, residual: str) -> bytes:
    """The answer, as JSON. `corrected` is what a residual model makes of the physics, `residual` says which, or why none."""
    diameter_mm = of.force.tool_diameter_mm if plan.tool_diameter_mm is None else plan.tool_diameter_mm
    force_n, reasons = forces(of, plan, diameter_mm)
    drive = of.force.model_dump(include={"rated_power_kw", "efficiency", "idle_power_kw", "spindle_rpm_min"})
    said = {
        "machine": plan.machine,
        "dt_s": plan.dt_s,
        "spindle_temp_c": [round(value, 4) for value in physics_c],
        "cutting_force_n": force_n,
        "force_reasons": reasons,
        "corrected_temp_c": corrected,
        "constants": {**of.thermal.model_dump(include=CONSTANTS), **drive, "tool_diameter_mm": diameter_mm},
        "basis": {"thermal": of.thermal_basis, "cutting_force": of.force_basis, "residual": residual},
    }
    return json.dumps(said, separators=(",", ":"), allow_nan=False).encode()


def _stretches(reasons: Sequence[str | None]) -> list[tuple[int, int, str]]:
    found: list[tuple[int, int, str]] = []
    for reason, group in groupby(enumerate(reasons), lambda one: one[1]):
        held = [index for index, _ in group]
        if reason is not None:
            found.append((held[0], held[-1], reason))
    return found
