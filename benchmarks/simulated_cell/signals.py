"""The readings of a machine each second, from what it does, what disturbs it and what is broken.

Power and force of a cut come from the reference machine's milling, load from its drive and meter, temperature from its heat
balances. Added are an accelerating spindle (up to 160 % for a second or two), grease that is cold in the morning, material that
differs from second to second, vibrations of which neighbouring seconds are alike, and the rounding of a control.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.simulated_cell import disturbance
from benchmarks.simulated_cell.broken import Broken, broken_of
from benchmarks.simulated_cell.disturbance import Disturbance, Kind
from benchmarks.simulated_cell.fault import WEAR_OF_LIFE_COEFFICIENT, WEAR_OF_LIFE_EDGE, Fault
from benchmarks.simulated_cell.machine import GRID_STEP, RAPID_MM_MIN, Machine, passes_of
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S, Schedule
from cnctwin.standins.reference_machine import heat

Floats = NDArray[np.float64]
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
STILL_G = 0.012
WEATHER_S = 2.0 * DAY_S
"""Time for which the weather stays alike; it moves the hall by 1.5 K."""
RAMP_S = 0.12
COLD_SHARE, COLD_S = 0.25, 1800.0
"""Idle power is so much larger while the grease is cold, and for how long a run warms it."""


class Readings(NamedTuple):
    """rows: (T, 5) in the order of FEATURES; ambient_c, coolant_on: (T,), as the control tells them."""

    rows: Floats
    ambient_c: Floats
    coolant_on: NDArray[np.bool_]


class _Cut(NamedTuple):
    """The cut at each second: share of the engaged arc, feed over programmed feed, power of the cut, kW, alternating force, N."""

    share: Floats
    feed: Floats
    power_kw: Floats
    force_n: Floats


def readings(
    machine: Machine,
    schedule: Schedule,
    place: int,
    *,
    hall_temp_c: Floats,
    disturbances: Sequence[Disturbance],
    faults: Sequence[Fault],
    rng: np.random.Generator,
) -> Readings:
    """hall_temp_c: the air that all machines stand in, (T,)."""
    ticks = len(schedule.work)
    felt = {kind: disturbance.course(disturbances, kind, place, ticks) for kind in Kind}
    tool = np.array([one.tool if one.cuts else 0 for one in (*schedule.operations,)] + [0])[schedule.operation]
    is_wet = np.array([one.is_wet for one in schedule.operations] + [False])[schedule.operation]
    broken = broken_of(faults, place, tool, is_wet)
    is_cutting = schedule.work == Work.CUTTING
    rpm = _rpm(schedule, rng) * (1.0 - np.minimum(felt[Kind.MAINS], 0.3))
    is_turning = rpm > 200.0
    harder = np.exp(_alike(ticks, 0.8, 0.06, rng)) * (1.0 + felt[Kind.COOLANT]) * broken["material"]
    cut = _cut(machine, schedule, rpm, harder, broken)
    power_kw = _power_kw(machine, schedule, rpm, cut, broken)
    load = _load(machine, rpm, power_kw, rng) + np.where(is_turning, 250.0 * felt[Kind.MAINS], 0.0)
    load *= np.where(is_cutting, broken["load"], 1.0)
    feed = _feed(schedule, cut, rng) * np.where(is_cutting, broken["feed"], 1.0)
    coolant_on = is_wet & ((schedule.work == Work.CUTTING) | (schedule.work == Work.RAPID))
    air_c = hall_temp_c + machine.ambient_offset_k + felt[Kind.HEAT]
    rated = 100.0 / machine.meter.rated_kw
    warm = heat.temperature_c(machine.heat, 1.0, air_c[0], rated * power_kw, rpm, air_c, coolant_on * broken["flow"])
    temp = warm + broken["temp_k"] + rng.normal(0.0, 0.08, ticks)
    steady = np.where(is_turning, broken["turning_vibration"], 1.0) * np.where(is_cutting, broken["cut_vibration"], 1.0)
    vibration = _vibration(machine, schedule, rpm, cut, tool, rng=rng) * steady
    shaken = (felt[Kind.FORKLIFT] + felt[Kind.PRESS]) * np.exp(_alike(ticks, 0.5, 0.15, rng))
    vibration = np.hypot(vibration, shaken)
    rounded = (np.round(load), np.round(rpm), np.round(feed), np.round(temp, 1), np.round(vibration, 3))
    return Readings(np.stack(rounded, axis=1), np.round(air_c, 1), coolant_on)


def _alike(ticks: int, correlation: float, deviation: float, rng: np.random.Generator) -> Floats:
    """Noise whose neighbours are alike: AR(1) of that standard deviation."""
    white = rng.standard_normal(ticks) * deviation * np.sqrt(1.0 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], white), dtype=np.float64)


def _rpm(schedule: Schedule, rng: np.random.Generator) -> Floats:
    ticks, work = len(schedule.work), schedule.work
    goal = np.array([*(one.rpm for one in schedule.operations), 0.0])[schedule.operation]
    stands = (work == Work.STANDING) | (work == Work.LOADING) | (work == Work.STOP) | (work == Work.TOOL_CHANGE)
    reached = lfilter([1.0 - np.exp(-1.0)], [1.0, -np.exp(-1.0)], np.where(stands, 0.0, goal))
    return np.maximum(0.0, np.asarray(reached) * (1.0 + 0.001 * rng.standard_normal(ticks)))


def _cut(machine: Machine, schedule: Schedule, rpm: Floats, harder: Floats, broken: Broken) -> _Cut:
    """The cut at each second: 0 where nothing is cut."""
    found = _Cut(*(np.zeros(len(rpm)) for _ in range(4)))
    at = np.flatnonzero(schedule.work == Work.CUTTING)
    lines, line, stretch = schedule.lines, schedule.line[at], schedule.stretch[at]
    since, lasts, override = schedule.since_s[at].astype(np.float64), schedule.lasts_s[stretch], schedule.override[stretch]
    ramp = np.clip(np.minimum(since, lasts - since) / RAMP_S, 0.15, 1.0)
    gone_mm = lines.length_mm[line] * np.clip(since / lasts, 0.0, 1.0)
    lead, reach = lines.lead_mm[line], lines.reach_mm[line]
    share = np.clip((gone_mm - lead + reach) / reach, 0.0, 1.0) * np.clip(
        (lead + lines.stock_mm[line] - gone_mm) / reach, 0.0, 1.0
    )
    nominal = np.array([one.rpm for one in schedule.operations])[schedule.operation[at]]
    turns = np.maximum(rpm[at], 1.0) / nominal
    feed = override * ramp
    g = np.clip(feed / turns / GRID_STEP, 0.0, 8.0 - 1e-9)
    wear = schedule.wear[stretch] + broken["wear"][at]
    material = schedule.material[stretch] * harder[at]
    chip, edge = material * (1.0 + WEAR_OF_LIFE_COEFFICIENT * wear), material * (1.0 + WEAR_OF_LIFE_EDGE * wear)
    deeper = 1.0 + broken["deeper_mm"][at] / lines.depth_mm[line]
    whole = share * deeper * broken["cuts"][at]
    power_w, force2 = _of_passes(machine, schedule, lines.cut[line], g, (chip, edge))
    for start, stop, tool, chipped_mm in broken.chipped:
        own = np.flatnonzero((at >= start) & (at < stop) & (schedule.tool_number[at] == tool))
        some = (chip[own], edge[own])
        power_w[own], force2[own] = _of_passes(machine, schedule, lines.cut[line][own], g[own], some, chipped=(tool, chipped_mm))
    found.share[at], found.feed[at] = whole, feed
    found.power_kw[at] = 0.001 * power_w * turns * whole
    found.force_n[at] = np.sqrt(np.maximum(force2, 0.0)) * whole * schedule.chatter[stretch]
    return found


def _of_passes(
    machine: Machine,
    schedule: Schedule,
    rows: NDArray[np.integer],
    g: Floats,
    scales: tuple[Floats, Floats],
    *,
    chipped: tuple[int, float] = (0, 0.0),
) -> tuple[Floats, Floats]:
    """Power, W, and variance of the force, N², of passes at feeds g, in steps of the grid; scales: of chip and edge."""
    passes = passes_of(machine, schedule.operations, chipped)
    low = g.astype(np.intp)
    part = g - low

    def at(table: Floats) -> Floats:
        return np.asarray(table[rows, low] * (1.0 - part) + table[rows, low + 1] * part)

    chip, edge = scales
    force2 = chip**2 * at(passes.chip2) + 2.0 * chip * edge * at(passes.both) + edge**2 * at(passes.edge2)
    return chip * at(passes.chip_w) + edge * at(passes.edge_w), force2


def _power_kw(machine: Machine, schedule: Schedule, rpm: Floats, cut: _Cut, broken: Broken) -> Floats:
    """Electrical power of the drive: the reference machine's meter, at a power that lasts."""
    meter, speed = machine.meter, rpm / 5000.0
    part = cut.power_kw / meter.knee_kw
    efficiency = meter.efficiency * (1.0 - meter.drop / (1.0 + part + 0.5 * part**2))
    idle_kw = meter.idle_kw + meter.turning_kw * (0.25 * speed + 0.75 * speed**2)
    keeps = np.exp(-1.0 / COLD_S)
    run = lfilter([1.0 - keeps], [1.0, -keeps], (rpm > 200.0).astype(np.float64))
    cold = 1.0 + COLD_SHARE * np.clip(1.0 - 2.0 * run, 0.0, 1.0)
    return np.asarray(cut.power_kw / efficiency + np.where(rpm > 50.0, idle_kw * cold * broken["idle"], 0.0))


