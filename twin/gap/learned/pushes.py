"""A force over time in words: single pushes, a swing, or neither; no word of a cause."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.wording import digits

Floats = NDArray[np.float64]
SIGMAS, PEAK_PART = 5.0, 0.3
"""A push is more than so many deviations of the calm, and such a part of the largest."""
PUSHES_PART, SWING_PART = 0.6, 0.4
"""Part of the energy of a force that is in its pushes, or at one frequency, for it to be called so."""
PUSHES_MAX = 60
FEW_PART = 0.2
"""Part of the time: a force that is known, or is not nothing, for less of it is a push as a whole."""
SPREAD_PART = 0.1
"""Spread of the places of pushes, over the range of the axis, from which on they are at no place in particular."""
NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


@dataclass(frozen=True, slots=True)
class Push:
    """A push: its start and length, s; its height, in the unit of the force; where the axis was, mm."""

    at_s: float
    for_s: float
    height: float
    place_mm: float


def pushes_of(at_s: Floats, force: Floats, position_mm: Floats) -> tuple[Push, ...]:
    """Return the pushes in a force over time; position_mm: of the axis at these times, (n,).

    >>> at_s = np.arange(0.0, 4.0, 0.04)
    >>> force = np.where((at_s > 1.0) & (at_s < 1.21), 35.0, 0.0)
    >>> [(round(p.at_s, 2), round(p.for_s, 2), p.height) for p in pushes_of(at_s, force, at_s)]
    [(1.04, 0.2, 35.0)]
    """
    known = force[np.flatnonzero(force)]
    if not len(known):
        return ()
    calm = float(np.median(known)) if len(known) > 0.5 * len(force) else 0.0
    spread = 1.4826 * float(np.median(np.abs(known - calm))) if len(known) > FEW_PART * len(force) else 0.0
    away = np.where(force != 0.0, np.abs(force - calm), 0.0)
    high = away > max(SIGMAS * spread, PEAK_PART * float(away.max()), 1e-12)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(np.int8)))
    step = float(np.median(np.diff(at_s)))
    found = []
    for first, end in edges.reshape(-1, 2):
        place = float(np.median(position_mm[first:end]))
        found.append(Push(float(at_s[first]), float(end - first) * step, float(np.median(force[first:end]) - calm), place))
    return tuple(found)


def time_sentence(letter: str, unit: str, runs: Sequence[tuple[Floats, Floats, Floats]]) -> str:
    """Return what a force over time is; runs: times, force and position of the axis of each run."""
    pushes = [push for run in runs for push in pushes_of(*run)]
    whole = sum(float(np.sum(force**2)) for _, force, _ in runs)
    in_pushes = 0.0
    for at_s, force, position in runs:
        for push in pushes_of(at_s, force, position):
            inside = (at_s >= push.at_s) & (at_s < push.at_s + push.for_s)
            in_pushes += float(np.sum(force[inside] ** 2))
    if 0 < len(pushes) <= PUSHES_MAX and in_pushes > PUSHES_PART * whole:
        return f"{_pushes(letter, unit, pushes, runs)}, reconstructed over the time of each run"
    hertz, part, amplitude = max((_swing(at_s, force) for at_s, force, _ in runs), key=lambda swing: swing[1])
    if part > SWING_PART:
        return (
            f"a force on {letter.upper()} that swings by ±{digits(amplitude)} {unit} {digits(hertz)} times a second, "
            "reconstructed over the time of each run"
        )
    rms = float(np.sqrt(whole / max(sum(len(force) for _, force, _ in runs), 1)))
    return (
        f"a force on {letter.upper()} of {digits(rms)} {unit} rms that comes and goes with nothing else that was recorded, "
        "reconstructed over the time of each run"
    )


def _pushes(letter: str, unit: str, pushes: Sequence[Push], runs: Sequence[tuple[Floats, Floats, Floats]]) -> str:
    heights = np.array([push.height for push in pushes])
    count = NUMBERS[len(pushes)] if len(pushes) < len(NUMBERS) else str(len(pushes))
    alike = np.ptp(np.abs(heights)) < 0.5 * np.abs(heights).max()
    size = f"about {digits(float(np.median(heights)))} {unit}" if alike and (heights > 0).all() == (heights > 0).any() else (
        f"{digits(float(heights.min()))} to {digits(float(heights.max()))} {unit}"
    )  # fmt: skip
    lasting = digits(float(np.median([push.for_s for push in pushes])))
    places = np.array([push.place_mm for push in pushes])
    reach = max(float(np.ptp(position)) for _, _, position in runs)
    nowhere = len(pushes) > 1 and float(places.std()) > SPREAD_PART * max(reach, 1e-9)
    where = ", at no place in particular" if nowhere else (f", at {digits(float(np.median(places)))} mm" if reach > 0.0 else "")
    noun = "push" if len(pushes) == 1 else "pushes"
    each = "" if len(pushes) == 1 else " each"
    return f"{count} {noun} on {letter.upper()} of {size}, {lasting} s{each}{where}"


def _swing(at_s: Floats, force: Floats) -> tuple[float, float, float]:
    """The strongest frequency of a force, its part of the energy, and its amplitude, over the times at which it is known."""
    known = np.flatnonzero(force)
    if len(known) < 16:
        return 0.0, 0.0, 0.0
    centred = np.where(force != 0.0, force - force[known].mean(), 0.0)
    step = float(np.median(np.diff(at_s)))
    spectrum = np.fft.rfft(centred, 4 * len(force))
    power = np.abs(spectrum) ** 2
    best = int(np.argmax(power))
    amplitude = 2.0 * float(np.sqrt(power[best])) / len(known)
    part = 0.5 * amplitude**2 * len(known) / max(float(centred @ centred), 1e-12)
    return best / (4 * len(force) * step), part, amplitude
