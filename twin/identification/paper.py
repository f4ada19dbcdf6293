"""The identifications of the reference paper, by its genetic algorithm and by least squares on the same data, for comparison.

* friction, for each direction: J_f = Σ (F − F^)² over the points of the friction curve, or its root mean square
* controller: J_c = w_e RMS(e − e^) + w_A RMS(A − A^) over all samples of all runs; genes S_pp, S_vp, S_vi
* cutting: J_cf = RMS(F_cf − F^_cf) of the resultant force; genes K_t, K_e

The paper states [max evolutions / fitness limit]: friction 500/100, controller 100/10, cutting 500/1. It states neither
population, rates, w_e, w_A and bounds nor the units of the limits. Assumed here: the defaults of `GeneticSettings`; w_e = 1 /µm,
w_A = 1 /A; bounds as below; the friction limit as 100 N², since 100 N rms would let nearly any curve pass. A search that
ends at its limit, as the paper's do, is shown once more with all its evolutions.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import savgol_filter

from twin.case import Case, RunKind
from twin.genetic import Evolved, GeneticSettings, Objective, evolve
from twin.identification.axis_fit import AxisModel, AxisRecording, fit_axis
from twin.identification.axis_parameters import GAINS, AxisParameter
from twin.identification.friction_points import FrictionCurve, FrictionPoint, fit_friction_curve, friction_points
from twin.machine import Axis, Friction, Tool
from twin.process.milling import Milling, milling_force, tool_constants
from twin.simulator.recorded import told_of
from twin.simulator.response import milling_of

Floats = NDArray[np.float64]
Clock = Callable[[], float]

FRICTION_EVOLUTIONS, FRICTION_LIMIT = 500, 100.0
CONTROLLER_EVOLUTIONS, CONTROLLER_LIMIT = 100, 10.0
CUTTING_EVOLUTIONS, CUTTING_LIMIT = 500, 1.0
ERROR_WEIGHT_PER_MM = 1000.0
TORQUE_WEIGHT_PER_A = 1.0
SCALE_BOUNDS = (0.3, 3.0)
SCALE_MIN = 1e-3
SLOPE_SAMPLES = 11
TANGENTIAL_BOUNDS = (0.25, 4.0)
"""Bounds of K_t, as factors on the figure that the machine states."""
RADIAL_BOUNDS = (0.0, 1.5)
VALLEY = 1e-3
"""Part by which J_cf has to grow, K_e off by 0.2, if the resultant is to tell K_t from K_e."""
LEAST_SQUARES = "least squares"
GENETIC = "genetic algorithm"
GENETIC_ALL = "genetic algorithm, all evolutions"


class FrictionObjective(Enum):
    """The figure that the friction limit of 100 is a limit of."""

    SQUARES = "N²"
    RMS = "N"


@dataclass(frozen=True, slots=True)
class PaperRow:
    """One identification by one method.

    what: `friction x -`, `controller x`, `cutting`; objective in `unit`; evaluations: of candidates, each over all data
    limit: the fitness limit, None where the method has none; seconds: by the caller's clock, NaN without one
    values: name → figure, with the unit in the name
    """

    what: str
    method: str
    objective: float
    unit: str
    evaluations: int
    seconds: float
    values: Mapping[str, float]
    limit: float | None = None


@dataclass(frozen=True, slots=True)
class PaperIdentification:
    """Rows in the paper's order; notes: what the recordings of this case do not allow, and why."""

    rows: tuple[PaperRow, ...]
    notes: tuple[str, ...]


