"""A production day of the reference machine, as a control tells it once a second: no servo axes, no force, no engagement.

One part after the other: for each tool a change, a run-up, an approach at rapid, a cut with or without coolant, a retract; then
the workpiece is changed, and now and then somebody has a break. Days of sixteen hours have nights between them.

The heat follows the true power of the drive; the meter shows that power over what it calls 100 %, through its sensor.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.reference_machine import heat
from cnctwin.standins.reference_machine.physics import Physics, SensorPhysics

Floats = NDArray[np.float64]
RAPID_MM_MIN = 24000.0
TOOL_CHANGE_S = 6.0
"""The stated length of a tool change, from the stopped spindle to the tool in it."""
SPREAD_S = 0.15
"""One standard deviation of a tool change from the next."""
DAY_S, SHIFT_S = 86400.0, 57600.0
MEAN_BREAK_PARTS = 12.0


@dataclass(frozen=True, slots=True)
class Operation:
    """The work of one tool on each part."""

    tool: int
    rpm: float
    feed_mm_min: float
    cut_kw: float
    cut_s: float
    coolant: bool


@dataclass(frozen=True, slots=True, eq=False)
class Production:
    """The commands to the machine and its answer, second by second, each (n,).

    cut_kw: mechanical power of the cut; rated_kw: as stated, in whose percents the heat by load is
    """

    t_s: Floats
    rpm: Floats
    feed_mm_min: Floats
    cut_kw: Floats
    coolant_on: Floats
    tool: Floats
    changing: Floats
    ambient_c: Floats
    rated_kw: float


@dataclass(frozen=True, slots=True)
class Shown:
    """The display of a control: the steps of its readings, and the part of rows that never arrive."""

    load_step_pct: float = 1.0
    temperature_step_c: float = 0.1
    lost: float = 0.03


def operations_of(chance: np.random.Generator, rated_kw: float) -> tuple[Operation, ...]:
    """Draw the tools of a part."""
    count = int(chance.integers(3, 6))
    wet = chance.random(count) < 0.6
    wet[0], wet[1] = True, False
    return tuple(
        Operation(
            tool=int(tool),
            rpm=float(round(chance.uniform(1500.0, 9000.0), -2)),
            feed_mm_min=float(round(chance.uniform(200.0, 2500.0))),
            cut_kw=float(chance.uniform(0.05, 0.35) * rated_kw),
            cut_s=float(chance.uniform(12.0, 70.0)),
            coolant=bool(wet[number]),
        )
        for number, tool in enumerate(chance.permutation(np.arange(1, 20))[:count])
    )


def production_of(chance: np.random.Generator, seconds: float, rated_kw: float, extra_change_s: float = 0.0) -> Production:
    """Return a production of so many seconds. extra_change_s: that a tool change takes beyond what is stated"""
    operations = operations_of(chance, rated_kw)
    rows: dict[str, list[Floats]] = {name: [] for name in ("rpm", "feed", "cut", "coolant", "tool", "changing")}
    clock = 0.0

    def pass_for(duration_s: float, **values: float | Floats) -> None:
        nonlocal clock
        count = round(clock + duration_s) - round(clock)
        clock += duration_s
        for name, parts in rows.items():
            parts.append(np.broadcast_to(np.asarray(values.get(name, 0.0), dtype=np.float64), (count,)))

    while clock < seconds:
        for one in operations:
            change_s = TOOL_CHANGE_S + extra_change_s + SPREAD_S * float(chance.standard_normal())
            pass_for(change_s, changing=1.0, tool=float("nan"))
            told = {"rpm": one.rpm, "tool": float(one.tool), "coolant": float(one.coolant)}
            pass_for(float(chance.uniform(2.0, 5.0)), **told)
            pass_for(float(chance.uniform(1.0, 4.0)), feed=RAPID_MM_MIN, **told)
            duration_s = one.cut_s * float(chance.uniform(0.97, 1.03))
            pass_for(duration_s, feed=one.feed_mm_min, cut=one.cut_kw * float(chance.uniform(0.9, 1.1)), **told)
            pass_for(float(chance.uniform(1.0, 3.0)), feed=RAPID_MM_MIN, **told)
        tool = {"tool": float(operations[-1].tool)}
        pass_for(float(chance.uniform(15.0, 60.0)), **tool)
        if chance.random() < 1.0 / MEAN_BREAK_PARTS:
            pass_for(float(chance.uniform(300.0, 1500.0)), **tool)
        if clock % DAY_S > SHIFT_S:
            pass_for(DAY_S - clock % DAY_S, **tool)
    joined = {name: np.concatenate(parts)[: int(seconds)] for name, parts in rows.items()}
    t_s = np.arange(len(joined["rpm"]), dtype=np.float64)
    middle, swing = float(chance.uniform(19.0, 25.0)), float(chance.uniform(0.3, 1.2))
    ambient = middle + swing * np.sin(2.0 * np.pi * t_s / float(chance.uniform(5000.0, 20000.0)) + chance.uniform(0.0, 6.0))
    cutting = joined["cut"] * (1.0 + 0.05 * chance.standard_normal(len(t_s)))
    return Production(
        t_s, joined["rpm"], joined["feed"], cutting, joined["coolant"], joined["tool"], joined["changing"], ambient, rated_kw
    )


def recorded(
    physics: Physics, told: Production, window: slice, chance: np.random.Generator, shown: Shown
) -> Mapping[str, Floats]:
    """Return the columns that a control shows of a window, the machine having run since the beginning."""
    meter, noise = physics.meter, physics.noise
    speed = told.rpm / 5000.0
    part = told.cut_kw / meter.knee_kw
    efficiency = meter.efficiency * (1.0 - meter.drop / (1.0 + part + 0.5 * part**2))
    turning_kw = np.where(told.rpm > 0.0, meter.idle_kw + meter.turning_kw * (0.25 * speed + 0.75 * speed**2), 0.0)
    power_kw = told.cut_kw / efficiency + turning_kw
    warm = heat.temperature_c(
        physics.heat, 1.0, told.ambient_c[0], 100.0 * power_kw / told.rated_kw, told.rpm, told.ambient_c, told.coolant_on
    )
    load = _read(100.0 * power_kw / meter.rated_kw, physics.sensors.get("spindle_load_pct", SensorPhysics()))
    temperature = _read(warm, physics.sensors.get("spindle_temp_c", SensorPhysics()))
    count = len(told.t_s[window])
    load = load[window] + noise.spindle_load_pct * chance.standard_normal(count)
    temperature = temperature[window] + noise.spindle_temp_c * chance.standard_normal(count)
    columns = {
        "t_s": told.t_s[window] - told.t_s[window][0],
        "spindle_rpm": told.rpm[window],
        "spindle_load_pct": np.round(np.maximum(load, 0.0) / shown.load_step_pct) * shown.load_step_pct,
        "feed_mm_min": told.feed_mm_min[window],
        "coolant_on": told.coolant_on[window],
        "tool_number": told.tool[window],
        "tool_change_active": told.changing[window],
        "ambient_temp_c": np.round(told.ambient_c[window], 1),
        "spindle_temp_c": np.round(np.round(temperature / shown.temperature_step_c) * shown.temperature_step_c, 6),
    }
    arrived = chance.random(count) >= shown.lost
    arrived[0] = True
    return {name: values[arrived] for name, values in columns.items()}


def _read(values: Floats, sensor: SensorPhysics) -> Floats:
    """Return what a sensor reads once a second."""
    read = sensor.bias + sensor.scale * values
    if sensor.late_s > 0.0:
        read = np.interp(np.arange(len(read)) - sensor.late_s, np.arange(len(read)), read)
    if sensor.lag_s > 0.0:
        keep = np.exp(-1.0 / sensor.lag_s)
        lagging = np.empty(len(read))
        held = read[0]
        for second, value in enumerate(read):
            held = keep * held + (1.0 - keep) * value
            lagging[second] = held
        return lagging
    return read
