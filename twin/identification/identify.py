"""Identifies a machine from the runs of a case: cutting first, then the axes that the cut pushes, the spindle, the heat.

The order is that of the sites: the cutting force is an input of the axes, its power one of the spindle, the spindle's load one of
the heat; none needs anything of those after it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from twin.assumed import narrowed_in_words, with_fitted
from twin.case import Case, Run, RunKind
from twin.effects.added import added_effects
from twin.errors import CaseError
from twin.gap.free_run import GapRow, free_run_gap
from twin.gap.stages.air import air_runs
from twin.gap.stages.observed_through import standing_sensors
from twin.heat.run import Warming
from twin.identification.axes import identified_axes
from twin.identification.batch_fit import Fit
from twin.identification.cutting_fit import fit_cutting, fit_spindle, force_of, with_cutting, with_spindle
from twin.identification.estimate import INTERVAL_Z, KNOWN_MIN, Estimate
from twin.identification.idle_fit import fit_idle
from twin.identification.thermal_fit import NAMES, WarmingRun, fit_thermal, with_thermal
from twin.machine import MachineFile, SpindleDrive
from twin.rotary import outside_names, outside_text
from twin.simulator.recorded import noise_of, told_of
from twin.simulator.response import milling_of
from twin.spindle.load import spindle_quantities

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """The result of an identification.

    machine: with the identified constants and their uncertainty; estimates: of each constant that was fitted
    misfits: signals that the machine does not follow even so, a sentence each
    unknown: what these recordings cannot determine, a sentence each; notes: what was found on the way
    gaps: of the machine on the runs to be judged on, or on all where there are none
    """

    machine: MachineFile
    estimates: tuple[Estimate, ...]
    unknown: tuple[str, ...]
    notes: tuple[str, ...]
    gaps: tuple[GapRow, ...]
    misfits: tuple[str, ...]


MISFIT_PART = 0.4
"""A twin that misses this part of what a signal does is none: the signal has another sign or unit, or the machine is another."""


def identify(case: Case, *, free_gains: bool = False, progress: Progress = lambda _: None) -> Identification:
    """Fits the machine of a case to its runs of role `fit` and judges it on those of role `check`.

    free_gains: fit the loop gains too, as the factors S_pp, S_vp, S_vi; else they are taken to be exactly as stated

    Raises CaseError where there is no run to fit; RunLogError where a run cannot be used.
    """
    fits = tuple(run for run in case.of(role="fit") if run.entry.kind is not RunKind.PROGRAM)
    if not fits:
        raise CaseError(
            f"{case.name}: no run of role fit records axes, forces, loads or temperatures; there is nothing to identify"
        )
    known: list[Estimate] = []
    unknown: list[str] = []
    notes: list[str] = []
    machine = case.machine
    progress("cutting")
    machine = _cutting(machine, fits, known, unknown)
    progress("axes")
    machine = identified_axes(machine, fits, case.repeats(), free_gains, known, unknown, notes, progress)
    progress("spindle")
    machine = _spindle(machine, fits, known, unknown)
    progress("heat")
    machine = _heat(machine, fits, known, unknown)
    told = {e.path: _relative(e) for e in known if e.identifiable and not e.path.endswith(("_asymmetry", "_delay"))}
    machine = with_fitted(machine.model_copy(update={"uncertainty": {**machine.uncertainty, **told}}), told)
    notes += narrowed_in_words(case.machine, machine)
    progress("checking")
    judged = case.of(role="check") or fits
    gaps = free_run_gap(machine, judged, case.repeats())
    found = Identification(machine, tuple(known), tuple(unknown), tuple(notes), gaps, _misfits(judged, gaps))
    return in_own_units(found) if machine.rotary else found


def in_own_units(found: Identification) -> Identification:
    """Return what was identified with the rotary axes of the machine in degrees and N m (`twin.rotary`)."""
    rotary = found.machine.rotary
    others = found.machine.axes.keys() - rotary.keys()
    unknown, notes, misfits = (
        tuple(outside_text(text, rotary, others) for text in part) for part in (found.unknown, found.notes, found.misfits)
    )
    estimates = tuple(estimate.in_own_units(rotary) for estimate in found.estimates)
    gaps = tuple(replace(row, signal=outside_names(row.signal, rotary)) for row in found.gaps)
    return Identification(found.machine, estimates, unknown, notes, gaps, misfits)


def _misfits(runs: tuple[Run, ...], gaps: tuple[GapRow, ...]) -> tuple[str, ...]:
    """Return the misfits of the twin. A position is measured by its following error, anything else by itself."""
    said = []
    for run in runs:
        for signal in dict.fromkeys(row.signal for row in gaps if row.run == run.name):
            rows = [row for row in gaps if row.run == run.name and row.signal == signal]
            samples = sum(row.samples for row in rows)
            gap = float(np.sqrt(sum(row.gap**2 * row.samples for row in rows) / samples))
            values = run.log[signal]
            reference = run.log.columns.get(f"{signal.partition('_')[0]}_ref_mm") if signal.endswith("_mm") else None
            does = values - np.nanmean(values) if reference is None else values - reference
            size = float(np.sqrt(np.nanmean(does**2)))
            if gap > MISFIT_PART * size and gap > 10.0 * max(row.expected for row in rows):
                said.append(
                    f"{run.name}: {signal} is missed by {gap:.3g} rms, {100 * gap / max(size, 1e-12):.0f} % of what it does; "
                    "look at its sign and unit, and whether this is the machine that machine.toml describes; or an effect is "
                    "missing from the twin: cnctwin gap diagnose CASE"
                )
    return tuple(said)


def _relative(estimate: Estimate) -> float:
    return float(f"{(estimate.high - estimate.low) / 2.0 / INTERVAL_Z / abs(estimate.value):.3g}")


def stated_uncertainty(machine: MachineFile, path: str) -> float:
    """One standard deviation, relative, of a constant by its path."""
    return machine.uncertainty.get(path, machine.uncertainty.get("relative", 0.05))


def estimate(path: str, value: float, deviation: float, unit: str, stated: float | None, known_by: float) -> Estimate:
    """An estimate from a standard deviation."""
    value, deviation, known_by = float(value), float(deviation), float(known_by)
    return Estimate(path, value, value - INTERVAL_Z * deviation, value + INTERVAL_Z * deviation, unit, stated, known_by)


def _cutting(machine: MachineFile, runs: tuple[Run, ...], known: list[Estimate], unknown: list[str]) -> MachineFile:
    """K_t and K_e from a dynamometer."""
    tool = machine.tool
    cuts = []
    for run in runs:
        milling = milling_of(told_of(run.log, machine)) if tool and run.log.has("force_x_n", "force_y_n") else None
        if milling is not None:
            cuts.append((milling, run.log.t_s, run.log["force_x_n"], run.log["force_y_n"]))
            noise = noise_of(machine, run.log, "force_x_n")
    if tool is None or not cuts:
        if tool is not None:
            unknown.append(
                "tool: K_t and K_e: no run cuts on a dynamometer (force_x_n, force_y_n with depth and angles of the cut)"
            )
        return machine
    relative = stated_uncertainty(machine, "tool.tangential_coefficient_n_per_mm2")
    found = fit_cutting(tool, cuts, machine.machine.servo_period_s, noise, relative)
    fitted = with_cutting(tool, found)
    tangential = fitted.tangential_coefficient_n_per_mm2
    deviation = np.sqrt(np.diag(found.covariance))
    # of a quotient b/a, to first order
    gradient = np.array([-found.theta[1] / found.theta[0] ** 2, 1.0 / found.theta[0]])
    of_ratio = float(np.sqrt(gradient @ found.covariance @ gradient))
    path = "tool.tangential_coefficient_n_per_mm2"
    known.append(estimate(path, tangential, deviation[0], "N/mm²", tool.tangential_coefficient_n_per_mm2, found.known[0]))
    known.append(estimate("tool.radial_ratio", fitted.radial_ratio, of_ratio, "", tool.radial_ratio, found.known[1]))
    unknown.append("tool: K_t and the axial depth are one product; the depth of the program is taken to be exact")
    return machine.model_copy(update={"tool": fitted})


def _spindle(machine: MachineFile, runs: tuple[Run, ...], known: list[Estimate], unknown: list[str]) -> MachineFile:
    """Efficiency and idle power from the load meter of runs that are sampled at the servo period."""
    spindle = machine.spindle
    series = []
    cutting = False
    for run in runs:
        if spindle is None or not run.log.axes() or not run.log.has("spindle_load_pct", "spindle_rpm"):
            continue
        force = force_of(machine, run.log)
        power = np.zeros(len(run.log)) if force is None else force.cutting_power_w()[0]
        cutting = cutting or force is not None
        series.append((run.log.t_s, power, np.nan_to_num(run.log["spindle_rpm"]), run.log["spindle_load_pct"]))
        noise = noise_of(machine, run.log, "spindle_load_pct")
    if spindle is None:
        return machine
    if not series:
        return _idle(machine, spindle, runs, known, unknown)
    force_known = any(e.path.startswith("tool.") and e.identifiable for e in known)
    relative = stated_uncertainty(machine, "spindle.efficiency")
    found = fit_spindle(spindle, series, machine.machine.servo_period_s, noise, relative, not (force_known and cutting))
    fitted = with_spindle(spindle, found)
    deviation = np.sqrt(np.diag(found.covariance))
    if force_known and cutting:
        of_efficiency = float(deviation[0] * fitted.efficiency**2)
        known.append(estimate("spindle.efficiency", fitted.efficiency, of_efficiency, "", spindle.efficiency, found.known[0]))
    else:
        unknown.append("spindle.efficiency: without a measured cutting force, it is one product with K_t")
    known.append(
        estimate("spindle.idle_power_kw", fitted.idle_power_kw, deviation[1], "kW", spindle.idle_power_kw, found.known[1])
    )
    unknown.append("spindle.rated_power_kw: load, efficiency and idle power know it up to one factor; it stays as stated")
    return machine.model_copy(update={"spindle": fitted})


def _idle(
    machine: MachineFile, spindle: SpindleDrive, runs: tuple[Run, ...], known: list[Estimate], unknown: list[str]
) -> MachineFile:
    """Idle power from the load in air, where no run is sampled at the servo period and no effect is on the load."""
    is_plain = not added_effects(machine, spindle_quantities()) and not standing_sensors(machine, "spindle_load_pct")
    found = fit_idle(spindle, air_runs(machine, runs)) if is_plain else None
    if found is None:
        unknown.append("spindle: efficiency and idle power: no run records spindle_load_pct and spindle_rpm in a cut or in air")
        return machine
    unknown.append("spindle.efficiency: without a measured cutting force, it is one product with K_t")
    unknown.append("spindle.rated_power_kw: load, efficiency and idle power know it up to one factor; it stays as stated")
    stated = spindle.idle_power_kw
    prior = stated_uncertainty(machine, "spindle.idle_power_kw") * stated
    known_by = 1.0 - min(1.0, (found.deviation_kw / prior) ** 2) if prior > 0.0 else 1.0
    if known_by <= KNOWN_MIN:
        known.append(estimate("spindle.idle_power_kw", stated, prior, "kW", stated, known_by))
        return machine
    known.append(estimate("spindle.idle_power_kw", found.power_kw, found.deviation_kw, "kW", stated, known_by))
    return machine.model_copy(update={"spindle": spindle.model_copy(update={"idle_power_kw": found.power_kw})})


def _heat(machine: MachineFile, runs: tuple[Run, ...], known: list[Estimate], unknown: list[str]) -> MachineFile:
    """α, β and R from warm-up runs; C stays."""
    thermal = machine.thermal
    warm = [run.log for run in runs if run.log.has("spindle_temp_c", "spindle_rpm", "ambient_temp_c", "spindle_load_pct")]
    if thermal is None or not warm:
        if thermal is not None:
            unknown.append("thermal: no run records spindle_temp_c with spindle_load_pct, spindle_rpm and ambient_temp_c")
        return machine
    recordings = []
    for log in warm:
        coolant = log.columns.get("coolant_on")
        told = Warming(log.t_s, log["spindle_load_pct"], log["spindle_rpm"], log["ambient_temp_c"], coolant)
        recordings.append(WarmingRun(log.t_s, told, log["spindle_temp_c"]))
    noise = noise_of(machine, warm[0], "spindle_temp_c")
    found = fit_thermal(thermal, recordings, noise, stated_uncertainty(machine, "thermal.resistance_k_per_w"))
    fitted = with_thermal(thermal, found)
    stated = thermal.model_dump()
    free = [name for name in NAMES if stated[name] > 0.0]
    units = {"alpha_w_per_pct_rpm2": "W/(% rpm²)", "beta_w_per_rpm": "W/rpm", "resistance_k_per_w": "K/W"}
    for i, name in enumerate(free):
        value = getattr(fitted, name)
        deviation = value * float(np.sqrt(found.covariance[i, i]))
        known.append(estimate(f"thermal.{name}", value, deviation, units[name], stated[name], found.known[i]))
    _say_thermal(found, free, unknown, fitted.resistance_k_per_w * fitted.capacity_j_per_k)
    return machine.model_copy(update={"thermal": fitted})


def _say_thermal(found: Fit, free: list[str], unknown: list[str], constant_s: float) -> None:
    """Add a note on what temperatures cannot tell."""
    unknown.append(
        "thermal: of the four constants, temperatures know three combinations (alpha/C, beta/C and R·C); capacity_j_per_k stays "
        "as stated, the other three hold with it"
    )
    unknown.extend(
        f"thermal.{name}: these runs do not say; a step of speed and a cool-down of {2.0 * constant_s / 60.0:.0f} min would"
        for i, name in enumerate(free)
        if found.known[i] <= KNOWN_MIN
    )
