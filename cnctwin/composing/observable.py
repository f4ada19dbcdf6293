"""The effects that the runs of a case can show, and what the others lack, by what effects declare of themselves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cnctwin.composing.composed import ComposedRun, Observability
from twin.case import RunKind
from twin.effects.catalogue import catalogue
from twin.effects.effect import Effect, Excitation, On
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN, RunLog
from twin.sites import Site

FAST_S = 0.005
"""Sample period up to which the servo loops of an axis can be seen."""
SHORT_BLOCK_S = 1.0
AXIS_SITES = frozenset({Site.REFERENCE, Site.CONTROLLER, Site.DRIVE_FORCE, Site.FRICTION, Site.MECHANICS, Site.CLOCK})
HEAT = ("spindle_temp_c", "spindle_rpm", "spindle_load_pct", "ambient_temp_c")
ENGAGEMENT = ("axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "spindle_angle_rad")
RECORD = "record at the servo period (docs/how-to/recording.md)"


@dataclass(frozen=True, slots=True)
class Fitted:
    """The fitted runs of a case: their logs by kind, and the machine that they are compared with."""

    machine: MachineFile
    runs: Sequence[tuple[ComposedRun, RunLog]]

    def logs(self, *, program: bool) -> list[RunLog]:
        """Return the logs of runs that are programs with their text, or of all others."""
        return [log for run, log in self.runs if (run.kind is RunKind.PROGRAM) is program]

    def columns(self, *, program: bool = False) -> set[str]:
        """Return the columns that hold something in any of them."""
        return {name for log in self.logs(program=program) for name in log.columns if log.has(name)}


def observability(machine: MachineFile, runs: Sequence[tuple[ComposedRun, RunLog]]) -> tuple[Observability, ...]:
    """Return every effect of the catalogue, with what is missing for it in the fitted runs."""
    fitted = Fitted(machine, [(run, log) for run, log in runs if run.role == "fit" and not run.healthy])
    return tuple(_observability(effect, fitted) for effect in catalogue().values())


def _observability(effect: Effect, fitted: Fitted) -> Observability:
    if effect.on is On.SIGNAL:
        return _of_signals(effect, fitted)
    if effect.site is Site.PROGRAM:
        return Observability(effect.name, (), _of_programs(effect, fitted))
    if effect.on is On.AXIS or effect.site in AXIS_SITES:
        return _of_axes(effect, fitted)
    lacks = _of_machine(effect, fitted) or _unexcited(effect, fitted)
    return Observability(effect.name, (), lacks)


def _of_signals(effect: Effect, fitted: Fitted) -> Observability:
    """A sensor can be judged where the twin has a figure of its own for what it reads."""
    columns = fitted.columns()
    modelled = []
    if not _heat_missing(fitted):
        modelled.append("spindle_temp_c")
    if not _load_missing(fitted):
        modelled.append("spindle_load_pct")
    modelled += sorted(c for c in columns if (m := AXIS_COLUMN.match(c)) and m[2] != "ref_mm" and f"{m[1]}_ref_mm" in columns)
    modelled += sorted(columns & {"force_x_n", "force_y_n"})
    if effect.shows_only_fast:
        modelled = [m for m in modelled if m == "spindle_temp_c" or _is_fast(fitted, m)]
    lacks = "" if modelled else (_heat_missing(fitted) or _load_missing(fitted))
    return Observability(effect.name, tuple(modelled), lacks)


def _of_programs(effect: Effect, fitted: Fitted) -> str:
    logs = fitted.logs(program=True)
    if not logs:
        lengths = fitted.columns() & set(effect.shows_in)
        if effect.excited_by is Excitation.TOOL_CHANGES and "tool_change_active" in lengths:
            return _unexcited(effect, fitted)
        return "no program with its NC text (--programs DIR)"
    if not any(log.has(name) for log in logs for name in effect.shows_in):
        return f"no {' or '.join(effect.shows_in)} in any program"
    return _unexcited(effect, fitted)


def _of_axes(effect: Effect, fitted: Fitted) -> Observability:
    columns = fitted.columns()
    letters = [a for a in fitted.machine.axes if f"{a}_ref_mm" in columns]
    shown = [a for a in letters if any(name.replace("{a}", a) in columns for name in effect.shows_in)]
    if not letters:
        return Observability(effect.name, (), f"no reference and torque of an axis; {RECORD}")
    if not shown:
        wanted = ", ".join(dict.fromkeys(name.replace("{a}", letters[0]) for name in effect.shows_in))
        return Observability(effect.name, (), f"no {wanted} of any axis")
    if effect.shows_only_fast and not any(_is_fast(fitted, f"{a}_ref_mm") for a in shown):
        return Observability(effect.name, (), f"shows within milliseconds; {RECORD}")
    if effect.needs and (lacks := _needs(effect, fitted, shown)):
        return Observability(effect.name, (), lacks)
    return Observability(effect.name, tuple(shown) if effect.on is On.AXIS else (), "")


def _needs(effect: Effect, fitted: Fitted, letters: Sequence[str]) -> str:
    for name in effect.needs:
        stated = any(getattr(fitted.machine.axes[a], name, None) is not None for a in letters)
        if hasattr(next(iter(fitted.machine.axes.values())), name) and not stated:
            return f"the machine states no {name}"
        if name == "temperature_rise_k" and "spindle_temp_c" not in fitted.columns():
            return "no spindle_temp_c beside the axis"
    return ""


def _of_machine(effect: Effect, fitted: Fitted) -> str:
    columns = fitted.columns()
    if effect.site is Site.THERMAL:
        return _heat_missing(fitted)
    if effect.site is Site.PROCESS_FORCE:
        absent = [name for name in ENGAGEMENT if name not in columns]
        shown = [name for name in effect.shows_in if name in columns]
        if not shown:
            return f"no {', '.join(effect.shows_in[:2])} in any run"
        if absent:
            return f"no engagement of the tool ({', '.join(absent[:3])}) beside {shown[0]}"
        return f"shows within milliseconds; {RECORD}" if effect.shows_only_fast and not _is_fast(fitted, shown[0]) else ""
    lacks = _load_missing(fitted)
    if not lacks and effect.shows_only_fast and not _is_fast(fitted, "spindle_load_pct"):
        return f"shows within milliseconds; {RECORD}"
    return lacks


def _heat_missing(fitted: Fitted) -> str:
    absent = [name for name in HEAT if name not in fitted.columns()]
    if absent:
        return f"no {', '.join(absent)} in any run"
    if fitted.machine.thermal is None:
        return "no [thermal] in the machine's description"
    if not any(log.has(*HEAT) and np.nanmax(np.abs(log["spindle_rpm"])) > 0.0 for log in fitted.logs(program=False)):
        return "the spindle never turned"
    return ""


def _load_missing(fitted: Fitted) -> str:
    absent = [name for name in ("spindle_load_pct", "spindle_rpm") if name not in fitted.columns()]
    if absent:
        return f"no {', '.join(absent)} in any run"
    return "" if fitted.machine.spindle is not None else "no [spindle] in the machine's description"


def _is_fast(fitted: Fitted, column: str) -> bool:
    """Return True where a run with a column is recorded at the rate of the servo loops."""
    logs = (log for log in fitted.logs(program=False) if log.has(column) and len(log) > 1)
    return any(float(np.median(np.diff(log.t_s))) <= FAST_S for log in logs)


def _unexcited(effect: Effect, fitted: Fitted) -> str:
    """Return what the runs would have to contain for the effect to show."""
    if effect.excited_by is None:
        return ""
    happened, lacks = _EXCITED[effect.excited_by]
    logs = fitted.logs(program=effect.site is Site.PROGRAM) or fitted.logs(program=False)
    return "" if any(happened(log) for log in logs) else lacks


def _switched(log: RunLog, column: str) -> bool:
    values = log.columns.get(column, np.zeros(0))
    return len(np.unique(values[np.isfinite(values)])) > 1


def _short_blocks(log: RunLog) -> bool:
    line = log.columns.get("line", np.zeros(0))
    changes = log.t_s[1:][np.diff(line) != 0.0] if len(line) > 1 else np.zeros(0)
    return len(changes) > 1 and float(np.diff(changes).min()) < SHORT_BLOCK_S


_EXCITED: Mapping[Excitation, tuple[Callable[[RunLog], bool], str]] = {
    Excitation.COOLANT_SWITCHED: (lambda log: _switched(log, "coolant_on"), "the coolant was never switched"),
    Excitation.TOOL_CHANGES: (
        lambda log: _switched(log, "tool_change_active") or _switched(log, "tool_number"),
        "no tool was changed",
    ),
    Excitation.SHORT_BLOCKS: (_short_blocks, f"no block is shorter than {SHORT_BLOCK_S:g} s"),
}
