"""The five features of a machine each second, from what it does, what disturbs it and what is broken.

Loads follow the operation, its passes, the tool's wear and the acceleration of the spindle (which shows up to 160 % for a second
or two); temperatures are heat behind a resistance (R C = 2,400 s) over an ambient that has a day; vibrations follow operation and
load, with neighbouring seconds alike. Values are rounded as controls round them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.simulated_cell import disturbance, fault
from benchmarks.simulated_cell.disturbance import Disturbance, Kind
from benchmarks.simulated_cell.fault import Fault, FaultKind
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S, Machine, Schedule

Floats = NDArray[np.float64]
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
STILL_G = 0.012
RC_S = 2400.0
WEATHER_S = 2.0 * DAY_S
"""How long the weather stays alike; it moves the hall by 1.5 K."""


def signals(
    machine: Machine,
    schedule: Schedule,
    place: int,
    *,
    hall_temp_c: Floats,
    disturbances: Sequence[Disturbance],
    faults: Sequence[Fault],
    rng: np.random.Generator,
) -> Floats:
    """(T, 5), in the order of FEATURES. hall_temp_c: the air that all machines stand in, (T,)."""
    ticks = len(schedule.work)
    felt = {kind: disturbance.course(disturbances, kind, place, ticks) for kind in Kind}
    broken = _faults(faults, place, ticks)
    is_cutting = schedule.work == Work.CUTTING
    shape = _passes(schedule, is_cutting)
    rpm = _rpm(schedule, rng) * (1.0 - np.minimum(felt[Kind.MAINS], 0.3))
    turning = rpm > 200.0
    load = _load(schedule, rpm, shape, is_cutting, rng)
    load *= np.where(is_cutting, (1.0 + felt[Kind.COOLANT]) * broken["load"], 1.0)
    load += np.where(turning, 250.0 * felt[Kind.MAINS], 0.0)
    feed = _feed(schedule, shape, rng) * np.where(is_cutting, broken["feed"], 1.0)
    temp = _temperature(rpm, load, hall_temp_c + machine.ambient_offset_k + felt[Kind.HEAT], rng) + broken["temp"]
    steady = np.where(turning, broken["vibration"], 1.0) * np.where(is_cutting, broken["cut_vibration"], 1.0)
    vibration = _vibration(schedule, rpm, shape, is_cutting, rng) * steady * np.where(is_cutting, 1.0 + felt[Kind.COOLANT], 1.0)
    shaken = (felt[Kind.FORKLIFT] + felt[Kind.PRESS]) * np.exp(_alike(ticks, 0.5, 0.15, rng))
    vibration = np.hypot(vibration, shaken)
    rounded = (np.round(load), np.round(rpm), np.round(feed), np.round(temp, 1), np.round(vibration, 3))
    return np.stack(rounded, axis=1)


def _alike(ticks: int, correlation: float, deviation: float, rng: np.random.Generator) -> Floats:
    """Noise whose neighbours are alike: AR(1) of that standard deviation."""
    white = rng.standard_normal(ticks) * deviation * np.sqrt(1.0 - correlation**2)
    return np.asarray(lfilter([1.0], [1.0, -correlation], white), dtype=np.float64)


def _of_operation(schedule: Schedule, name: str) -> Floats:
    """A figure of the operation at each second; 0 where there is none."""
    figures = np.array([*(getattr(operation, name) for operation in schedule.operations), 0.0])
    return np.asarray(figures[schedule.operation], dtype=np.float64)


def _passes(schedule: Schedule, is_cutting: NDArray[np.bool_]) -> Floats:
    """Engagement over a pass: around 1, near 0 for a moment between passes; 0 where nothing is cut."""
    period = np.maximum(_of_operation(schedule, "passes_s"), 1.0)
    phase = schedule.since_s / period % 1.0
    swell = 1.0 + 0.25 * np.sin(2.0 * np.pi * phase)
    return np.where(is_cutting, np.where(phase < 0.88, swell, 0.05), 0.0)


def _rpm(schedule: Schedule, rng: np.random.Generator) -> Floats:
    ticks, work = len(schedule.work), schedule.work
    goal = _of_operation(schedule, "spindle_rpm")
    stands = (work == Work.STANDING) | (work == Work.LOADING) | (work == Work.STOP) | (work == Work.TOOL_CHANGE)
    reached = lfilter([1.0 - np.exp(-1.0)], [1.0, -np.exp(-1.0)], np.where(stands, 0.0, goal))
    return np.maximum(0.0, np.asarray(reached) * (1.0 + 0.001 * rng.standard_normal(ticks)))


def _load(schedule: Schedule, rpm: Floats, shape: Floats, is_cutting: NDArray[np.bool_], rng: np.random.Generator) -> Floats:
    ticks = len(rpm)
    idle = np.where(rpm > 50.0, 2.0 + rpm / 4000.0, 0.0)
    cut = _of_operation(schedule, "load_pct") * schedule.load_scale * shape * np.exp(_alike(ticks, 0.8, 0.06, rng))
    change = np.diff(rpm, prepend=rpm[0])
    spin = np.where(change > 100.0, change / 5000.0 * 150.0, np.where(change < -100.0, -change / 5000.0 * 60.0, 0.0))
    return np.asarray(idle + np.where(is_cutting, cut, 0.0) + np.minimum(spin, 160.0) + rng.normal(0.0, 0.4, ticks).clip(0.0))


def _feed(schedule: Schedule, shape: Floats, rng: np.random.Generator) -> Floats:
    ticks, work = len(shape), schedule.work
    cut = _of_operation(schedule, "feed_mm_min") * schedule.feed_scale * np.where(shape > 0.1, 1.0, 2.0)
    rapid = rng.uniform(3000.0, 20000.0, ticks)
    feed = np.where(work == Work.CUTTING, cut, np.where((work == Work.RAPID) | (work == Work.WARM_UP), rapid, 0.0))
    corner = np.where(rng.random(ticks) < 0.08, rng.uniform(0.3, 0.9, ticks), 1.0)
    return np.asarray(feed * corner * (1.0 + 0.01 * rng.standard_normal(ticks)))


def weather(ticks: int, rng: np.random.Generator) -> Floats:
    """The air of the hall, °C: a day, and days that are alike."""
    t_s = np.arange(ticks)
    swing = 2.5 * np.cos(2.0 * np.pi * (t_s / DAY_S - 0.15))
    return 22.0 - swing + _alike(ticks, float(np.exp(-1.0 / WEATHER_S)), 1.5, rng)


def _temperature(rpm: Floats, load: Floats, air_c: Floats, rng: np.random.Generator) -> Floats:
    keeps = np.exp(-1.0 / RC_S)
    rise_goal = 14.0 * rpm / 12000.0 + 9.0 * load / 100.0
    return np.asarray(lfilter([1.0 - keeps], [1.0, -keeps], rise_goal) + air_c + rng.normal(0.0, 0.1, len(rpm)))


def _vibration(schedule: Schedule, rpm: Floats, shape: Floats, is_cutting: NDArray[np.bool_], rng: np.random.Generator) -> Floats:
    ticks = len(rpm)
    turning = STILL_G + 0.05 * (rpm / 10000.0) ** 1.5
    cut = _of_operation(schedule, "vibration_g") * schedule.vibration_scale * np.sqrt(np.maximum(shape, 0.0))
    shaken = np.where(is_cutting, np.hypot(turning, cut), turning) * np.exp(_alike(ticks, 0.6, 0.12, rng))
    changing = (schedule.work == Work.TOOL_CHANGE) & (rng.random(ticks) < 0.3)
    accelerates = np.minimum(np.abs(np.diff(rpm, prepend=rpm[0])) / 5000.0, 1.0) * 0.3
    return np.asarray(shaken + accelerates + np.where(changing, rng.uniform(0.3, 1.0, ticks), 0.0))


def _faults(faults: Sequence[Fault], place: int, ticks: int) -> dict[str, Floats]:
    """Factors on load, feed, vibration while it turns and in the cut; and the rise of the temperature, K."""
    acts = {name: np.ones(ticks) for name in ("load", "feed", "vibration", "cut_vibration")} | {"temp": np.zeros(ticks)}
    for one in faults:
        if one.machine != place:
            continue
        part = slice(int(one.start_s), min(ticks, int(one.end_s) + 1))
        size = one.size * fault.course(one, np.arange(part.start, part.stop, dtype=np.float64))
        if one.kind is FaultKind.BEARING:
            acts["vibration"][part] *= 2.5**size
            acts["temp"][part] += 3.0 * size
        elif one.kind is FaultKind.CHIP_PACKING:
            acts["load"][part] *= 1.5**size
            acts["cut_vibration"][part] *= 1.4**size
        elif one.kind is FaultKind.SPINDLE_HEAT:
            acts["temp"][part] += 12.0 * size
        elif one.kind is FaultKind.FEED_MISMATCH:
            acts["feed"][part] /= 1.0 + size
        else:
            acts["cut_vibration"][part] *= 2.5**size
            acts["load"][part] *= 1.25**size
    return acts
