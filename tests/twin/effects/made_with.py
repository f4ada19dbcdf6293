"""Small cases made with one effect of the catalogue at a size in floors: an axis in air, a cut, a warm-up, or timed programs.

The machine that is recorded is the twin's own simulator, with other constants than its file states and the noise of its sensors:
the question is whether the diagnosis finds an effect whose form it knows.
"""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from tests.twin.gap.programs.written import made_case
from tests.twin.gap.small_case import MACHINE, air_case, case_of, columns_of, warm_case
from twin.case import Case, RunKind
from twin.effects.effect import Effect, Excitation, On
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis
from twin.gap.floors import repeatability
from twin.gap.labels import measured_signals
from twin.gap.programs.diagnose import diagnose_programs
from twin.machine import AddedEffect, machine_from_toml
from twin.sensor.reading import readings
from twin.simulator.simulation import simulate
from twin.sites import Site

Floats = NDArray[np.float64]
FEEDS = {"fit": (1200.0, 3000.0), "check": (2000.0,)}
SIGNAL = "z_table_mm"
NEAR, STEPS_MAX = 0.8, 8
CUTTER = machine_from_toml(
    """
[machine]
name = "cutter"
[tool]
diameter_mm = 20.0
teeth = 4
tangential_coefficient_n_per_mm2 = 900.0
radial_ratio = 0.4
[spindle]
rated_power_kw = 11.0
efficiency = 0.85
idle_power_kw = 0.25
[program]
rapid_mm_min = 20000.0
acceleration_mm_s2 = 2500.0
jerk_mm_s3 = 60000.0
spindle_acceleration_rpm_s = 16000.0
[stock]
min_mm = [0.0, 0.0, -20.0]
max_mm = [400.0, 60.0, 0.0]
[uncertainty]
relative = 0.03
[noise]
force_n = 2.0
spindle_load_pct = 0.15
"""
)
CUTS = {
    "fit": ((3000, 1.0, 1200), (5000, 2.0, 2000), (7000, 0.7, 4000)),
    "check": ((4000, 1.2, 1500), (6000, 1.6, 3000)),
}
"""Spindle speed, depth and feed of the slots of a program."""


def between(effect: Effect, part: float) -> dict[str, float]:
    """Parameters `part` of the way from null to typical."""
    values = effect.typical_values()
    for p in effect.parameters:
        if p.null is not None:
            values[p.name] = p.typical / part if math.isinf(p.null) else p.null + part * (p.typical - p.null)
    return {p.name: min(max(values[p.name], p.low), p.high) for p in effect.parameters}


def added(effect: Effect, part: float) -> AddedEffect:
    """The effect at `part` of its typical size, on what the small cases have to put it on."""
    on = {On.AXIS: "z", On.SIGNAL: SIGNAL, On.MACHINE: ""}[effect.on]
    return AddedEffect(effect=effect.name, on=on, parameters=between(effect, part))


def maker(effect: Effect) -> Callable[..., Case]:
    """The case that an effect can show in: a function of the effects that the machine is made with."""
    if effect.site is Site.THERMAL:
        return switched_case if effect.excited_by is Excitation.COOLANT_SWITCHED else warm_case
    if effect.site in (Site.PROCESS_FORCE, Site.SPINDLE):
        return cut_case
    return growing_case if "temperature_rise_k" in effect.needs else air_case


def switched_case(*effects: AddedEffect) -> Case:
    """A warm-up with the coolant on and off by turns."""
    return warm_case(*effects, coolant=True)


def growing_case(*effects: AddedEffect) -> Case:
    """An axis in air beside a spindle that warms up."""
    columns = columns_of(air_case())
    for seed, own in enumerate(columns.values()):
        rise_k = 6.0 * (1.0 - np.exp(-own["t_s"] / 3.0))
        own["spindle_temp_c"] = 21.0 + rise_k + 0.08 * np.random.default_rng(seed).standard_normal(len(rise_k))
        since_s = np.diff(own["t_s"], prepend=own["t_s"][:1])
        own["z_table_mm"] = readings(own["z_table_mm"], since_s, {e.effect: e.parameters for e in effects}, rise_k)
    return case_of(MACHINE, columns)