def _load(machine: Machine, rpm: Floats, power_kw: Floats, rng: np.random.Generator) -> Floats:
    change = np.diff(rpm, prepend=rpm[0])
    spin = np.where(change > 100.0, change / 5000.0 * 150.0, np.where(change < -100.0, -change / 5000.0 * 60.0, 0.0))
    shown = 100.0 * power_kw / machine.meter.rated_kw
    return np.asarray(shown + np.minimum(spin, 160.0) + rng.normal(0.0, 0.4, len(rpm)).clip(0.0))


def _feed(schedule: Schedule, cut: _Cut, rng: np.random.Generator) -> Floats:
    """The feed at the moment of the reading: what is left of it while a line starts or stops."""
    ticks, work = len(schedule.work), schedule.work
    programmed = np.append(schedule.lines.feed_mm_min, 0.0)[schedule.line]
    is_moving = (work == Work.RAPID) & (schedule.line >= 0)
    rapid = RAPID_MM_MIN * rng.uniform(0.1, 1.0, ticks)
    feed = np.where(work == Work.CUTTING, programmed * cut.feed, np.where(is_moving, rapid, 0.0))
    feed = np.where(work == Work.WARM_UP, programmed * rng.uniform(0.4, 1.0, ticks), feed)
    return np.asarray(feed * (1.0 + 0.005 * rng.standard_normal(ticks)))


