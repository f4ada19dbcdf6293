"""The twin's expectation: temperature and cutting force for a planned course of speed and load.

The physics is that of the live twin, with every effect of the machine's description: heat by twin/live/heat.py, exact in each
step, force by the load meter of twin/live/force.py.
"""

import json
from collections.abc import Sequence
from itertools import groupby
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.config import JsonDict

from cnctwin.api.constants import OfMachine
from twin.live.heat import HeatInput, LiveHeat
from twin.machine import SpindleDrive, Thermal

STEPS_MAX = 100_000
Celsius = Annotated[float, Field(ge=-50.0, le=80.0)]
LoadPct = Annotated[float, Field(ge=0.0, le=200.0)]
Figure = Annotated[float, Field(ge=-1e6, le=1e6)]
COURSES = (
    *("ambient_temp_c", "spindle_load_pct", "spindle_rpm", "feed_mm_min"),
    *("axis_x_pos_mm", "axis_y_pos_mm", "axis_z_pos_mm"),
)
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
    coolant_on: list[bool] | None = Field(None, max_length=STEPS_MAX, description="else it is off")
    tool_number: int | None = Field(None, ge=0, description="whose diameter; else that of any tool")
    tool_diameter_mm: float | None = Field(None, gt=0.0, le=1000.0, description="else that of the machine's tool")

    @model_validator(mode="after")
    def _lengths_agree(self) -> "Plan":
        lengths = {name: len(values) for name, values in self.signals().items()}
        if self.coolant_on is not None:
            lengths["coolant_on"] = len(self.coolant_on)
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


def temperatures(heat: LiveHeat, plan: Plan) -> list[float]:
    """The temperature that the spindle's sensor shows at the end of each step, °C.

    Without heat it goes to the ambient: after one time constant, 63.2 % of the way from 40 to 20 °C are done.

    >>> from twin.machine import Machine, MachineFile
    >>> still = Thermal(alpha_w_per_pct_rpm2=0.0, beta_w_per_rpm=0.0, resistance_k_per_w=0.06, capacity_j_per_k=1000.0)
    >>> heat = LiveHeat.of(MachineFile(machine=Machine(name="vmc"), thermal=still))
    >>> plan = Plan(start_temp_c=40.0, ambient_temp_c=[20.0], spindle_load_pct=[0.0], spindle_rpm=[0.0], dt_s=60.0)
    >>> [round(value, 2) for value in temperatures(heat, plan)]
    [27.36]
    """
    coolant = [False] * len(plan.ambient_temp_c) if plan.coolant_on is None else plan.coolant_on
    course = zip(plan.spindle_load_pct, plan.spindle_rpm, plan.ambient_temp_c, map(float, coolant), strict=True)
    found, state = [], None
    for told in map(HeatInput._make, course):
        if state is None:
            state = heat.started_at_reading(plan.start_temp_c, told) or heat.started(plan.start_temp_c, told)
        state = heat.step(state, told, plan.dt_s)
        found.append(heat.reading(state, told))
    return found


def forces(of: OfMachine, plan: Plan) -> tuple[list[float | None], list[tuple[int, int, str]], float | None]:
    """The mean tangential force of each step, N, why there is none, by stretches, and the diameter of the tool."""
    force, tool = of.force.force, of.force.force.tool(plan.tool_number)
    diameter_mm = tool.diameter_mm if plan.tool_diameter_mm is None else plan.tool_diameter_mm
    found = [
        force.force(load_pct, rpm, diameter_mm) for load_pct, rpm in zip(plan.spindle_load_pct, plan.spindle_rpm, strict=True)
    ]
    reasons = [tool.reason if one.reason is not None and diameter_mm is None else one.reason for one in found]
    return [None if one.force_n is None else round(one.force_n, 1) for one in found], _stretches(reasons), diameter_mm


def forecast(of: OfMachine, plan: Plan, physics_c: list[float], corrected: list[float | None] | None, residual: str) -> bytes:
    """The answer, as JSON. `corrected` is what a residual model makes of the physics, `residual` says which, or why none."""
    force_n, reasons, diameter_mm = forces(of, plan)
    thermal, spindle = of.thermal.machine.thermal, of.force.machine.spindle
    assert isinstance(thermal, Thermal) and isinstance(spindle, SpindleDrive), "what a file leaves out is assumed"
    drive = {**spindle.model_dump(), "spindle_rpm_min": of.force.force.spindle_rpm_min}
    said = {
        "machine": plan.machine,
        "dt_s": plan.dt_s,
        "spindle_temp_c": [round(value, 4) for value in physics_c],
        "cutting_force_n": force_n,
        "force_reasons": reasons,
        "corrected_temp_c": corrected,
        "constants": {**thermal.model_dump(), **drive, "tool_diameter_mm": diameter_mm},
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