def slots(cuts: tuple[tuple[int, float, int], ...]) -> str:
    """A program that turns in air and cuts a slot at each of these speeds, depths and feeds, about half a second each."""
    blocks, x = ["G21 G90 G17 T1 M6", "G0 X-11 Y30 Z5"], -11.0
    for rpm, depth, feed in cuts:
        blocks += [f"S{rpm} M3", "G4 P100", f"G0 Z-{depth}"]
        x += feed / 60.0 * 0.4 + (11.0 if x < 0.0 else 0.0)
        blocks += [f"G1 X{x:.3f} F{feed}", "G0 Z5"]
    return "\n".join([*blocks, "M5", "M30", ""])


def cut_case(*effects: AddedEffect) -> Case:
    """Slots at several speeds, depths and feeds under a dynamometer and a load meter."""
    assert CUTTER.tool is not None and CUTTER.spindle is not None
    tool = CUTTER.tool.model_copy(update={"tangential_coefficient_n_per_mm2": 914.0, "radial_ratio": 0.405})
    spindle = CUTTER.spindle.model_copy(update={"efficiency": 0.84, "idle_power_kw": 0.254})
    real = CUTTER.model_copy(update={"tool": tool, "spindle": spindle, "effects": effects})
    columns = {}
    for seed, name in enumerate(("fit", "fit again", "check")):
        log = simulate(real, slots(CUTS[name.split()[0]]), seed=seed).run
        columns[name] = {"t_s": log.t_s} | dict(log.columns)
    return case_of(CUTTER.model_copy(update={"stock": None}), columns, RunKind.CUT)


@cache
def healthy(make: Callable[..., Case]) -> tuple[Case, dict[str, float]]:
    """The case without an effect, and the floor of each signal of its run to be judged on."""
    case = make()
    floors = repeatability(case.runs, case.repeats(), case.machine)
    (log,) = (run.log for run in case.runs if run.name == "check")
    return case, {s: float(np.sqrt(np.mean(floors.of(log, s) ** 2))) for s in measured_signals(log)}


def size_in_floors(case: Case, make: Callable[..., Case]) -> float:
    """Rms of what the effect of a case changes, over the floor, in the signal that shows it most; chance is the same in both."""
    bare, floors = healthy(make)
    one, other = (next(run.log for run in c.runs if run.name == "check") for c in (case, bare))
    return max(float(np.sqrt(np.nanmean((one[s] - other[s]) ** 2))) / floor for s, floor in floors.items())


def made_with(effect: Effect, floors: float) -> tuple[Case, float]:
    """A case made with an effect near a size in floors, and its size."""
    make = maker(effect)
    one, size = sized(effect, floors, make)
    return make(one), size


def sized(effect: Effect, floors: float, make: Callable[..., Case]) -> tuple[AddedEffect, float]:
    """The effect near a size in floors, and its size: by steps in proportion, halved where one goes too far."""
    part, low, high = 0.3, 0.0, math.inf
    size = size_in_floors(make(added(effect, part)), make)
    for _ in range(STEPS_MAX):
        if NEAR * floors < size < floors / NEAR:
            break
        low, high = (part, high) if size < floors else (low, part)
        proportional = part * floors / size if size > 0.0 else 10.0 * part
        part = proportional if low < proportional < high else math.sqrt(low * high)
        size = size_in_floors(make(added(effect, part)), make)
    return added(effect, part), size


def diagnosed(effect: Effect, floors: float) -> tuple[Diagnosis, float]:
    """The diagnosis of a machine made with an effect near a size in floors, and its size."""
    if effect.site is not Site.PROGRAM:
        case, size = made_with(effect, floors)
        return diagnose(case).diagnosis, size
    found = timed(effect, 1.0)
    found = timed(effect, min(3.0, floors / found.gap.before))
    return found, found.gap.before


def timed(effect: Effect, part: float) -> Diagnosis:
    """The diagnosis of programs run by a control with an effect on their time at `part` of its typical size."""
    with TemporaryDirectory() as folder:
        return diagnose_programs(made_case(Path(folder), {effect.name: between(effect, part)}, FEEDS)).diagnosis


def outcome(effect: Effect, found: Diagnosis) -> str:
    """`named`, `in the class` of a cause that was named, another cause that is `wrong`, `unknown`, or `missed`."""
    if any(cause.effect == effect.name for cause in found.causes):
        return "named"
    if any(effect.name == other.effect for cause in found.causes for other in cause.indistinguishable_from):
        return "in the class"
    if found.causes:
        return f"wrong: {', '.join(cause.effect for cause in found.causes)}"
    return "unknown" if found.verdict == "unknown" else "missed"
