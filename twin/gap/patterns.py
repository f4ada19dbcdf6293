"""Patterns of the gap over position, phase of screw and spindle, time, program section and speed, and its contrasts.

Over bins: share = Σ_b n_b m_b² / Σ ρ², with m_b the mean of a bin, in floors, of what is left of the gap once the means of
stretches (position, phase) or of regimes (time) are taken out, so that a gap of one direction or speed is not taken for one of a
place. Over a phase θ: the best harmonic k of up to 24, share = n A² / 2 / Σ ρ² with A = 2 |mean ρ exp(−i k θ)|, by stretch
for the screw, since a loop answers later the faster it is driven, and by the heading of the path for the spindle; no harmonic is
looked at that the sampling cannot carry. Over speed: the parts that are odd, (m₊ − m₋) / 2, and even, (m₊ + m₋) / 2, in the
velocity. p is that of the largest departure, times the number of bins or harmonics that were looked at. What an axis shows at
rest is chance, one draw each time that it comes to rest, and is no part of time and section.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.contrasts import contrasts
from twin.gap.covariates import TAU, Covariates, covariates
from twin.gap.diagnosis import Pattern, Trace
from twin.gap.significance import MEAN_TOLERANCE, discoveries, means_of, p_of
from twin.gap.where import by_signal
from twin.gap.wording import digits, figure, percent, signal_words, times_floor
from twin.machine import MachineFile
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SHARE_MIN = 0.05
POSITION_BINS, TIME_BINS, PHASE_BINS, SPEED_BINS, SECTIONS_MAX = 12, 8, 36, 6, 40
HARMONICS = 24
DRIFT = "early against late"
AHEAD = 0.1
"""Bins of time, and sections even more, explain any gap that comes and goes: said only where so much ahead of what says why."""


@dataclass(frozen=True, slots=True, eq=False)
class _TestedPattern:
    """A pattern with its p, before it is known whether it stands. says: what goes into its sentence."""

    over: str
    share: float
    size: float
    p: float
    says: str
    at_unit: str = ""
    at: tuple[float, ...] = ()
    mean: tuple[float, ...] = ()


def patterns(
    traces: Sequence[Trace], logs: Mapping[str, RunLog], machine: MachineFile, *, after: bool = False
) -> tuple[Pattern, ...]:
    """Return the patterns of at least 5 % of their signal's gap that were discovered, largest share first.

    logs: run → its recording; after: look at the twin with the causes added
    """
    found: list[tuple[str, _TestedPattern]] = []
    for signal, of_signal in by_signal(trace for trace in traces if trace.run in logs):
        of = covariates(of_signal, logs, machine, after)
        if not of.known.any():
            continue
        said = list(_contrasts(of))
        time = _ahead(_over_time(of), [contrast for contrast in said if contrast.over != DRIFT])
        said += [*_odd_and_even(of), *_over_places(of), *_over_phases(of), *time]
        said += _ahead(_over_sections(of), said)
        found += [(signal, pattern) for pattern in said]
    stands = discoveries(np.array([pattern.p for _, pattern in found]))
    worth = [
        _pattern(signal, pattern)
        for (signal, pattern), stand in zip(found, stands, strict=True)
        if stand and pattern.share >= SHARE_MIN and pattern.size >= MEAN_TOLERANCE
    ]
    return tuple(sorted(worth, key=lambda pattern: -pattern.share))


def _ahead(vague: Iterator[_TestedPattern], others: Sequence[_TestedPattern]) -> list[_TestedPattern]:
    """Those of the vague patterns that explain more than all others do."""
    best = max((other.share for other in others if other.p < 1.0), default=0.0)
    return [pattern for pattern in vague if pattern.share > best + AHEAD]


def _pattern(signal: str, found: _TestedPattern) -> Pattern:
    sentence = f"{percent(found.share)} of the gap in {signal_words(signal)} {found.says}, {times_floor(found.size)}"
    return Pattern(signal, found.over, found.share, found.size, found.p, True, sentence, found.at_unit, found.at, found.mean)


def _contrasts(of: Covariates) -> Iterator[_TestedPattern]:
    for found in contrasts(of, SHARE_MIN):
        yield _TestedPattern(found.over, found.share, found.size, found.p, f"is the difference of {found.over} ({found.says})")


def _bins(of: Covariates, in_floors: Floats, bins: NDArray[np.intp], count: int) -> tuple[float, float, float, Floats]:
    """Share, size, p, and the mean of each bin in floors; bins: (n,), −1 = none."""
    there = (bins >= 0) & np.isfinite(in_floors)
    many = np.bincount(bins[there], minlength=count)
    mean = np.bincount(bins[there], in_floors[there], count) / np.maximum(many, 1)
    if not there.any():
        return 0.0, 0.0, 1.0, mean
    share = float(np.sum(many * mean**2)) / max(of.energy, 1e-300)
    if share < SHARE_MIN:
        return share, 0.0, 1.0, mean
    occupied = np.flatnonzero(many)
    p = means_of(in_floors, (bins == occupied[:, None]) & there).p_mean()
    standing = np.where(p <= p.min(), np.abs(mean[occupied]), 0.0)
    return min(share, 1.0), float(standing.max()), min(1.0, float(p.min()) * len(occupied)), mean


def _over_bins(
    of: Covariates, over: str, values: Floats, edges: Floats, by: NDArray[np.generic], where: Bools, unit: str, says: str
) -> Iterator[_TestedPattern]:
    """A pattern over evenly spaced bins of a covariate."""
    if len(edges) < 3 or not where.any():
        return
    bins = np.where(where & np.isfinite(values), np.clip(np.searchsorted(edges, values, "right") - 1, 0, len(edges) - 2), -1)
    share, size, p, _ = _bins(of, of.without_means(of.in_floors, by, where), bins, len(edges) - 1)
    if p >= 1.0:
        yield _TestedPattern(over, share, size, p, "")
        return
    yield _TestedPattern(over, share, size, p, *_curve(of, of.without_means(of.gap, by, where), bins, edges, unit, says))


def _curve(
    of: Covariates, gap: Floats, bins: NDArray[np.intp], edges: Floats, unit: str, says: str
) -> tuple[str, str, tuple[float, ...], tuple[float, ...]]:
    """Sentence, unit, middles and means of the bins that have samples."""
    there = (bins >= 0) & np.isfinite(gap)
    many = np.bincount(bins[there], minlength=len(edges) - 1)
    mean = np.bincount(bins[there], gap[there], len(edges) - 1)[many > 0] / many[many > 0]
    middle = (edges[:-1] if unit == "line" else (edges[:-1] + edges[1:]) / 2.0)[many > 0]
    low, high = int(np.argmin(mean)), int(np.argmax(mean))
    place = [f"line {middle[i]:.0f}" if unit == "line" else f"{digits(float(middle[i]))} {unit}" for i in (low, high)]
    ends = [f"{figure(float(mean[i]), of.unit)} at {where}" for i, where in zip((low, high), place, strict=True)]
    return f"{says}: from {ends[0]} to {ends[1]}", unit, tuple(middle.tolist()), tuple(mean.tolist())


def _over_places(of: Covariates) -> Iterator[_TestedPattern]:
    """Position along the axis, at constant speed, within a stretch."""
    steady = of.constant_speed() & np.isfinite(of.position_mm)
    if steady.any():
        edges = np.linspace(of.position_mm[steady].min(), of.position_mm[steady].max() + 1e-9, POSITION_BINS + 1)
        yield from _over_bins(of, "position", of.position_mm, edges, of.stretch, steady, "mm", "goes with the position")


def _over_phases(of: Covariates) -> Iterator[_TestedPattern]:
    """Phase of the screw, in stretches at constant speed that are a turn long, and phase of the spindle."""
    steady = of.constant_speed() & np.isfinite(of.lead_rad)
    if steady.any():
        turned = np.abs(np.diff(np.unwrap(np.where(steady, of.lead_rad, 0.0)), prepend=of.lead_rad[0]))
        turns = np.bincount(of.stretch[steady], turned[steady], int(of.stretch[-1]) + 1)
        steady = steady & (turns[of.stretch] >= TAU)
        yield from _harmonic(of, "lead phase", of.lead_rad, of.stretch, steady, "turn of the screw", of.stretch)
    turning = np.isfinite(of.spindle_rad) & ~of.within("dwell")
    if turning.any():
        yield from _harmonic(of, "spindle phase", of.spindle_rad, of.regime_code, turning, "turn of the spindle", of.heading)


def _harmonic(
    of: Covariates, over: str, phase: Floats, by: NDArray[np.generic], where: Bools, turn: str, apart: NDArray[np.generic]
) -> Iterator[_TestedPattern]:
    """The harmonic of a phase that has the largest share; its angle may be another for each label `apart`."""
    in_floors = of.without_means(of.in_floors, by, where)
    there = np.isfinite(in_floors)
    if there.sum() < 2 * PHASE_BINS:
        return
    _, group = np.unique(apart[there], return_inverse=True)
    many = np.bincount(group)
    turned = np.exp(-1j * phase[there])
    orders = min(HARMONICS, int(np.pi / max(_step(phase[there]), np.pi / HARMONICS)))
    if not orders:
        return
    power, vectors = np.ones_like(turned), np.zeros((orders, len(many)), dtype=np.complex128)
    for order in range(orders):
        power = power * turned
        parts = in_floors[there] * power
        vectors[order] = (np.bincount(group, parts.real) + 1j * np.bincount(group, parts.imag)) / many
    energy = np.abs(vectors) ** 2 @ many
    order = int(np.argmax(energy)) + 1
    amplitude = 2.0 * float(np.sqrt(energy[order - 1] / many.sum()))
    share = float(2.0 * energy[order - 1]) / max(of.energy, 1e-300)
    if share < SHARE_MIN:
        yield _TestedPattern(over, share, amplitude, 1.0, "")
        return
    angle = np.zeros(len(phase))
    angle[there] = np.angle(vectors[order - 1])[group]
    wave = in_floors * 2.0 * np.cos(order * phase + angle)
    p = min(1.0, float(means_of(wave, there[None]).p_mean()[0]) * 2 * HARMONICS * len(many))
    edges = np.linspace(0.0, TAU, PHASE_BINS + 1)
    bins = np.where(there, np.clip(np.searchsorted(edges, phase, "right") - 1, 0, PHASE_BINS - 1), -1)
    gap = of.without_means(of.gap, by, where)
    in_unit = amplitude * float(np.nansum(np.abs(gap[there])) / max(np.nansum(np.abs(in_floors[there])), 1e-300))
    times = "once" if order == 1 else f"{order} times"
    _, unit, at, mean = _curve(of, gap, bins, edges, "rad", "")
    yield _TestedPattern(
        over, min(share, 1.0), amplitude, p, f"repeats {times} a {turn} (amplitude {figure(in_unit, of.unit)})", unit, at, mean
    )


def _step(phase: Floats) -> float:
    """Return the step of a phase from sample to sample where it goes fast, rad."""
    return float(np.quantile(np.abs(np.angle(np.exp(1j * np.diff(phase)))), 0.9))


def _over_time(of: Covariates) -> Iterator[_TestedPattern]:
    """A drift over the run, the means of the regimes in each direction taken out; among sections, one that a parabola follows."""
    sections = bool(np.isfinite(of.section).any())
    edges = np.linspace(0.0, float(of.time_s.max()) + 1e-9, TIME_BINS + 1)
    directed = 3 * of.regime_code + np.sign(np.nan_to_num(of.velocity_mm_s)).astype(np.intp)
    for found in _over_bins(of, "time", of.time_s, edges, directed, of.known & ~of.resting, "s", "goes with the time of the run"):
        if found.p >= 1.0 or not sections or _smooth(np.array(found.at), np.array(found.mean)):
            yield found


def _smooth(at: Floats, mean: Floats) -> bool:
    """Return True where a parabola leaves less than 40 % of what varies."""
    if len(at) < 4:
        return False
    left = mean - np.polyval(np.polyfit(at - at.mean(), mean, 2), at - at.mean())
    return float(np.var(left)) < 0.4 * float(np.var(mean))


def _over_sections(of: Covariates) -> Iterator[_TestedPattern]:
    """NC lines, neighbouring ones together where there are many."""
    there = of.known & ~of.resting & np.isfinite(of.section)
    lines = np.unique(of.section[there])
    if len(lines) < 2:
        return
    step = int(np.ceil(len(lines) / SECTIONS_MAX))
    edges = np.append(lines[::step], lines[-1] + 1.0)
    everything = np.zeros(len(of.gap))
    yield from _over_bins(of, "section", of.section, edges, everything, there, "line", "goes with the program section")


def _odd_and_even(of: Covariates) -> Iterator[_TestedPattern]:
    """The parts of the gap that change sign with the direction, and that do not, over speed."""
    steady = of.constant_speed() & of.known
    speed = np.abs(of.velocity_mm_s)
    if not steady.any() or speed[steady].max() <= 0.0:
        return
    low, high = float(speed[steady].min()), float(speed[steady].max())
    edges = np.geomspace(max(low, 1e-3) * 0.999, high * 1.001, SPEED_BINS + 1)
    bins = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, SPEED_BINS - 1)
    cells = np.array(
        [[steady & (bins == b) & (sign * of.velocity_mm_s > 0.0) for b in range(SPEED_BINS)] for sign in (1.0, -1.0)]
    )
    both = np.flatnonzero(cells.any(axis=2).all(axis=0))
    if not len(both):
        return
    count = cells[:, both].sum(axis=2)
    known, gap = np.where(of.known, of.in_floors, 0.0), np.where(of.known, of.gap, 0.0)
    mean, in_unit = (cells[:, both] @ known) / count, (cells[:, both] @ gap) / count
    middle = np.sqrt(edges[:-1] * edges[1:])[both]
    words = {"odd in v": "changes sign with the direction of motion", "even in v": "is the same in both directions of motion"}
    for over, sign in (("odd in v", -1.0), ("even in v", 1.0)):
        part, part_in_unit = (mean[0] + sign * mean[1]) / 2.0, (in_unit[0] + sign * in_unit[1]) / 2.0
        share = float(np.sum(count * part**2)) / max(of.energy, 1e-300)
        if share < SHARE_MIN:
            yield _TestedPattern(over, share, 0.0, 1.0, "")
            continue
        error = np.hypot(*(means_of(of.in_floors, cells[side, both]).error for side in (0, 1))) / 2.0
        p = min(1.0, float(p_of(part, error).min()) * len(both))
        top = int(np.argmax(np.abs(part)))
        says = f"{words[over]} ({figure(float(part_in_unit[top]), of.unit)} at {figure(float(60 * middle[top]), 'mm/min')})"
        at, curve = tuple(middle.tolist()), tuple(part_in_unit.tolist())
        yield _TestedPattern(over, min(share, 1.0), float(np.abs(part).max()), p, says, "mm/s", at, curve)
