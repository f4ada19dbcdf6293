"""Runs of the reference machine: what its sensors make of a program, as the columns of a run log.

A disturbance nobody commands (an Ornstein-Uhlenbeck force of about 1 N) acts on each axis; readings carry the noise of their
sensors, are rounded as their converters do, and pass through single precision.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.signal import lfilter

from cnctwin.standins.reference_machine import axis, heat, milling, spindle
from cnctwin.standins.reference_machine.physics import Physics, SensorPhysics
from cnctwin.standins.reference_machine.trajectory import Block, Dwell, Dynamics, Line, path_of
from cnctwin.standins.reference_machine.trajectory import Path as Trajectory

Floats = NDArray[np.float64]
Columns = dict[str, NDArray[np.generic]]
HOLD = 1000
"""Ticks for which an axis holds its first position before it is recorded."""
LOAD_EVERY = 100
"""Ticks between two readings of the load meter."""
ROUNDED = {"pos_mm": 1e-4, "table_mm": 1e-4, "torque_a": 1e-3, "force": 0.1, "spindle_load_pct": 0.1, "spindle_temp_c": 0.01}


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A program with the path it makes: what repeated runs share."""

    blocks: tuple[Block, ...]
    path: Trajectory
    spindle_rad: float
    start_c: float
    ambient_c: float


def motion_of(blocks: Sequence[Block], dynamics: Dynamics, chance: np.random.Generator) -> Motion:
    """The motion of a program; the angle of the spindle and the surroundings are drawn."""
    ambient = float(chance.uniform(19.0, 24.0))
    angle = float(chance.uniform(0.0, 2.0 * np.pi))
    return Motion(tuple(blocks), path_of(blocks, dynamics), angle, ambient + float(chance.uniform(0.0, 3.0)), ambient)


def motion_run(physics: Physics, motion: Motion, seed: int, axes: str = "xyz") -> Columns:
    """Records a run of a program in air or in the cut.

    axes: those that are run; with fewer, a run that is only compared takes less time. The same seed gives the same chances.
    """
    path, count = motion.path, len(motion.path.block)
    columns: Columns = {"t_s": np.arange(count) * 0.001, "line": (path.block + 1).astype(np.int32)}
    cut = _cut(physics, motion)
    for number, letter in enumerate("xyz"):
        if letter not in axes:
            continue
        chance = np.random.default_rng([seed, number])
        force = _disturbance(physics, count, chance) + cut.held_n[letter] + _from_outside(physics, motion, letter)
        columns[f"{letter}_ref_mm"] = np.round(path.at_ticks(number), 7)
        motor, torque, table = _axis_run(physics, motion, letter, force)
        for name, values in (("pos_mm", motor), ("table_mm", table), ("torque_a", torque)):
            columns[f"{letter}_{name}"] = _stamped(physics, values)
    if cut.rpm is not None:
        columns |= cut.columns()
        columns |= {"force_x_n": cut.sampled_n[0], "force_y_n": cut.sampled_n[1]}
        columns["spindle_load_pct"] = spindle.load_pct(physics.meter, cut.power_w, cut.rpm)
        if not cut.depth_mm.any():
            columns = _warm(physics, motion, columns)
    return _sensed(physics, columns, np.random.default_rng([seed, 9]))


@dataclass(frozen=True, slots=True, eq=False)
class _Cut:
    """Forces of the cut: at the ticks, on each axis in between, and the power."""

    rpm: Floats | None
    angle_rad: Floats
    depth_mm: Floats
    arc_rad: Floats
    sampled_n: Floats
    held_n: Mapping[str, Floats]
    power_w: Floats

    def columns(self) -> Columns:
        """Spindle and planned engagement, as a run log has them."""
        assert self.rpm is not None
        there = self.depth_mm > 0.0
        return {
            "spindle_rpm": self.rpm,
            "spindle_angle_rad": self.angle_rad,
            "axial_depth_mm": self.depth_mm,
            "entry_angle_rad": np.where(there, self.arc_rad[0], np.nan),
            "exit_angle_rad": np.where(there, self.arc_rad[1], np.nan),
        }


def _cut(physics: Physics, motion: Motion) -> _Cut:
    path, count = motion.path, len(motion.path.block)
    held = np.zeros((3, count * axis.STEPS))
    sampled, power = np.zeros((2, count)), np.zeros(count)
    lines = [block if isinstance(block, Line) else None for block in motion.blocks]
    depth = np.array([block.depth_mm if block else 0.0 for block in lines])[path.block]
    arc = np.array([block.arc_rad if block else (0.0, 0.0) for block in lines])[path.block].T.copy()
    rpm, turned = _turning(motion, count)
    angle = np.mod(motion.spindle_rad + turned, 2.0 * np.pi)
    if rpm is not None and depth.any():
        place = np.array([path.at_ticks(a) for a in (0, 1)])
        velocity = np.array([path.velocity(a) for a in (0, 1)])
        milling.forces(physics.cut, angle, rpm, place, velocity, depth, arc, sampled, held[:2], power)
    return _Cut(rpm, angle, depth, arc, sampled, dict(zip("xyz", held, strict=True)), power)


