"""Diagnoses for the report: what the search would say of a small machine whose plant has an effect that its twin has not."""

from dataclasses import replace
from functools import cache

import numpy as np

from tests.twin.axes import MACHINE, reference
from twin.gap.diagnosis import (
    Candidate,
    Cause,
    Cell,
    Diagnosed,
    Diagnosis,
    Effected,
    GapNumbers,
    Interval,
    NextExperiment,
    NotObservable,
    Pattern,
    SignalGap,
    Trace,
    Verdict,
    closure_of,
)
from twin.machine import AddedEffect, MachineFile
from twin.regimes import Regime, axis_regimes
from twin.simulator.response import RunInput, respond

NOISE = {"position_mm": 0.0003, "table_mm": 0.0003, "torque_a": 0.01}
SIGMA = {"pos_mm": 0.0003, "table_mm": 0.0003, "torque_a": 0.01}
UNIT = {"pos_mm": "mm", "table_mm": "mm", "torque_a": "A"}
GRAVITY = AddedEffect(effect="gravity", on="z", parameters={"force_n": 400.0})
LOOSE = AddedEffect(effect="gravity", on="z", parameters={"force_n": 388.0})
PROGRAM = "(slow and fast, both ways)\nG90 G94\nG1 Z-60. F1000\nG4 P10000\nG1 Z-20. F1000\nM30\n"


def with_effects(*effects: AddedEffect) -> MachineFile:
    return MACHINE.model_copy(update={"effects": effects, "noise": NOISE})


@cache
def traces(ticks: int = 6000, *, after: bool = True) -> tuple[Trace, ...]:
    """Three axes, three signals each: a plant that carries a load on Z beside twins that do not, or nearly do."""
    t_s, told = np.arange(ticks) * 0.001, reference(ticks)
    run = RunInput(t_s, dict(zip("xyz", told, strict=True)))
    plant = respond(with_effects(GRAVITY), run, seed=3).columns
    before = respond(with_effects(), run).columns
    closer = respond(with_effects(LOOSE), run).columns if after else before
    titles = tuple(regime.title for regime in Regime)
    return tuple(
        Trace(
            "runs/check.parquet", f"{a}_{column}", UNIT[column], t_s, plant[f"{a}_{column}"], before[f"{a}_{column}"],
            closer[f"{a}_{column}"], np.full(ticks, SIGMA[column]), axis_regimes(t_s, run.reference_mm[a]), titles, fitted=False,
        )
        for a in "xyz"
        for column in UNIT
    )  # fmt: skip


def gap_of(trace: Trace, *, after: bool = False) -> np.ndarray:
    return (trace.after if after else trace.before) - trace.measured


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def cells(of: tuple[Trace, ...], *, after: bool = False) -> tuple[Cell, ...]:
    """A cell for each signal in each regime that it has samples in."""
    found = []
    for trace in of:
        for number, regime in enumerate(trace.regimes):
            here = trace.regime == number
            if here.any():
                size = rms(gap_of(trace, after=after)[here] / trace.floor[here])
                found.append(
                    Cell(
                        trace.signal, regime, 0.1, size, size, 1e-6 if size > 1.3 else 0.4, size > 1.3,
                        f"10 % of the gap is in {trace.signal} at {regime}",
                    )
                )  # fmt: skip
    return tuple(sorted(found, key=lambda cell: -cell.rms))


def numbers(of: tuple[Trace, ...]) -> GapNumbers:
    over = [[rms(gap_of(t, after=late) / t.floor) for t in of] for late in (False, True)]
    before, after = (float(np.sqrt(np.mean(np.square(sizes)))) for sizes in over)
    by_signal = {t.signal: SignalGap(rms(gap_of(t)), rms(gap_of(t, after=True)), rms(t.floor), t.unit) for t in of}
    closed = closure_of(before, after, 1.0)
    return GapNumbers(1.02 * before, before, after, 1.0, closed, closed - 0.01, min(closed + 0.001, 1.0), by_signal)


def profile(signal: str, *, discovered: bool = True) -> Pattern:
    at = np.linspace(5.0, 115.0, 12)
    return Pattern(
        signal, "position", 0.31, 4.2, 1e-9, discovered, f"31 % of the gap in {signal} goes with the position",
        "mm", tuple(at.tolist()), tuple((0.002 * np.sin(at / 20.0)).tolist()),
    )  # fmt: skip


