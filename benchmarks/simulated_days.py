"""Days of the simulated machine, a second apart: parts as they are machined, one after the other, and the heat of a spindle that
stands in a column, which the twin's physics does not have.

A part is simulated once for each program (speeds and feeds of the base plate, scaled) and repeated, as a series is; the
temperature is then that of the machine as it was built, over the whole day. Nights are off: a day is a stretch of its own.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.simulated_machine.as_built import machine_as_built
from cnctwin.standins.simulated_machine.description import program_text
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.machine import Thermal
from twin.residual.features import AMBIENT, FEED, LOAD, MEASURED, PHYSICS, POSITIONS, SPEED
from twin.residual.table import Recorded
from twin.simulator.simulation import simulate

Floats = NDArray[np.float64]
DAY_S = 86_400.0
CYCLE = {SPEED: "spindle_rpm", LOAD: "spindle_load_pct", FEED: "feed_mm_min"} | {name: f"{name[5]}_pos_mm" for name in POSITIONS}
COLUMN = {"second_thermal_mass__conductance_w_per_k": 4.0, "second_thermal_mass__capacity_j_per_k": 40_000.0}
"""Effect that the physics lacks, in the size that machines show (twin/effects/second_thermal_mass.py)."""


@dataclass(frozen=True, slots=True)
class Day:
    """programs: (factor of the speeds, factor of the feeds) of the series that are cut; ambient_c: in the morning
    hours: from switching on to switching off
    """

    programs: tuple[tuple[float, float], ...]
    ambient_c: float
    hours: float = 14.0


ORDINARY = ((1.0, 1.0), (0.8, 0.9), (0.6, 0.7), (0.9, 0.6))
"""Programs of ordinary days."""


def ordinary_days(count: int) -> tuple[Day, ...]:
    """Days with two of the ordinary programs each, the shop a little warmer or colder."""
    return tuple(
        Day((ORDINARY[day % 4], ORDINARY[(day * 3 + 1) % 4]), 20.0 + 2.5 * np.sin(2.4 * day), 12.0 + day % 3)
        for day in range(count)
    )


def simulated_days(
    days: Sequence[Day], thermal: Thermal, seed: int, lacks: Mapping[str, float] | None = None, start_day: int = 0
) -> Recorded:
    """The days as a recording with the physics beside it. thermal: constants of the twin; lacks: what its physics does not
    have."""
    rng = np.random.default_rng(seed)
    columns: dict[str, list[Floats]] = {name: [] for name in (*CYCLE, AMBIENT, MEASURED, PHYSICS)}
    t_s, stretch = [], []
    built = machine_as_built().thermal
    assert built is not None
    for number, day in enumerate(days):
        own = _day(day, rng)
        length = len(own[SPEED])
        at_s = (start_day + number) * DAY_S + 6.0 * 3600.0 + np.arange(length)
        warming = Warming(at_s, own[LOAD], own[SPEED], own[AMBIENT])
        start_c = float(own[AMBIENT][0])
        more = COLUMN if lacks is None else lacks
        effects = sorted({name.split("__")[0] for name in more})
        warm = spindle_temperature_c(thermal_constants(built) | dict(more), warming, start_c, effects=effects)[0]
        own[MEASURED] = np.round(warm + rng.normal(0.0, 0.03, length), 1)
        own[PHYSICS] = spindle_temperature_c(thermal_constants(thermal), warming, float(own[MEASURED][0]))[0]
        for name, values in columns.items():
            values.append(own[name])
        t_s.append(at_s)
        stretch.append(np.full(length, number, dtype=np.int64))
    return Recorded(np.concatenate(t_s), np.concatenate(stretch), {name: np.concatenate(v) for name, v in columns.items()})


def _day(day: Day, rng: np.random.Generator) -> dict[str, Floats]:
    """Signals of a day, a second apart: series of parts, pauses between parts, breaks between series."""
    seconds = int(day.hours * 3600.0)
    parts: dict[str, list[Floats]] = {name: [] for name in CYCLE}
    length = 0
    while length < seconds:
        cycle = part_of(*day.programs[int(rng.integers(len(day.programs)))])
        for _ in range(int(rng.integers(10, 60))):
            pause = int(rng.integers(9, 25))
            for name, values in parts.items():
                values += [cycle[name], np.full(pause, cycle[name][-1] if name in POSITIONS else 0.0)]
            length += len(cycle[SPEED]) + pause
        pause = int(rng.integers(300, 2400))
        for values in parts.values():
            values.append(np.full(pause, values[-1][-1]))
        length += pause
    found = {name: np.concatenate(values)[:seconds] for name, values in parts.items()}
    wear = rng.uniform(0.9, 1.15)
    found[LOAD] = np.maximum(0.0, np.round(found[LOAD] * wear, 1))
    hours = np.arange(seconds) / 3600.0
    found[AMBIENT] = np.round(day.ambient_c + 2.0 * np.sin(np.pi * hours / 14.0) + 0.3 * np.sin(hours * np.pi), 1)
    return found


@cache
def part_of(speed: float, feed: float) -> Mapping[str, Floats]:
    """A part with speeds and feeds scaled, a second apart, as the control shows it."""
    text = re.sub(r"\bS(\d+)", lambda m: f"S{round(float(m[1]) * speed)}", program_text())
    text = re.sub(r"\bF(\d+)\.", lambda m: f"F{round(float(m[1]) * feed)}.", text)
    run = simulate(machine_as_built(), text, seed=1, start_temperature_c=23.0).run
    places = np.searchsorted(run.t_s, np.arange(0.0, float(run.t_s[-1]), 1.0))
    return {name: np.asarray(run[column][places]) for name, column in CYCLE.items()}
