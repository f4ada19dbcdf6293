"""One day of a machine in production, or some hours of it, as its control shows it.

    cutting power (cycles, lots, wear) → load meter → heat → sensors → what is shown

Load meter, heat and sensors are those of the simulator, with the machine's effects on them, over the whole stretch, so that
what holds a peak or lags goes on from part to part. A stretch begins with a spindle that has the temperature of what is around
it and behind it: begin one in the morning.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isnan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.production.chance import DAY_S, HOUR_S, drawn, wandering
from cnctwin.standins.production.cycle import TICK_S, Cycle
from cnctwin.standins.production.schedule import USUAL_SHIFTS, Execution, Shifts, Ticks, scheduled
from cnctwin.standins.production.shown import USUAL_DISPLAY, Shown
from cnctwin.standins.production.variation import USUAL, Variation
from cnctwin.standins.simulated_machine.description import program_text
from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants, thermal_quantities
from twin.machine import MachineFile
from twin.runlog import RunLog, run_log
from twin.sensor.reading import readings
from twin.sensor.sensing import sensor_quantities
from twin.spindle.load import spindle_constants, spindle_load_pct, spindle_quantities

Floats = NDArray[np.float64]
FOLDER = Path(__file__).parent
IDLE, WEEK, READING, NOISE = 2, 3, 4, 5
"""The numbers under which each draws its chance."""
GREASE_S = 1200.0
MEAN_AMBIENT_C = 22.0
SEASON_S = 182.0 * DAY_S
HEAT_S = 1.0
ANOTHER_SPEED = 0.02
TOLD = (
    "cutting_power_kw", "spindle_rpm", "spindle_rpm_cmd", "feed_mm_min",
    "tool_number", "tool_change_active", "coolant_on", "line",
)  # fmt: skip


def programs() -> dict[str, str]:
    """Return the programs that the simulated machine runs in production, by name; the first one warms it up."""
    warm_up, bracket = ((FOLDER / name).read_text(encoding="utf-8") for name in ("warm_up.nc", "bracket.nc"))
    return {"O9000": warm_up, "O1701": program_text(), "O1802": bracket}


@dataclass(frozen=True, eq=False)
class Production:
    """A machine as it is built, what it makes, and what its control shows. A day is a function of its seed and its start.

    programs: name → text, the first one warms the spindle up
    """

    machine: MachineFile
    seed: int
    shifts: Shifts = USUAL_SHIFTS
    variation: Variation = USUAL
    shown: Shown = USUAL_DISPLAY
    programs: Mapping[str, str] = field(default_factory=programs)

    @cached_property
    def cycles(self) -> tuple[Cycle, ...]:
        """The runs of its programs."""
        return tuple(Cycle.of(self.machine, name, text) for name, text in self.programs.items())

    def day(self, start_s: float, hours: float = 24.0, start_temp_c: float | None = None) -> "Day":
        """Return the hours from `start_s`, s since 1970, on. start_temp_c: of the spindle, None = as warm as the air."""
        ticks = scheduled(self.cycles, self.shifts, self.variation, self.seed, (start_s, start_s + hours * HOUR_S))
        return _worked_out(self, ticks, start_s, start_temp_c)


@dataclass(frozen=True, slots=True, eq=False)
class Day:
    """Rows of what the control shows while it is switched on: one a second, and one where a state changes.

    at_s: (n,) s since 1970; columns: signal → (n,), NaN = null; program, exec_state: (n,) of text; end_temp_c: of the spindle
    """

    at_s: Floats
    columns: Mapping[str, Floats]
    program: NDArray[np.object_]
    exec_state: NDArray[np.object_]
    end_temp_c: float

    def __len__(self) -> int:
        return len(self.at_s)

    def rows(self) -> Iterator[tuple[float, dict[str, Any]]]:
        """Yield time and all signals of each row, by their canonical names; null is None."""
        names = [*self.columns, "program", "exec_state"]
        flags = frozenset({"tool_change_active", "coolant_on"})
        whole = frozenset({"tool_number", "nc_line"})
        series = []
        for name, values in self.columns.items():
            kind: Callable[[float], Any] = bool if name in flags else int if name in whole else float
            series.append([None if isnan(value) else kind(value) for value in values.tolist()])
        for at_s, *row in zip(self.at_s.tolist(), *series, self.program, self.exec_state, strict=True):
            yield at_s, dict(zip(names, row, strict=True))

    def thinned(self, every_s: float) -> "Day":
        """Return the rows at multiples of a time, and all in which a state, a speed or a feed becomes another one."""
        kept = np.diff(self.at_s // every_s, prepend=-1.0) != 0.0
        for name in ("tool_number", "tool_change_active", "coolant_on"):
            kept[1:] |= np.diff(np.nan_to_num(self.columns[name])) != 0.0
        for texts in (self.program, self.exec_state):
            kept[1:] |= texts[1:] != texts[:-1]
        rpm, feed = self.columns["spindle_rpm"], self.columns["feed_mm_min"]
        kept[1:] |= np.abs(np.diff(rpm)) > ANOTHER_SPEED * rpm[1:]
        kept[1:] |= (feed[1:] > 0.0) != (feed[:-1] > 0.0)
        columns = {name: values[kept] for name, values in self.columns.items()}
        return Day(self.at_s[kept], columns, self.program[kept], self.exec_state[kept], self.end_temp_c)

    def run_log(self) -> RunLog:
        """Return the rows as a recording."""
        columns: dict[str, NDArray[Any]] = {name: values for name, values in self.columns.items() if name != "nc_line"}
        columns |= {"t_s": self.at_s - self.at_s[0], "line": self.columns["nc_line"]}
        return run_log(columns | {"program": self.program, "exec_state": self.exec_state}, "production")


def production_days(
    stretches: Sequence[tuple[float, Production]], start_s: float, start_temp_c: float | None = None
) -> Iterator[Day]:
    """Yield the days of a machine from `start_s` on, cut at midnights and where it becomes another one.

    stretches: until when, s since 1970, the machine is as stated; start_temp_c: of the spindle, None = as warm as the air
    """
    temp_c = start_temp_c
    for until_s, production in stretches:
        while start_s < until_s:
            end_s = min((start_s // DAY_S + 1.0) * DAY_S, until_s)
            day = production.day(start_s, (end_s - start_s) / HOUR_S, temp_c)
            temp_c, start_s = day.end_temp_c, end_s
            yield day


def production_day(machine: MachineFile, seed: int, start_s: float, hours: float = 24.0) -> Day:
    """Return some hours of a machine as built, with shifts, variation and display of the usual kind."""
    return Production(machine, seed).day(start_s, hours)


def _worked_out(given: Production, ticks: Ticks, start_s: float, start_temp_c: float | None) -> Day:
    """The stretch from its ticks: load, heat and sensors over all of it, then what is shown."""
    machine, variation, seed = given.machine, given.variation, given.seed
    at_s: Floats = start_s + TICK_S * np.arange(len(ticks.row), dtype=np.float64)
    stacked = {name: _stacked(given.cycles, name)[ticks.row] for name in TOLD}
    runs = (ticks.execution == Execution.ACTIVE).astype(np.float64)
    turning_s = TICK_S * np.cumsum(stacked["spindle_rpm"] > 0.0)
    added_kw = np.where(stacked["spindle_rpm"] > 0.0, variation.cold_grease_kw * np.exp(-turning_s / GREASE_S), 0.0)
    if variation.idle_kw:
        added_kw += variation.idle_kw * wandering(seed, IDLE, at_s, HOUR_S) * (stacked["spindle_rpm"] > 0.0)
    load_pct = _load_pct(
        machine, 1000.0 * stacked["cutting_power_kw"] * ticks.power_scale * runs, stacked["spindle_rpm"], added_kw
    )
    step = round(HEAT_S / TICK_S)
    ambient_c = ambient_temp_c(given, at_s[::step])
    air_c = ambient_c + variation.ambient_reading_k * wandering(seed, READING, at_s[::step], HOUR_S)
    warming = Warming(
        at_s[::step] - start_s, load_pct[::step], stacked["spindle_rpm"][::step], air_c, stacked["coolant_on"][::step]
    )
    temp_c, shown_c = _temperature_c(machine, warming, float(air_c[0]) if start_temp_c is None else start_temp_c)
    chance = drawn(seed, NOISE, int(start_s))
    if variation.rpm:
        wobble = variation.rpm * np.repeat(chance.standard_normal(len(ambient_c)), step)[: len(at_s)]
        stacked["spindle_rpm"] = np.where(stacked["spindle_rpm"] > 50.0, stacked["spindle_rpm"] + wobble, stacked["spindle_rpm"])
    shown_pct = _sensed(machine, "spindle_load_pct", load_pct, np.full(len(at_s), TICK_S))
    shown_pct += machine.noise.get("spindle_load_pct", 0.0) * chance.standard_normal(len(at_s))
    shown_c += machine.noise.get("spindle_temp_c", 0.0) * chance.standard_normal(len(shown_c))
    columns = {
        "spindle_rpm": stacked["spindle_rpm"],
        "spindle_rpm_cmd": stacked["spindle_rpm_cmd"],
        "spindle_load_pct": shown_pct,
        "feed_mm_min": stacked["feed_mm_min"] * runs,
        "tool_number": _tool_held(stacked["tool_number"], ticks),
        "tool_change_active": stacked["tool_change_active"],
        "coolant_on": stacked["coolant_on"],
        "nc_line": stacked["line"],
        "spindle_temp_c": np.repeat(shown_c, step)[: len(at_s)],
        "ambient_temp_c": np.repeat(ambient_c, step)[: len(at_s)],
    }
    rows = _rows_shown(ticks, columns, step)
    names = np.array(tuple(given.programs), dtype=object)
    states = np.array([state.name for state in Execution], dtype=object)
    return Day(
        at_s[rows],
        {name: given.shown.shown(name, values[rows]) for name, values in columns.items()},
        names[ticks.program[rows]],
        states[ticks.execution[rows]],
        float(temp_c[-1]),
    )


def _stacked(cycles: Sequence[Cycle], name: str) -> Floats:
    """A column of all cycles, one after the other; row 0 is the machine at rest."""
    return np.concatenate([[0.0], *(getattr(cycle, name) for cycle in cycles)])


def _load_pct(machine: MachineFile, cutting_power_w: Floats, spindle_rpm: Floats, added_kw: Floats) -> Floats:
    """The load that the drive has, before its sensor; a spindle at rest takes nothing."""
    assert machine.spindle is not None, "a machine without [spindle] has no load"
    constants, names = _with_effects(machine, spindle_quantities(), dict(spindle_constants(machine.spindle)))
    found = spindle_load_pct(constants, cutting_power_w, spindle_rpm, period_s=TICK_S, effects=names, added_kw=added_kw)
    return np.where(spindle_rpm > 0.0, found[0], 0.0)


def _temperature_c(machine: MachineFile, warming: Warming, start_c: float) -> tuple[Floats, Floats]:
    """The temperature of the spindle, and what its sensor says."""
    assert machine.thermal is not None, "a machine without [thermal] has no temperature"
    constants, names = _with_effects(machine, thermal_quantities(), dict(thermal_constants(machine.thermal)))
    temp_c = spindle_temperature_c(constants, warming, start_c, effects=names)[0]
    return temp_c, _sensed(machine, "spindle_temp_c", temp_c, np.full(len(temp_c), HEAT_S), temp_c - temp_c[0])


def _with_effects(
    machine: MachineFile, known: Mapping[str, str], constants: dict[str, float]
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The constants of a stage with those of its effects, and their names."""
    effects = added_effects(machine, known)
    for name, values in effects.items():
        constants |= {f"{name}__{key}": value for key, value in effect_named(name).checked(values).items()}
    return constants, tuple(effects)