def explained() -> Diagnosed:
    """A load on Z, found."""
    of = traces()
    gap = numbers(of)
    cause = Cause(
        "gravity", "z", 0.98, {"force_n": Interval(388.0, 380.2, 396.1, "N")}, (Effected("direction_friction", "z"),), gap.closure
    )
    tried = [
        Candidate(effect, axis, 0.05, 0.4) for effect in ("payload", "servo_gain", "presliding", "backlash") for axis in "xyz"
    ]
    diagnosis = Diagnosis(
        verdict=Verdict.EXPLAINED,
        sentence="Z carries a load of 388 N that the twin does not know.",
        where=cells(of),
        where_after=cells(of, after=True),
        patterns=(profile("z_pos_mm"), replace(profile("z_torque_a"), over="rest against motion", at=(), mean=())),
        causes=(cause,),
        gap=gap,
        candidates=(Candidate("gravity", "z", gap.closure, 1e-4), Candidate("direction_friction", "z", 0.61, 0.002), *tried),
        not_observable=tuple(NotObservable(name, "no force_x_n in any run") for name in ("runout", "helix")),
        not_identifiable=("z: mass_kg and torque_constant_nm_per_a only as their ratio",),
        next_experiment=NextExperiment("separates gravity from direction friction", PROGRAM, 28.0, 14.2),
        notes=("the clocks agree to 0.1 ms",),
        seconds=21.3,
    )
    return Diagnosed(diagnosis, with_effects(LOOSE), of)


def partly() -> Diagnosed:
    """One axis without a scale, two causes, a remainder."""
    of = tuple(t for t in traces() if t.signal in ("z_pos_mm", "z_torque_a"))
    gap = replace(numbers(of), before=14.7, after=6.4, closure=0.81, closure_low=0.78, closure_high=0.84)
    causes = (
        Cause("presliding", "z", 0.7, {"stiffness_n_per_mm": Interval(2690.0, 1810.0, 3950.0, "N/mm")}, (), 0.17),
        Cause("direction_friction", "z", 0.9, {"asymmetry": Interval(-0.128, -0.141, -0.116)}, (Effected("gravity", "z"),), 0.64),
    )
    given = explained()
    diagnosis = replace(
        given.diagnosis,
        verdict=Verdict.PARTLY,
        sentence="Friction differs by direction; a remainder has no name.",
        where=cells(of),
        where_after=cells(of, after=True),
        causes=causes,
        gap=gap,
        candidates=given.diagnosis.candidates[:4],
        next_experiment=None,
    )
    return replace(given, traces=of, diagnosis=diagnosis)


def healthy() -> Diagnosed:
    """Nothing to name: every list that may be empty is."""
    of = traces(after=False)
    return Diagnosed(
        Diagnosis(
            Verdict.HEALTHY, "The twin is as close to the machine as the machine is to itself.", (), (), (), (),
            GapNumbers(1.02, 1.01, 1.01, 1.0, 0.0, 0.0, 0.0, {}), (), (), (), None, (), 9.0,
        ),
        with_effects(),
        of[:3],
    )  # fmt: skip


def unknown() -> Diagnosed:
    """A gap without a cause: the twin after is the twin before."""
    of = traces(after=False)
    given = explained()
    gap = replace(numbers(of), closure=0.0, closure_low=0.0, closure_high=0.0)
    return Diagnosed(
        replace(
            given.diagnosis, verdict=Verdict.UNKNOWN, sentence="There is a gap in Z, and nothing in the catalogue makes it.",
            where=cells(of), where_after=(), causes=(), gap=gap,
        ),
        with_effects(),
        of,
    )  # fmt: skip


def warming() -> Diagnosed:
    """Temperature only: one signal in one regime, a sample a second."""
    t_s = np.arange(0.0, 7920.0)
    measured = 22.0 + 9.0 * (1.0 - np.exp(-t_s / 2000.0)) + 0.08 * np.random.default_rng(4).standard_normal(len(t_s))
    true = 22.0 + 9.0 * (1.0 - np.exp(-t_s / 2000.0))
    trace = Trace(
        "runs/warmup.parquet", "spindle_temp_c", "°C", t_s, measured, true + 2.0 * t_s / 7920.0, true + 0.02,
        np.full(len(t_s), 0.08), np.zeros(len(t_s), dtype=np.int8), ("warm-up",), fitted=False,
    )  # fmt: skip
    given = explained()
    cause = Cause("second_thermal_mass", "", 0.9, {"capacity_j_per_k": Interval(30000.0, 21000.0, 44000.0, "J/K")}, (), 0.9)
    diagnosis = replace(
        given.diagnosis,
        sentence="Heat flows on into the column.",
        where=cells((trace,)),
        where_after=cells((trace,), after=True),
        causes=(cause,),
        gap=numbers((trace,)),
        patterns=(),
    )
    return replace(given, traces=(trace,), diagnosis=diagnosis)


DIAGNOSED = {"explained": explained, "partly": partly, "healthy": healthy, "unknown": unknown, "warming": warming}