def _turning(motion: Motion, count: int) -> tuple[Floats | None, Floats]:
    """Speed at each tick, rev/min, and the angle turned; a new speed is reached over the first 0.25 s of its block."""
    stated = [block.spindle_rpm if isinstance(block, Dwell) else None for block in motion.blocks]
    if all(rpm is None for rpm in stated):
        return None, np.zeros(count)
    rpm, speed = np.empty(count), 0.0
    for number, new in enumerate(stated):
        here = np.flatnonzero(motion.path.block == number)
        before = speed if number else (new or 0.0)
        speed = before if new is None else new
        rpm[here] = before + (speed - before) * np.minimum(np.arange(len(here)) / 250.0, 1.0)
    rad_per_ms = rpm * (2.0 * np.pi / 60000.0)
    return rpm, np.concatenate([[0.0], np.cumsum(rad_per_ms)[:-1]])


def _disturbance(physics: Physics, count: int, chance: np.random.Generator) -> Floats:
    """The force nobody commands, (count · STEPS,), N: a stationary Ornstein-Uhlenbeck process."""
    keep = np.exp(-0.001 / axis.STEPS / physics.disturbance_s)
    white = chance.standard_normal(count * axis.STEPS) * np.sqrt(1.0 - keep**2)
    white[0] /= np.sqrt(1.0 - keep**2)
    return np.asarray(physics.disturbance_n * lfilter([1.0], [1.0, -keep], white))


def _from_outside(physics: Physics, motion: Motion, letter: str) -> Floats:
    """Return the force of a pump and another axis on this one, (count · STEPS,), N."""
    count = len(motion.path.block)
    force = np.zeros(count * axis.STEPS)
    if letter in physics.pump:
        size, hertz = physics.pump[letter]
        t_s = np.arange(len(force)) * (0.001 / axis.STEPS)
        force += size * np.sin(2.0 * np.pi * hertz * t_s + 1.0) * (np.sin(2.0 * np.pi * t_s / 9.0) > -0.4)
    if letter in physics.coupling:
        other, mass_kg = physics.coupling[letter]
        force -= np.repeat(0.001 * mass_kg * motion.path.acceleration("xyz".index(other)), axis.STEPS)
    return force


def _axis_run(physics: Physics, motion: Motion, letter: str, force: Floats) -> Floats:
    p, number, path = physics.axes[letter], "xyz".index(letter), motion.path
    reference = path.at_ticks(number, p.delay_s)
    forward = p.velocity_forward != 0.0 or p.acceleration_forward != 0.0 or p.compensation_a != 0.0
    velocity = path.velocity(number, p.delay_s) if forward else np.zeros(len(reference))
    acceleration = path.acceleration(number, p.delay_s) if forward else velocity
    speed = np.abs(path.velocity(number))
    if p.warmup != 0.0 and speed.any():  # an axis that does not move does not warm
        p = p._replace(warmup_w=float(np.mean(speed * (p.coulomb_n + p.viscous * speed))))
    out = np.empty((3, len(reference)))
    axis.run(p, reference, velocity, acceleration, force, HOLD, out)
    return out


def _stamped(physics: Physics, values: Floats) -> Floats:
    """Values as a clock stamps them that is off and runs at another rate: read between the ticks by a parabola."""
    if physics.clock_ppm == 0.0 and physics.clock_offset_s == 0.0:
        return values
    t_ms = np.arange(len(values), dtype=np.float64)
    return _between(values, t_ms - 1000.0 * physics.clock_offset_s - 1e-6 * physics.clock_ppm * t_ms)


def _between(values: Floats, place: Floats) -> Floats:
    """Return the values at places between the samples, by a parabola; the first and the last one beyond the ends."""
    place = np.clip(place, 0.0, len(values) - 1.0)
    middle = np.clip(np.round(place).astype(np.intp), 1, len(values) - 2)
    part = place - middle
    before, here, after = values[middle - 1], values[middle], values[middle + 1]
    return np.asarray(here + 0.5 * part * (after - before) + 0.5 * part**2 * (after - 2.0 * here + before))


def _warm(physics: Physics, motion: Motion, columns: Columns) -> Columns:
    """Adds the spindle's temperature of a run in air with a turning spindle, each second, and the growth of the axes."""
    load: Floats = np.asarray(columns["spindle_load_pct"], dtype=np.float64)[::1000]
    rpm: Floats = np.asarray(columns["spindle_rpm"], dtype=np.float64)[::1000]
    ambient = np.full(len(load), motion.ambient_c)
    off = np.zeros(len(load))
    warm = heat.temperature_c(physics.heat, 1.0, motion.start_c, load, rpm, ambient, off)
    count = len(columns["t_s"])
    slow = np.arange(count) % 1000 == 0
    rise = np.interp(np.arange(count) * 0.001, np.arange(len(warm)), warm - warm[0])
    for letter, p in physics.axes.items():
        if p.growth_mm_per_k != 0.0 and f"{letter}_table_mm" in columns:
            columns[f"{letter}_table_mm"] = columns[f"{letter}_table_mm"] + p.growth_mm_per_k * rise
    for name in ("spindle_angle_rad", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "force_x_n", "force_y_n"):
        del columns[name]
    spread = np.full(count, np.nan)
    spread[slow] = warm
    return columns | {"ambient_temp_c": np.full(count, round(motion.ambient_c, 2)), "spindle_temp_c": spread}