def weather(ticks: int, rng: np.random.Generator) -> Floats:
    """The air of the hall, °C: a day, and days that are alike."""
    t_s = np.arange(ticks)
    swing = 2.5 * np.cos(2.0 * np.pi * (t_s / DAY_S - 0.15))
    return 22.0 - swing + _alike(ticks, float(np.exp(-1.0 / WEATHER_S)), 1.5, rng)


def _vibration(
    machine: Machine, schedule: Schedule, rpm: Floats, cut: _Cut, tool: NDArray[np.integer], *, rng: np.random.Generator
) -> Floats:
    ticks = len(rpm)
    turning = STILL_G + 0.05 * (rpm / 10000.0) ** 1.5
    answers = np.zeros(max(machine.vibration_g_per_n) + 1)
    answers[list(machine.vibration_g_per_n)] = list(machine.vibration_g_per_n.values())
    shaken = np.hypot(turning, cut.force_n * answers[tool]) * np.exp(_alike(ticks, 0.6, 0.12, rng))
    changing = (schedule.work == Work.TOOL_CHANGE) & (rng.random(ticks) < 0.3)
    accelerates = np.minimum(np.abs(np.diff(rpm, prepend=rpm[0])) / 5000.0, 1.0) * 0.3
    return np.asarray(shaken + accelerates + np.where(changing, rng.uniform(0.3, 1.0, ticks), 0.0))
