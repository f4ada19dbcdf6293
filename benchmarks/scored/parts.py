"""Cuts beside the same cut of earlier parts and beside the twin, by the functions that the stream has (twin/anomaly/parts).

Models learn on week A, thresholds are fitted on the scores of week B, week C is judged, second by second, and goes on from the
state at the end of week B. The twin works out its expectation from the program's text and the machine's statement.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.scored.judged import Judged, outcome, rule_of, threshold_of
from benchmarks.simulated_cell.cell import Cell, machine_readings
from benchmarks.simulated_cell.machine import Machine
from benchmarks.simulated_cell.schedule import DAY_S
from benchmarks.simulated_cell.signals import FEATURES, Readings
from twin.anomaly.gate import gate
from twin.anomaly.parts.replay import ALL, EXPECTED, Ablation, Recorded, fit, replayed
from twin.expected import Expectation
from twin.expected.making import expectation_of
from twin.heat.run import Warming, spindle_temperature_c, thermal_constants
from twin.machine import machine_from_toml

Floats = NDArray[np.float64]
RESIDUAL = "twin/spindle_temp_residual_k"
SIGNALS = tuple(RESIDUAL if name == "spindle_temp_c" else name for name in FEATURES)
TICK_S, TAIL_S, LATE_LOOK_BACK_S = 1, 8.0, 26.0
ABLATIONS = {
    "parts": ALL,
    "parts -part": ALL._replace(has_parts=False),
    "parts -twin": ALL._replace(has_twin=False),
    "parts -peers": ALL._replace(has_peers=False),
    "parts -gates": ALL._replace(has_gates=False),
}


def expectations(machine: Machine, name: str) -> list[Expectation]:
    """Return the twin's expectation of each program of a machine, from its text and the machine's statement."""
    return [
        expectation_of(machine_from_toml(machine.toml(program, name), name), program.text, name=program.name)
        for program in machine.programs
    ]


def recorded(cell: Cell, place: int, *, has_twin: bool = True) -> Recorded:
    """The recording of one machine of the cell, as its control tells it, with what the twin expects at each line.

    The spindle's temperature is that beside the twin's, which knows speed, load, coolant and the air as the control tells them.
    """
    machine, schedule, name = cell.machines[place], cell.schedules[place], f"vmc{place + 1}"
    found = machine_readings(cell, place)
    look_back_s = LATE_LOOK_BACK_S if machine.label_late_s else 0.0
    return Recorded(
        machine=name,
        tick_s=float(TICK_S),
        signals=SIGNALS if has_twin else FEATURES,
        values=_beside_twin(machine, name, found) if has_twin else found.rows,
        programs=schedule.names,
        program=schedule.program,
        tool=schedule.tool_number,
        line=schedule.nc_line,
        feed_override_pct=schedule.feed_override_pct,
        spindle_override_pct=np.full(len(found.rows), 100.0),
        gated=gate(schedule.tool_change_active, float(TICK_S), TAIL_S, look_back_s),
        expected=_by_line(expectations(machine, name), schedule.program, schedule.nc_line),
    )


def _beside_twin(machine: Machine, name: str, found: Readings) -> Floats:
    """The rows with the temperature less the twin's."""
    load, rpm, _, measured_c, _ = found.rows.T
    stated = machine_from_toml(machine.toml(machine.programs[0], name), name)
    assert stated.thermal is not None, "a machine of the cell states its heat"
    warming = Warming(np.arange(len(load), dtype=np.float64), load, rpm, found.ambient_c, found.coolant_on.astype(np.float64))
    modelled_c = spindle_temperature_c(thermal_constants(stated.thermal), warming, found.ambient_c[0])[0]
    rows = found.rows.copy()
    rows[:, FEATURES.index("spindle_temp_c")] = measured_c - modelled_c
    return rows


def _by_line(known: Sequence[Expectation], program: NDArray[np.integer], line: NDArray[np.integer]) -> Floats:
    """(T, 6) in the order of EXPECTED; NaN in the warm-up, which is program 0, and where nothing is expected."""
    rows = np.full((1 + len(known), int(line.max()) + 1, len(EXPECTED)), np.nan)
    for place, one in enumerate(known, start=1):
        for number in range(rows.shape[1]):
            expected = one.at(number)
            if expected is not None:
                rows[place, number] = [np.nan if figure is None else figure for figure in expected]
    return rows[program, line]


def week(one: Recorded, start: int, stop: int, *, has_gates: bool) -> Recorded:
    """A stretch of a recording."""
    part = slice(start, stop)
    columns = ("values", "program", "tool", "line", "feed_override_pct", "spindle_override_pct", "expected")
    cut = {name: getattr(one, name)[part] for name in columns}
    gated = one.gated[part] if has_gates else np.zeros(stop - start, dtype=np.bool_)
    return replace(one, **cut, gated=gated, first_tick=start)


def judged_parts(
    cell: Cell, days: tuple[int, int, int], recordings: Sequence[Recorded], ablation: Ablation, alerts_per_week: float
) -> list[Judged]:
    """Each machine by itself: its threshold, what it finds, and what it should not have said."""
    ends = (np.cumsum(days) * DAY_S // TICK_S).tolist()
    starts = [0, *ends[:-1]]

    def of(which: int) -> list[Recorded]:
        return [week(one, starts[which], ends[which], has_gates=ablation.has_gates) for one in recordings]

    models = fit(of(0), ablation)
    before = replayed(models, of(1), None, ablation)
    limits = [
        threshold_of(before.scores[:, place], before.is_idle[:, place], TICK_S, alerts_per_week)
        for place in range(len(recordings))
    ]
    rules = [rule_of(limit, TICK_S) for limit in limits]
    after = replayed(models, of(2), rules, ablation, before.owns)
    return [
        outcome(
            cell,
            place,
            starts[2] * TICK_S,
            TICK_S,
            scores=after.scores[:, place],
            idle=after.is_idle[:, place],
            on=after.is_alarm[:, place],
            has_threshold=limits[place] is not None,
        )
        for place in range(len(recordings))
    ]