def identify_paper(
    case: Case,
    seed: int,
    clock: Clock = lambda: math.nan,
    friction_objective: FrictionObjective = FrictionObjective.SQUARES,
) -> PaperIdentification:
    """All three identifications on the runs for fitting of `case`.

    clock: seconds, for how long each search takes

    Raises RunLogError where a run cannot be read, or is sampled at another period than the servo loops tick with.
    """
    rows: list[PaperRow] = []
    notes: list[str] = []
    period_s = case.machine.machine.servo_period_s
    for letter, axis in case.machine.axes.items():
        recordings = _recordings(case, letter)
        if not recordings:
            notes.append(f"{letter}: no air run for fitting records reference, position and torque of it")
            continue
        points = tuple(point for recording in recordings for point in friction_points(recording, axis))
        curves = []
        for side, sign in (("-", -1.0), ("+", 1.0)):
            there = tuple(point for point in points if point.speed_mm_s * sign > 0.0)
            if len({round(abs(point.speed_mm_s), 3) for point in there}) < 2:
                notes.append(f"friction {letter} {side}: {len(there)} stretches of constant speed, all alike: no curve")
                break
            found, curve = _friction(f"friction {letter} {side}", there, friction_objective, seed, clock)
            rows += found
            curves.append(curve)
            speeds = len({round(math.log(abs(point.speed_mm_s)), 1) for point in there})
            slowest = min(abs(point.speed_mm_s) for point in there)
            if speeds < 4:
                notes.append(f"friction {letter} {side}: {speeds} different speeds do not determine a curve of four constants")
            elif curve.stribeck_velocity_mm_s < 1.01 * slowest:
                notes.append(
                    f"friction {letter} {side}: still falling at {slowest:.3g} mm/s, the slowest speed; static_n is extrapolated"
                )
        if len(curves) == 2:
            known = axis.model_copy(update={"friction": _friction_of(curves[0], curves[1])})
            rows += _controller(letter, known, recordings, period_s, seed, clock)
    cuts = _cuts(case)
    if cuts and case.machine.tool is not None:
        found, told_apart = _cutting(case.machine.tool, cuts, period_s, seed, clock)
        rows += found
        if not told_apart:
            notes.append("cutting: the resultant force alone does not tell K_t from K_e here; its two components do")
    else:
        notes.append("cutting: no cut for fitting records its forces, its depth and its angles")
    return PaperIdentification(tuple(rows), tuple(notes))


def _recordings(case: Case, letter: str) -> tuple[AxisRecording, ...]:
    """The axis in the air runs for fitting; deviations count in the units of J_c."""
    found = []
    for run in case.of(RunKind.AIR, "fit"):
        log = run.log
        columns = [f"{letter}_{name}" for name in ("ref_mm", "pos_mm", "torque_a")]
        if log.has(*columns):
            told_of(log, case.machine)  # raises where the period is another one
            sigma = np.outer([1.0 / ERROR_WEIGHT_PER_MM, 1.0 / TORQUE_WEIGHT_PER_A], np.ones(len(log)))
            reference, position, torque = (log[column] for column in columns)
            found.append(AxisRecording(log.t_s, reference, position, torque, None, sigma))
    return tuple(found)


def _searched(
    objective: Objective, low: Floats, high: Floats, settings: tuple[int, float], seed: int, clock: Clock
) -> list[tuple[str, Evolved, float]]:
    """The search as the paper ends it, and all its evolutions where that was before: name, result and seconds of each."""
    found: list[tuple[str, Evolved, float]] = []
    for name, limit in ((GENETIC, settings[1]), (GENETIC_ALL, -math.inf)):
        if not found or len(found[0][1].history) <= settings[0]:
            begin = clock()
            evolved = evolve(objective, low, high, GeneticSettings(settings[0], limit), seed)
            found.append((name, evolved, clock() - begin))
    return found


def _friction(
    what: str, points: tuple[FrictionPoint, ...], kind: FrictionObjective, seed: int, clock: Clock
) -> tuple[list[PaperRow], FrictionCurve]:
    """Rows of one direction, and the curve by least squares."""
    speed = np.array([abs(point.speed_mm_s) for point in points])
    force = np.array([abs(point.force_n) for point in points])

    def objective(genes: Floats) -> Floats:
        coulomb, static, stribeck, viscous = genes.T[:, :, None]
        curve = coulomb + (static - coulomb) * np.exp(-((speed / stribeck) ** 2)) + viscous * speed
        squares = np.where(static[:, 0] >= coulomb[:, 0], ((curve - force) ** 2).sum(axis=1), np.nan)
        return squares if kind is FrictionObjective.SQUARES else np.sqrt(squares / len(speed))

    begin = clock()
    curve, evaluations = fit_friction_curve(speed, force)
    seconds = clock() - begin
    names = ("coulomb_n", "static_n", "stribeck_velocity_mm_s", "viscous_n_s_per_mm")
    best = np.array([getattr(curve, name) for name in names])
    by_squares = float(objective(best[None, :])[0])
    rows = [
        PaperRow(what, LEAST_SQUARES, by_squares, kind.value, evaluations, seconds, dict(zip(names, best.tolist(), strict=True)))
    ]
    low = np.array([0.0, 0.0, speed.min(), 0.0])
    high = np.array([force.max(), 2.0 * force.max(), speed.max(), force.max() / speed.max()])
    for name, found, taken in _searched(objective, low, high, (FRICTION_EVOLUTIONS, FRICTION_LIMIT), seed, clock):
        values = dict(zip(names, found.genes.tolist(), strict=True))
        rows.append(PaperRow(what, name, found.objective, kind.value, found.evaluations, taken, values, FRICTION_LIMIT))
    return rows, curve


