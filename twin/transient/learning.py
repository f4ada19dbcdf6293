"""A template from captures: each is fitted with stretch, place and gap, brought to the common time, and averaged.

The first form is the capture that the others resemble most. Then, twice: find beginning and end of the present form in each
capture, whichever of the stretches and gaps fits best; bring what was found to the form's length; average. Noise falls with the
number of captures; what differs between changes (how long the tool was searched) stays out, since the gap is free.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from twin.transient.capture import Parts, parts_of
from twin.transient.errors import TransientError
from twin.transient.template import STRETCHES, Template, resampled

Floats = NDArray[np.float64]
ROUNDS = 2
REFERENCES_MAX = 8
RHO_MIN = 0.5
"""A capture in which the pattern is found less well is no example of it."""


@dataclass(frozen=True, eq=False)
class Fit:
    """The form found in one capture.

    rho: the smaller one of start_rho and end_rho
    start, between, end: what was captured, at the form's length, in the level of the signal; deviation: of start and end together
    begin: sample of the window where it begins; stretch, gap_samples: as found
    """

    rho: float
    start_rho: float
    end_rho: float
    begin: int
    stretch: float
    gap_samples: int
    start: Floats
    between: Floats
    end: Floats
    deviation: float


@dataclass(frozen=True, eq=False)
class Learned:
    """The template, and how it was found in each capture (None where it was not). scale: deviation of the captures."""

    template: Template
    fits: tuple[Fit | None, ...]
    scale: float

    def without(self, n: int) -> Template:
        """The template as it is without capture n; of a single one, the template itself."""
        fits = [fit for k, fit in enumerate(self.fits) if fit is not None and k != n]
        return _averaged(self.template, fits) if fits else self.template


def correlations(values: Floats, part: Floats) -> Floats:
    """rho of `part`, (m,), with each window of `values`, (n,): (n − m + 1,). Flat windows give 0."""
    if len(values) < len(part):
        return np.zeros(0)
    windows = sliding_window_view(values, len(part))
    weights = part - part.mean()
    norm = float(np.linalg.norm(weights))
    spread = windows.std(axis=1) * np.sqrt(len(part))
    flat = spread <= 1e-6 * max(1e-30, float(np.ptp(values)))
    return np.where(flat | (norm == 0.0), 0.0, (windows @ weights) / np.where(flat, 1.0, spread * max(norm, 1e-300)))


def learned(captures: Sequence[Floats], period_s: float, stall_s: float, stretches: tuple[float, ...] = STRETCHES) -> Learned:
    """The template of these windows of levels, each of which holds one transient.

    Raises TransientError where there is no transient in them, or they have none in common.
    """
    if not captures:
        raise TransientError("no captured change to learn from")
    parts = [_parts_or_none(capture, period_s) for capture in captures]
    usable = [n for n, found in enumerate(parts) if found is not None]
    if not usable:
        parts_of(captures[0], period_s)  # says why
    first = _most_alike(captures, parts, usable)
    found = parts[first]
    assert found is not None
    window = captures[first]
    three = window[found.first : found.begun], window[found.begun : found.ending], window[found.ending : found.last]
    form = Template(period_s, *_normal(*three), stall_s, stretches)
    fits: list[Fit | None] = []
    for _ in range(ROUNDS):
        fits = [fitted(form, capture) for capture in captures]
        good = [fit for fit in fits if fit is not None]
        if not good:
            raise TransientError("the captured windows have no transient in common: give the times of like changes")
        form = _averaged(form, good)
    scale = float(np.median([fit.deviation for fit in fits if fit is not None]))
    return Learned(form, tuple(fits), scale)


def fitted(form: Template, window: Floats) -> Fit | None:
    """The form in a captured window; None where it is not there."""
    best: tuple[float, float, int, float, int, int, int] | None = None
    stall = round(form.stall_s / form.period_s)
    for stretch in form.stretches:
        d, r = (max(3, round(len(part) * stretch)) for part in (form.start, form.end))
        starts, ends = correlations(window, resampled(form.start, d)), correlations(window, resampled(form.end, r))
        nominal = len(form.between) * stretch
        for gap in range(int(0.8 * nominal), int(np.ceil(1.2 * nominal)) + stall + 1):
            count = len(window) - d - gap - r + 1
            if count <= 0:
                break
            both = np.minimum(starts[:count], ends[d + gap : d + gap + count])
            at = int(np.argmax(both))
            if best is None or both[at] > min(best[:2]):
                best = float(starts[at]), float(ends[at + d + gap]), at, stretch, d, gap, r
    if best is None or min(best[:2]) < RHO_MIN:
        return None
    start_rho, end_rho, at, stretch, d, gap, r = best
    start, between, end = window[at : at + d], window[at + d : at + d + gap], window[at + d + gap : at + d + gap + r]
    deviation = float(np.concatenate([start, end]).std())
    lengths = len(form.start), len(form.between), len(form.end)
    parts = [
        resampled(part, count) if len(part) else np.zeros(count)
        for part, count in zip((start, between, end), lengths, strict=True)
    ]
    rho = min(start_rho, end_rho)
    return Fit(rho, start_rho, end_rho, at, stretch, gap, parts[0], parts[1], parts[2], deviation)


def _parts_or_none(window: Floats, period_s: float) -> Parts | None:
    try:
        return parts_of(window, period_s)
    except TransientError:
        return None


def _most_alike(captures: Sequence[Floats], parts: Sequence[Parts | None], usable: Sequence[int]) -> int:
    """The capture whose transient is found best in the others; a short one shows a part only, of a spindle that stood already."""
    lengths = {n: found.last - found.first for n in usable if (found := parts[n]) is not None}
    whole = [n for n in usable if lengths[n] >= np.median(list(lengths.values()))]
    some = whole[:: max(1, -(-len(whole) // REFERENCES_MAX))]
    likeness = {}
    for n in some:
        found = parts[n]
        assert found is not None
        core = captures[n][found.first : found.last]
        best = [max((correlations(captures[k], core).max(initial=0.0)), 0.0) for k in some if k != n]
        likeness[n] = float(np.mean(best)) if best else 1.0
    return max(likeness, key=lambda n: likeness[n])


def _averaged(form: Template, fits: Sequence[Fit]) -> Template:
    """The form with the average of what was found, each with the same weight; its gap and length are the median ones."""
    normal = [_normal(fit.start, fit.between, fit.end) for fit in fits]
    start, between, end = (np.mean([parts[n] for parts in normal], axis=0) for n in range(3))
    gap = round(float(np.median([fit.gap_samples / fit.stretch for fit in fits])))
    stretch = float(np.median([fit.stretch for fit in fits]))
    count = [max(3, round(len(part) * stretch)) for part in (start, end)]
    between = resampled(between, round(gap * stretch)) if len(between) else np.zeros(round(gap * stretch))
    parts = _normal(resampled(start, count[0]), between, resampled(end, count[1]))
    return replace(form, start=parts[0], between=parts[1], end=parts[2])


def _normal(start: Floats, between: Floats, end: Floats) -> tuple[Floats, Floats, Floats]:
    """The three parts, such that start and end together have mean 0 and deviation 1."""
    both = np.concatenate([start, end])
    mean, deviation = both.mean(), max(float(both.std()), 1e-12)
    return (start - mean) / deviation, (between - mean) / deviation, (end - mean) / deviation
