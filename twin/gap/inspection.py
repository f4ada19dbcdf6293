"""Looks a case over before anything is computed: what is missing, not evenly sampled, too slow, or contradicts itself.

What can be mended is, and said; what cannot be used is left out, and said.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from twin.case import Case, Run, RunAtHand, RunKind
from twin.effects.catalogue import catalogue
from twin.errors import CaseError, RunLogError
from twin.gap.at_odds import with_known_cut, without_axes_at_odds, without_axes_of_another_kind
from twin.gap.dynamometer.cutting import is_of_forces_alone
from twin.gap.dynamometer.turn_run import TurnRun, turn_run
from twin.gap.labels import measured_signals
from twin.gap.sampling.servo_ticks import SlowRun, on_servo_ticks
from twin.gap.stages.air import air_runs
from twin.gap.stages.cut import cut_runs
from twin.gap.stages.heat import heat_runs
from twin.gap.stages.tool_change import change_runs
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import tool_of

Floats = NDArray[np.float64]
CONTRADICTION = 0.3
"""Part of what a signal does by which repeated runs may not differ."""
LENGTH = 0.02
"""Part of its length by which a repeated run may be longer."""
TEMPERATURE = "spindle_temp_c"
UNDRIVEN_S = 60.0
"""Time for which what heats the spindle may be unknown without being mentioned."""
HEAT = ("spindle_rpm", "spindle_load_pct", "ambient_temp_c")
RUNS_NAMED = 4
SHORT = 0.5
"""Part of R·C below which a run of the heat is short."""
NEARLY_K = 4.0
"""By which a spindle that starts cold may differ from its surroundings."""
USUAL = (("spindle_rpm", "rev/min", 150.0), ("spindle_load_pct", "%", 1.0))
"""Level that the drives of the heat reach in any warm-up."""
ROWS_MIN, FEW = 10, 100
"""Rows of a warm-up below which it says nothing; samples below which a signal that does not change is nothing to wonder at."""


def inspected(case: Case) -> tuple[Case, tuple[str, ...]]:
    """The case as it can be used, and what was found, a sentence each.

    Raises RunLogError where a recording cannot be read at all, CaseError where none is left that could be compared.
    """
    notes: list[str] = []
    runs = tuple(run if run.entry.kind is RunKind.PROGRAM else _usable(run, case.machine, notes) for run in case.runs)
    runs = _repeats_that_agree(Case(case.name, case.machine, runs), notes)
    looked = Case(case.name, case.machine, runs)
    if not any(run.entry.kind is RunKind.PROGRAM or _comparable(run, case.machine) for run in runs):
        there = ", ".join(runs[0].log.columns) or "no other columns"
        raise CaseError(f"{case.name}: no run can be compared with the machine: {(*notes, f'there are {there}')[0]}")
    if not looked.of(role="check"):
        notes.append("no run of role check: this is judged on the runs that were fitted, which flatters")
    return looked, _said_once(notes)


def slow_effects(case: Case) -> frozenset[str]:
    """Effects that recordings as slow as these cannot show."""
    axes = [run for run in case.of(role="fit") if run.entry.kind is not RunKind.PROGRAM and run.log.axes()]
    if not axes or not all(isinstance(run, SlowRun) for run in axes):
        return frozenset()
    return frozenset(effect.name for effect in catalogue().values() if effect.shows_only_fast)


def _comparable(run: Run, machine: MachineFile) -> bool:
    """Return True where the machine can answer in a signal of the run."""
    log = run.log
    axes = any(
        log.has(f"{a}_ref_mm") and any(log.has(f"{a}_{measured}") for measured in ("pos_mm", "table_mm", "torque_a"))
        for a in machine.axes
    ) or any(_alone(log, a) for a in machine.axes)
    seldom = any(found(machine, (run,)) for found in (cut_runs, air_runs, heat_runs, change_runs))
    return axes or isinstance(run, TurnRun) or seldom


def _alone(log: RunLog, letter: str) -> bool:
    """Return True where a part of an axis can be compared without its reference: its mechanics, or its table."""
    return log.has(f"{letter}_pos_mm") and any(log.has(f"{letter}_{answer}") for answer in ("torque_a", "table_mm"))


def _said_once(notes: Iterable[str]) -> tuple[str, ...]:
    """Return notes that say the same of several runs as one, with the names of the runs.

    >>> _said_once(["runs/a: is short", "runs/b: is short", "no run of role check", "runs/c: is short"])
    ('runs/a, runs/b, runs/c: is short', 'no run of role check')
    """
    runs: dict[str, list[str]] = {}
    for note in notes:
        name, colon, said = note.partition(": ")
        runs.setdefault(said if colon else note, []).extend([name] if colon else [])
    return tuple(f"{_listed(names)}: {said}" if names else said for said, names in runs.items())


def _listed(names: list[str]) -> str:
    more = [f"{len(names) - RUNS_NAMED} more"] if len(names) > RUNS_NAMED else []
    return ", ".join([*names[:RUNS_NAMED], *more])


def _usable(run: Run, machine: MachineFile, notes: list[str]) -> Run:
    log = _cleaned(run, notes)
    machine = machine.with_tool(tool_of(log, machine))
    if is_of_forces_alone(log, machine.axes):
        turned = turn_run(run, log, machine, notes)
        if turned is not None or not log.axes():
            return turned or RunAtHand(run.entry, run.folder, log)
    if not log.axes():
        if len(log) < ROWS_MIN:
            raise RunLogError(f"{run.name}: has {len(log)} rows; a warm-up of less than {ROWS_MIN} says nothing")
        notes += _heat_unknown(run, log, machine)
        return RunAtHand(run.entry, run.folder, log)
    for letter in log.axes():
        if letter not in machine.axes:
            notes.append(f"{run.name}: axis {letter} is not in the machine's file, and is not compared")
        elif not log.has(f"{letter}_ref_mm"):
            what = "its parts are compared alone" if _alone(log, letter) else f"axis {letter} is not compared"
            notes.append(f"{run.name}: {letter}_ref_mm is not recorded, and {what}")
    log = without_axes_at_odds(run, without_axes_of_another_kind(run, log, machine, notes), notes)
    if not log.axes():
        return RunAtHand(run.entry, run.folder, log)
    ticked = on_servo_ticks(run, log, machine, notes)
    if isinstance(ticked, SlowRun):
        return ticked
    return replace(ticked, recording=with_known_cut(run, ticked.log, machine, notes))  # type: ignore[call-arg]


def _heat_unknown(run: Run, log: RunLog, machine: MachineFile) -> list[str]:
    """Note whatever keeps the temperature from being compared, or makes it doubtful."""
    missing = ([] if machine.thermal else ["[thermal] in the machine's file"]) + [name for name in HEAT if not log.has(name)]
    if not log.has(TEMPERATURE):
        return [f"{run.name}: {TEMPERATURE} is not recorded, nor is an axis"]
    if missing:
        return [f"{run.name}: {TEMPERATURE} is not compared without {', '.join(missing)}"]
    said = [
        f"{run.name}: {name} is at most {np.nanmax(log[name]):.3g} {unit}; is it in another unit?"
        for name, unit, least in USUAL
        if 0.0 < np.nanmax(log[name]) < least
    ]
    if machine.thermal is not None:
        lasts_s, constant_s = float(log.t_s[-1]), machine.thermal.resistance_k_per_w * machine.thermal.capacity_j_per_k
        if lasts_s < SHORT * constant_s:
            said.append(
                f"{run.name}: lasts {lasts_s:.0f} s, and R·C is {constant_s:.0f} s: the twin starts at the temperature that is "
                "read, so an offset of the sensor shows only as the spindle comes nearer to its surroundings, here hardly"
            )
    start, ambient = (float(log[n][np.isfinite(log[n])][0]) for n in (TEMPERATURE, "ambient_temp_c"))
    for one, other, name in ((ambient, start, TEMPERATURE), (start, ambient, "ambient_temp_c")):
        for unit, reading in (("°F", 1.8 * one + 32.0), ("K", one + 273.15)):
            if abs(other - reading) < NEARLY_K and abs(other - one) > 2.0 * NEARLY_K:
                said.append(f"{run.name}: {name} starts at {other:.4g}, which is {one:.4g} °C in {unit}; is it in {unit}?")
    for name in HEAT:
        there = np.append(log.t_s[np.isfinite(log[name])], log.t_s[-1])
        longest = int(np.argmax(np.diff(there))) if len(there) > 1 else 0
        for_s = float(np.diff(there)[longest]) if len(there) > 1 else 0.0
        if for_s > UNDRIVEN_S and for_s > 10.0 * float(np.median(np.diff(there))):
            said.append(f"{run.name}: {name} has no value for {for_s:.0f} s from {there[longest]:.0f} s on; the last one is held")
    return said


def _cleaned(run: Run, notes: list[str]) -> RunLog:
    """From 0 s on, what is infinite not a number, without columns that have no sample; says where samples are missing."""
    log = run.log
    columns: dict[str, Floats] = {}
    for name, values in log.columns.items():
        finite = np.isfinite(values)
        infinite = int(np.isinf(values).sum())
        if infinite:
            notes.append(f"{run.name}: {name} is infinite in {infinite} samples; they are left out")
        if finite.any():
            columns[name] = np.where(finite, values, np.nan) if infinite else values
        else:
            notes.append(f"{run.name}: {name} has no value at all; it counts as not recorded")
    cleaned = replace(log, t_s=log.t_s - log.t_s[0], columns=columns)
    for name in measured_signals(cleaned):
        missing = _missing(columns[name])
        if len(log) > FEW and np.nanmin(columns[name]) == np.nanmax(columns[name]):
            notes.append(f"{run.name}: {name} is {np.nanmin(columns[name]):.6g} throughout; is it connected?")
        if missing:
            notes.append(f"{run.name}: {name} has no value in {missing} of {len(log)} samples; they are left out")
    return cleaned


def _missing(values: Floats) -> int:
    """Samples that a signal does not have, beside those that its own slower rate leaves out."""
    there = np.flatnonzero(np.isfinite(values))
    if len(there) < 3:
        return 0
    every = max(int(np.median(np.diff(there))), 1)
    missing = -(-len(values) // every) - len(there)
    return missing if missing > 0.01 * len(values) / every else 0


def _repeats_that_agree(case: Case, notes: list[str]) -> tuple[Run, ...]:
    """The runs, repeats of the same length, and those that contradict each other no longer said to be repeats."""
    runs = {run.name: run for run in case.runs}
    for name, run in runs.items():
        if run.entry.repeats is None or not isinstance(run, RunAtHand) or isinstance(run, TurnRun):
            continue
        one, other = runs.get(run.entry.repeats), run
        why = "that is no run of the case" if one is None else "that is itself" if one is other else _contradiction(one, other)
        if why or one is None:
            notes.append(f"{name} is said to repeat {run.entry.repeats}, but {why}; the two are not taken for repeats")
            runs[name] = replace(other, entry=other.entry.model_copy(update={"repeats": None}))
            continue
        count = min(len(one.log), len(other.log))
        if len(one.log) != len(other.log):
            notes.append(
                f"{name} and {one.name} are {len(other.log)} and {len(one.log)} samples long; the first {count} are used"
            )
            runs |= {r.name: replace(r, recording=_first(r.log, count)) for r in (one, other)}  # type: ignore[call-arg]
    return tuple(runs[run.name] for run in case.runs)


def _first(log: RunLog, count: int) -> RunLog:
    text = {name: values[:count] for name, values in log.text.items()}
    return replace(log, t_s=log.t_s[:count], columns={n: v[:count] for n, v in log.columns.items()}, text=text)


def _contradiction(one: Run, other: Run) -> str:
    """Why two runs are no repeats of each other; empty where they are."""
    if abs(len(one.log) - len(other.log)) > LENGTH * len(one.log):
        return f"they are {len(one.log)} and {len(other.log)} samples long"
    count = min(len(one.log), len(other.log))
    a, b = _first(one.log, count), _first(other.log, count)
    for name in a.columns:
        match = AXIS_COLUMN.match(name)
        if match and match[2] == "ref_mm" and name in b.columns:
            apart = float(np.nanmax(np.abs(a[name] - b[name])))
            if apart > 0.01 + 1e-3 * float(np.ptp(a[name])):
                return f"their {name} are up to {apart:.3g} mm apart"
    return next((why for name in _of_both(a, b) if (why := _differ(name, a, b))), "")


def _of_both(a: RunLog, b: RunLog) -> Iterable[str]:
    return (name for name in measured_signals(a) if b.has(name) and np.isfinite(a[name] - b[name]).any())


def _differ(name: str, a: RunLog, b: RunLog) -> str:
    """Return the difference of a signal of repeated runs, where that is more than what repeats."""
    match = AXIS_COLUMN.match(name)
    base = a.columns.get(f"{match[1]}_ref_mm") if match and match[2] != "torque_a" else None
    does = a[name] - (base if base is not None else np.nanmean(a[name]))
    size, apart = (float(np.sqrt(np.nanmean(v**2))) for v in (does, a[name] - b[name]))
    noise = float(np.nanmedian(np.abs(np.diff(a[name][np.isfinite(a[name])], 2)))) if np.isfinite(a[name]).sum() > 2 else 0.0
    if apart > CONTRADICTION * size and apart > 20.0 * noise and apart > 1e-3:
        return f"their {name} differ by {apart:.3g} rms, {100 * apart / max(size, 1e-12):.0f} % of what it does"
    return ""