def _sensed(machine: MachineFile, signal: str, values: Floats, since_s: Floats, rise_k: Floats | None = None) -> Floats:
    """The readings of a signal's sensor."""
    return readings(values, since_s, added_effects(machine, sensor_quantities(), signal), rise_k).copy()


def ambient_temp_c(given: Production, at_s: Floats) -> Floats:
    """Return the air of the shop: by the season, from day to day, and warmest in the afternoon."""
    variation = given.variation
    season = variation.ambient_season_k * np.sin(2.0 * np.pi * at_s / SEASON_S)
    week = variation.ambient_week_k * wandering(given.seed, WEEK, at_s, DAY_S)
    day = variation.ambient_day_k * np.sin(2.0 * np.pi * (at_s / DAY_S - 9.0 / 24.0))
    return np.asarray(MEAN_AMBIENT_C + season + week + day)


def _tool_held(tool: Floats, ticks: Ticks) -> Floats:
    """The tool in the spindle, null during a change; at rest it is the last one."""
    known = np.where(ticks.row == 0, -1.0, tool)
    last = np.maximum.accumulate(np.where(known >= 0.0, np.arange(len(known)), 0))
    held = known[last]
    return np.where(held > 0.0, held, np.nan)


def _rows_shown(ticks: Ticks, columns: Mapping[str, Floats], step: int) -> NDArray[np.int64]:
    """The ticks that are shown: one a second, and where a state changes."""
    is_shown = np.zeros(len(ticks.row), dtype=np.bool_)
    is_shown[::step] = True
    for states in (
        ticks.execution,
        ticks.program,
        columns["tool_change_active"],
        columns["coolant_on"],
        np.nan_to_num(columns["tool_number"]),
    ):
        is_shown[1:] |= np.diff(states) != 0
    return np.flatnonzero(is_shown & (ticks.execution != Execution.OFF))
