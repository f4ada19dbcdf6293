"""From samples as they were recorded to what a residual is learned from: signals at ticks, and the physics beside them.

The physics runs as the processor `thermal` runs it: from the measured temperature, inputs held between samples, again after a
silence, or after so long without speed or load, as `GAP_S_MAX`.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.live.heat import HeatInput, LiveHeat
from twin.residual.errors import ResidualError
from twin.residual.features import AMBIENT, FEED, LOAD, MEASURED, PHYSICS, POSITIONS, SPEED
from twin.residual.physics import Physics
from twin.residual.table import GAP_S_MAX, Recorded
from twin.runlog import RunLog
from twin.simulator.response import RunInput, respond

Floats = NDArray[np.float64]
COLUMNS = {name: f"{name[5]}_pos_mm" for name in POSITIONS}
"""Their names in a run log."""
COOLANT = "coolant_on"
RECORDED = (SPEED, LOAD, FEED, *POSITIONS, AMBIENT, MEASURED, COOLANT)
TICKS_MAX = 20_000_000


class Samples(NamedTuple):
    """The samples of one signal, oldest first: t_s (n,); value (n,), NaN = reported as unknown."""

    t_s: Floats
    value: Floats

    def held(self, at_s: Floats, side: str = "right") -> Floats:
        """The last value at each of these times; side "left": before it. NaN where there is none, or it is unknown."""
        place = np.searchsorted(self.t_s, at_s, side=side) - 1  # type: ignore[call-overload]
        return np.where(place >= 0, self.value[np.maximum(place, 0)], np.nan) if len(self.t_s) else np.full(len(at_s), np.nan)


def recorded_run(run: RunLog, physics: Physics, tick_s: float = 1.0) -> Recorded:
    """A run log with the physics beside it. Raises ResidualError where a signal that is needed is not in it."""
    told = {}
    for name in RECORDED:
        values = run.columns.get(COLUMNS.get(name, name), run.columns.get(name))
        if values is not None and (there := np.isfinite(values)).any():
            told[name] = Samples(run.t_s[there], values[there])
    return recorded_of(told, physics, tick_s, run.source)


def recorded_of(told: Mapping[str, Samples], physics: Physics, tick_s: float = 1.0, source: str = "the recording") -> Recorded:
    """Signals by name, with the physics beside them. Raises ResidualError where one that is needed is missing."""
    if missing := [name for name in (SPEED, LOAD, MEASURED) if name not in told]:
        raise ResidualError(f"{source}: there is no {', no '.join(missing)}, without which no residual can be learned")
    if AMBIENT not in told:
        if physics.ambient_temp_c is None:
            raise ResidualError(f"{source}: there is no {AMBIENT}; configure ambient_temp_c in [thermal], as the twin has it")
        told = {**told, AMBIENT: Samples(np.array([-np.inf]), np.array([physics.ambient_temp_c]))}
    times = np.unique(np.concatenate([one.t_s for one in told.values()]))
    times = times[np.isfinite(times)]
    if (times[-1] - times[0]) / tick_s > TICKS_MAX:
        raise ResidualError(f"{source}: is longer than {TICKS_MAX} ticks of {tick_s:g} s; split it")
    driven = np.isfinite(told[SPEED].held(times)) & np.isfinite(told[LOAD].held(times))
    live = times[driven]
    if not len(live):
        raise ResidualError(f"{source}: speed and load are never known together")
    parts = [_stretch(told, physics, part, tick_s) for part in np.split(live, np.flatnonzero(np.diff(live) > GAP_S_MAX) + 1)]
    kept = [part for part in parts if len(part.t_s)]
    if not kept:
        raise ResidualError(f"{source}: no stretch of it is longer than {tick_s:g} s")
    return joined(kept, 0.0)


def _stretch(told: Mapping[str, Samples], physics: Physics, live: Floats, tick_s: float) -> Recorded:
    """One stretch of the physics: ticks after its first moment, up to its last."""
    ticks = np.arange(np.floor(live[0] / tick_s) + 1.0, np.floor(live[-1] / tick_s) + 1.0) * tick_s
    grid = np.union1d(live, ticks)
    rpm, load, ambient = (told[name].held(grid) for name in (SPEED, LOAD, AMBIENT))
    signals = {name: one.held(ticks, "left") for name, one in told.items()}
    known, start = np.isfinite(ambient), told[MEASURED].held(grid[:1])[0]
    if not len(ticks) or not known.any():
        modelled = np.full(len(ticks), np.nan)
    else:
        coolant = np.nan_to_num(told[COOLANT].held(grid)) if COOLANT in told else np.zeros(len(grid))
        begun_c = float(ambient[known][0])
        if np.isfinite(start):
            first = HeatInput(float(load[0]), float(rpm[0]), begun_c, float(coolant[0]))
            begun = LiveHeat.of(physics.machine).started_at_reading(float(start), first)
            begun_c = begun_c if begun is None else begun.temperature_c
        run = RunInput(grid, spindle_rpm=rpm, ambient_temp_c=ambient, coolant_on=coolant, start_temp_c=begun_c)
        warm = respond(physics.machine, run, recorded={LOAD: load}).columns[MEASURED]
        modelled = np.where(np.isfinite(signals[AMBIENT]), warm[np.searchsorted(grid, ticks)], np.nan)
    return Recorded(ticks, np.zeros(len(ticks), dtype=np.int64), {**signals, PHYSICS: modelled})


def joined(parts: Sequence[Recorded], apart_s: float) -> Recorded:
    """One after the other; a part that begins before the one before it ends is put `apart_s` after that."""
    moved, stretches, end_s, number = [], [], -np.inf, 0
    for part in parts:
        shift_s = end_s + apart_s - part.t_s[0] if part.t_s[0] <= end_s else 0.0
        moved.append(part.t_s + shift_s)
        stretches.append(part.stretch + number)
        end_s, number = float(moved[-1][-1]), int(stretches[-1][-1]) + 1
    names = {name: None for part in parts for name in part.signals}
    signals = {name: np.concatenate([part.signals.get(name, np.full(len(part.t_s), np.nan)) for part in parts]) for name in names}
    return Recorded(np.concatenate(moved), np.concatenate(stretches), signals)