@dataclass(frozen=True, slots=True, eq=False)
class WarmUp:
    """A long run of the spindle, sampled each second: what repeated runs share; each (n,)."""

    load_pct: Floats
    rpm: Floats
    ambient_c: Floats
    coolant_on: Floats
    start_c: float


def warmup_of(chance: np.random.Generator, seconds: int = 7920) -> WarmUp:
    """Speeds and loads in steps of 8 to 35 minutes, some of them at rest, coolant now and then."""
    rpm, load, coolant = np.zeros(seconds), np.zeros(seconds), np.zeros(seconds)
    start, stands = 0, False
    while start < seconds:
        end = start + int(chance.uniform(500.0, 2100.0))
        stands = start > 0 and not stands and chance.random() < 0.4
        rpm[start:end] = 0.0 if stands else np.round(chance.uniform(2500.0, 9000.0))
        load[start:end] = 0.0 if stands else chance.uniform(12.0, 62.0)
        start = end
    for _ in range(int(chance.integers(1, 4))):
        begin = int(chance.uniform(0.05, 0.85) * seconds)
        coolant[begin : begin + int(chance.uniform(400.0, 1100.0))] = 1.0
    t_s = np.arange(seconds)
    middle, swing = float(chance.uniform(19.0, 25.0)), float(chance.uniform(0.2, 0.9))
    ambient = middle + swing * np.sin(2.0 * np.pi * t_s / float(chance.uniform(4000.0, 9000.0)) + chance.uniform(0.0, 6.0))
    return WarmUp(load, rpm, ambient, coolant, float(ambient[0] + chance.uniform(0.0, 4.0)))


def warmup_run(physics: Physics, warmup: WarmUp, seed: int) -> Columns:
    """Records a warm-up."""
    w = warmup
    temperature = heat.temperature_c(physics.heat, 1.0, w.start_c, w.load_pct, w.rpm, w.ambient_c, w.coolant_on)
    columns: Columns = {
        "t_s": np.arange(len(w.rpm), dtype=np.float64),
        "spindle_load_pct": w.load_pct,
        "spindle_rpm": w.rpm,
        "coolant_on": w.coolant_on,
        "ambient_temp_c": np.round(w.ambient_c, 2),
        "spindle_temp_c": temperature,
    }
    return _sensed(physics, columns, np.random.default_rng([seed, 9]))


def _sensed(physics: Physics, columns: Columns, chance: np.random.Generator) -> Columns:
    """Each reading with its sensor, its noise, its rounding; single precision."""
    noise = physics.noise
    sigma = {"pos_mm": noise.position_mm, "table_mm": noise.table_mm, "torque_a": noise.torque_a, "force": noise.force_n}
    sigma |= {"spindle_load_pct": noise.spindle_load_pct, "spindle_temp_c": noise.spindle_temp_c}
    period_s = float(columns["t_s"][1] - columns["t_s"][0])
    done: Columns = {}
    for name, values in columns.items():
        kind = "force" if name.startswith("force_") else name
        kind = name.partition("_")[2] if name[1:2] == "_" else kind
        if kind not in sigma:
            done[name] = values
            continue
        read = _read(np.asarray(values, dtype=np.float64), physics.sensors.get(name, SensorPhysics()), period_s)
        read = read + sigma[kind] * chance.standard_normal(len(read))
        read = np.round(np.round(read / ROUNDED[kind]) * ROUNDED[kind], 6)
        if name == "spindle_load_pct" and period_s < 0.01:
            read[np.arange(len(read)) % LOAD_EVERY != 0] = np.nan
        done[name] = read.astype(np.float32)
    return done


def _read(values: Floats, sensor: SensorPhysics, period_s: float) -> Floats:
    if sensor.late_s > 0.0:
        values = _between(values, np.arange(len(values), dtype=np.float64) - sensor.late_s / period_s)
    if sensor.lag_s > 0.0:
        there = np.isfinite(values)
        keep = np.exp(-period_s / sensor.lag_s)
        lagged, _ = lfilter([1.0 - keep], [1.0, -keep], values[there], zi=[keep * values[there][0]])
        values = values.copy()
        values[there] = lagged
    return sensor.bias + sensor.scale * values


def write(columns: Columns, path: Path) -> None:
    """Writes a run log; what is not a number becomes null."""
    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    pq.write_table(table, path, compression="zstd")