def _friction_of(minus: FrictionCurve, plus: FrictionCurve) -> Friction:
    return Friction(
        coulomb_n=(minus.coulomb_n, plus.coulomb_n),
        static_n=(minus.static_n, plus.static_n),
        stribeck_velocity_mm_s=(minus.stribeck_velocity_mm_s, plus.stribeck_velocity_mm_s),
        viscous_n_s_per_mm=(minus.viscous_n_s_per_mm, plus.viscous_n_s_per_mm),
    )


def _controller(
    letter: str, axis: Axis, recordings: tuple[AxisRecording, ...], period_s: float, seed: int, clock: Clock
) -> list[PaperRow]:
    """Rows of an axis whose friction is known: S_pp, S_vp, S_vi, and S_vi only where there is an integral."""
    gains = [name for name in GAINS if getattr(axis, name) > 0.0]
    model = AxisModel(axis, tuple(AxisParameter(name, "", True, 10.0) for name in gains), recordings, period_s)

    def objective(genes: Floats) -> Floats:
        squares = np.zeros((2, len(genes)))
        for recording, run in zip(recordings, model.simulate(np.log(genes)), strict=True):
            measured = recording.position_mm, recording.torque_a
            for row, (name, values) in enumerate(zip(("position_mm", "torque_a"), measured, strict=True)):
                squares[row] += np.nansum((run.outputs[name] - values) ** 2, axis=1)
        rms = np.sqrt(squares / sum(len(recording.t_s) for recording in recordings))
        return np.asarray(ERROR_WEIGHT_PER_MM * rms[0] + TORQUE_WEIGHT_PER_A * rms[1])

    def row(method: str, genes: Floats, evaluations: int, seconds: float, limit: float | None = None) -> PaperRow:
        values = {GAINS[name]: float(value) for name, value in zip(gains, genes, strict=True)}
        reached = float(objective(genes[None, :])[0])
        return PaperRow(f"controller {letter}", method, reached, "µm + A", evaluations, seconds, values, limit)

    begin = clock()
    linear, tried = _controller_law(axis, recordings, period_s)
    rows = [row(f"{LEAST_SQUARES} on the control law", linear, tried, clock() - begin)]
    begin = clock()
    closed = fit_axis(model)
    rows.append(row(f"{LEAST_SQUARES} on the closed loop", np.exp(closed.theta), closed.found.evaluations, clock() - begin))
    low, high = (np.full(len(gains), bound) for bound in SCALE_BOUNDS)
    for name, found, taken in _searched(objective, low, high, (CONTROLLER_EVOLUTIONS, CONTROLLER_LIMIT), seed, clock):
        rows.append(row(name, found.genes, found.evaluations, taken, CONTROLLER_LIMIT))
    return rows


