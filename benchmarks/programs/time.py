#!/usr/bin/env python3
"""Measure how well a model of the control predicts what ten recorded parts took, from length over feed upwards.

    .venv/bin/python benchmarks/programs/time.py [--json]

Recordings: the plates of the NIST Smart Manufacturing Systems Test Bed (CNCTWIN_DATA or ../shared/data). Each model is fitted to
plates 13, 14 and 15 and judged on the others, which have other feeds and other spindle speeds and were not looked at by the fit.
A run is judged on its active time (without the pauses that the recording shows); a tool section reaches from one M6 to the next.

* length over feed: the rapids at the rate that the recordings show
* + tool change: a constant for each
* + acceleration, corners: of the axes in cutting feed and in rapid, and the permissible speed difference
* + overrides: as the recordings show them, replayed
* + places, spindle: where the reference and the tool change are; a spindle that takes time to run up and to stop
* + in position: a wait at every halt
* + centripetal: arcs have a limit of their own
* with constant torque: the model with a spindle that runs up evenly, in place of one of constant power above its base speed,
  which is read off the run-ups in the recordings of another part on the same machine (cover)
* and jerk, block time, contour tolerance: what else a control has, each on top of the model: they gain nothing
"""

import argparse
import json
import math
import statistics
from time import perf_counter

import numpy as np

from benchmarks.programs.plates import FITTED, cover_ramp, data_folder, plates
from benchmarks.programs.time_fit import PARAMETERS, Comparison, ProgramTimes, compare, ideal_limits, identify_program_times
from twin.recording.program_run import OVERRIDES, ProgramRun
from twin.recording.recorded_program import RecordedProgram

LENGTH = ()
CHANGE = (*LENGTH, "tool_change_s")
CORNERS = (*CHANGE, "acceleration_mm_s2", "rapid_acceleration_mm_s2", "corner_speed_difference_mm_min")
PLACES = (
    *CORNERS,
    "spindle_acceleration_rpm_s",
    "spindle_deceleration_rpm_s",
    "reference_z",
    "tool_change_x",
    "tool_change_y",
)
CONSTANT_TORQUE = "  with constant torque"
MODELS: tuple[tuple[str, tuple[str, ...], bool], ...] = (
    ("length over feed", LENGTH, False),
    ("+ tool change", CHANGE, False),
    ("+ acceleration, corners", CORNERS, False),
    ("+ overrides", CORNERS, True),
    ("+ places, spindle", PLACES, True),
    ("+ in position", (*PLACES, "in_position_s"), True),
    ("+ centripetal (the model)", PARAMETERS, True),
    (CONSTANT_TORQUE, PARAMETERS, True),
    ("  and jerk", (*PARAMETERS, "jerk_mm_s3", "rapid_jerk_mm_s3"), True),
    ("  and block time", (*PARAMETERS, "block_time_s"), True),
    ("  and contour tolerance", (*PARAMETERS, "corner_deviation_mm"), True),
)


def is_fitted(program: RecordedProgram) -> bool:
    """Return True for a run that the models are fitted to."""
    return program.name in {f"plate {name}" for name in FITTED}


def errors(compared: list[Comparison]) -> tuple[float, float, float]:
    """Mean and mean absolute error of the totals in %, and mean absolute error of the tool sections in s."""
    return (
        100.0 * statistics.mean(c.relative_error for c in compared),
        100.0 * statistics.mean(abs(c.relative_error) for c in compared),
        statistics.mean(abs(s.predicted_s - s.recorded_s) for c in compared for s in c.sections),
    )


def fitted(programs: list[RecordedProgram], parameters: tuple[str, ...], overrides: bool, base_rpm: float) -> ProgramTimes:
    """A model of these parameters, fitted; what it does not have is ideal."""
    limits = ideal_limits(programs)
    if "spindle_acceleration_rpm_s" in parameters:
        limits = limits.with_(rapid_waits_for_spindle=True, spindle_base_rpm=base_rpm)
    return identify_program_times(programs, parameters, limits, overrides)


def overrides_moved(run: ProgramRun) -> tuple[str, ...]:
    """Return the overrides that were turned during the run."""
    moved = []
    for name in OVERRIDES.values():
        values = np.asarray(run.columns[name], dtype=np.float64)
        known = values[~np.isnan(values)]
        if len(known) and np.ptp(known) > 0.0:
            moved.append(name.removesuffix("_override_pct"))
    return tuple(moved)


def runs_table(programs: list[RecordedProgram]) -> None:
    """Print what the recordings themselves say of each run."""
    print(f"{'run':12} {'lasted s':>9} {'active s':>9} {'pauses':>6}  overrides moved; judged?")
    for program in programs:
        run = program.run
        moved = ", ".join(overrides_moved(run)) or "none"
        why = program.refusal()
        judged = f"no: {why}" if why else "yes"
        print(f"{program.name:12} {run.duration_s:9.1f} {run.active_s:9.1f} {len(run.pauses):6d}  {moved}; {judged}")


def sections_table(model: ProgramTimes, programs: list[RecordedProgram]) -> None:
    """Print every run and section of the model."""
    for program in programs:
        c = compare(program, model.plan(program))
        parts = "  ".join(f"T{s.tool} {s.predicted_s - s.recorded_s:+.1f}" for s in c.sections)
        print(
            f"{c.name:9} recorded {c.recorded_s:7.1f} predicted {c.predicted_s:7.1f} s {100 * c.relative_error:+5.2f} %   {parts}"
        )


def main() -> None:
    """Print the tables, or the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    every, ramp = plates(data_folder()), cover_ramp(data_folder())
    judged = [program for program in every if not program.refusal()]
    learned, held = [p for p in judged if is_fitted(p)], [p for p in judged if not is_fitted(p)]
    if not arguments.json:
        runs_table(every)
        three = f"{'bias %':>8} {'mean |%|':>9} {'section s':>10}"
        print(f"\n{'':28} {'fitted':>28}   {'held out':>28}\n{'model':28} {three}   {three}")
    figures, best = {}, None
    for name, parameters, overrides in MODELS:
        begun = perf_counter()
        model = fitted(learned, parameters, overrides, math.inf if name == CONSTANT_TORQUE else ramp.base_rpm)
        seconds = perf_counter() - begun
        inside, outside = (errors([compare(p, model.plan(p, overrides)) for p in group]) for group in (learned, held))
        figures[name.strip()] = {"fitted": inside, "held_out": outside, "seconds": seconds}
        best = model if best is None and parameters == PARAMETERS else best
        if not arguments.json:
            cells = "  ".join(f"{group[0]:+8.2f} {group[1]:9.2f} {group[2]:10.2f} " for group in (inside, outside))
            print(f"{name:28} {cells}  ({seconds:.1f} s)")
    assert best is not None
    if arguments.json:
        print(json.dumps(figures, indent=1))
        return
    print(f"\nthe model: residual {best.residual_s:.2f} s rms over {best.windows} windows")
    print(f"  {'rapid_mm_min':32} {best.limits.rapid_mm_min:9.0f}  read off the recorded speeds")
    print(f"  {'spindle_base_rpm':32} {ramp.base_rpm:9.0f}  ± {ramp.base_deviation_rpm:.0f} from run-ups in the cover recordings")
    for e in best.estimates:
        note = "" if e.identifiable else "  not determined by these runs"
        print(f"  {e.path:32} {e.value:9.3f}  [{e.low:.3f}, {e.high:.3f}]{note}")
    print()
    sections_table(best, learned + held)


if __name__ == "__main__":
    main()