def _controller_law(axis: Axis, recordings: tuple[AxisRecording, ...], period_s: float) -> tuple[Floats, int]:
    """S_pp, S_vp, S_vi from A = S_vp K_v (S_pp K_p e − v) + S_vi K_i Σ (S_pp K_p e − v) T + what the integral began with.

    The recorded motion and torque are related; nothing is simulated. The factors of e, v and of their sums are linear; S_pp is a
    ratio of two of them, and with it the rest is solved again. v is the slope of a parabola through positions around a sample.
    """
    integral_gain = axis.velocity_integral_gain_a_per_mm
    parts = []
    for i, r in enumerate(recordings):
        error = axis.position_gain_per_s * (r.reference_mm - r.position_mm)
        speed = savgol_filter(r.position_mm, SLOPE_SAMPLES, 2, deriv=1, delta=period_s)
        both = axis.velocity_gain_a_s_per_mm * np.stack([error, -speed])
        sums = integral_gain * period_s * np.cumsum(np.stack([error, -speed]), axis=1)
        begin = np.repeat(np.eye(len(recordings))[i][:, None], len(error), axis=1)
        parts.append(np.concatenate([both, *([sums] if integral_gain > 0.0 else []), begin]))
    rows = np.concatenate(parts, axis=1)
    torque = np.concatenate([r.torque_a for r in recordings])
    free = np.linalg.lstsq(rows.T, torque)[0]
    first = 2 if integral_gain > 0.0 else 0
    position_scale = free[first] / free[first + 1]
    count = len(rows) - len(recordings)
    tied = np.concatenate([position_scale * rows[0:count:2] + rows[1:count:2], rows[count:]])
    scales = np.linalg.lstsq(tied.T, torque)[0][: count // 2]
    return np.maximum([position_scale, *scales], SCALE_MIN), 2


def _cuts(case: Case) -> list[tuple[Milling, Floats, Floats]]:
    """Motion and recorded forces of the cuts for fitting."""
    cuts = []
    for run in case.of(RunKind.CUT, "fit"):
        if run.log.has("force_x_n", "force_y_n"):
            milling = milling_of(told_of(run.log, case.machine))
            if milling is not None:
                cuts.append((milling, run.log["force_x_n"], run.log["force_y_n"]))
    return cuts


def _cutting(
    tool: Tool, cuts: list[tuple[Milling, Floats, Floats]], period_s: float, seed: int, clock: Clock
) -> tuple[list[PaperRow], bool]:
    """Rows of K_t and K_e, and whether J_cf tells them apart.

    The force is linear in K_t and K_t K_e, so the cut itself is simulated once for all candidates. Where one tooth cuts at a
    time, or so many that their sum only turns, the resultant is K_t √(1 + K_e²) times something: a valley without a bottom.
    """
    tangential, radial, measured = [], [], []
    for milling, force_x, force_y in cuts:
        unit: dict[str, ArrayLike] = {
            **tool_constants(tool),
            "tangential_coefficient_n_per_mm2": 1.0,
            "radial_ratio": np.array([0.0, 1.0]),
        }
        force = milling_force(unit, tool.teeth, milling, period_s=period_s)
        both = np.stack([force.force_x_n, force.force_y_n], axis=1)
        here = np.isfinite(force_x) & np.isfinite(force_y) & (both[0] != 0.0).any(axis=0)
        tangential.append(both[0][:, here])
        radial.append((both[1] - both[0])[:, here])
        measured.append(np.stack([force_x, force_y])[:, here])
    first, second, force_n = (np.concatenate(parts, axis=1) for parts in (tangential, radial, measured))
    resultant = np.hypot(*force_n)
    # |K_t (f₁ + K_e f₂)|² = K_t² (f₁² + 2 K_e f₁f₂ + K_e² f₂²)
    squares = (first**2).sum(axis=0), 2.0 * (first * second).sum(axis=0), (second**2).sum(axis=0)

    def objective(genes: Floats) -> Floats:
        scale, ratio = genes.T[:, :, None]
        modelled = scale * np.sqrt(np.maximum(squares[0] + ratio * squares[1] + ratio * ratio * squares[2], 0.0))
        return np.asarray(np.sqrt(((modelled - resultant) ** 2).mean(axis=1)))

    def row(method: str, genes: Floats, evaluations: int, seconds: float, limit: float | None = None) -> PaperRow:
        values = {"tangential_coefficient_n_per_mm2": float(genes[0]), "radial_ratio": float(genes[1])}
        return PaperRow("cutting", method, float(objective(genes[None, :])[0]), "N", evaluations, seconds, values, limit)

    begin = clock()
    linear, *_ = np.linalg.lstsq(np.stack([first.ravel(), second.ravel()], axis=1), force_n.ravel())
    rows = [row(LEAST_SQUARES, np.array([linear[0], linear[1] / linear[0]]), 1, clock() - begin)]
    stated = tool.tangential_coefficient_n_per_mm2
    low = np.array([TANGENTIAL_BOUNDS[0] * stated, RADIAL_BOUNDS[0]])
    high = np.array([TANGENTIAL_BOUNDS[1] * stated, RADIAL_BOUNDS[1]])
    for name, found, taken in _searched(objective, low, high, (CUTTING_EVOLUTIONS, CUTTING_LIMIT), seed, clock):
        rows.append(row(name, found.genes, found.evaluations, taken, CUTTING_LIMIT))
    ratio = linear[1] / linear[0] + np.array([0.0, 0.2])
    along_valley = np.stack([linear[0] * np.sqrt((1.0 + ratio[0] ** 2) / (1.0 + ratio**2)), ratio], axis=1)
    here, there = objective(along_valley)
    return rows, bool(there > here * (1.0 + VALLEY))
