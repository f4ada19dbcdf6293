"""Copies of a learned transient, as they might come: faster or slower, stalled, in the noise of the captures."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.transient.learning import Learned
from twin.transient.template import Template, resampled

Floats = NDArray[np.float64]
STRETCH_MIN, STRETCH_MAX = 0.75, 1.4
REST_S = 3.0


def copies_of(found: Learned, count: int, rng: np.random.Generator) -> list[Floats]:
    """So many windows of levels."""
    deviation, correlation = noise_of(found)
    return [_copy(found.template, found.scale, deviation, correlation, rng) for _ in range(count)]


def noise_of(found: Learned) -> tuple[float, float]:
    """Standard deviation, over that of the captures, and lag-one correlation of what the template leaves of the captures."""
    form = np.concatenate([found.template.start, found.template.end])
    left = []
    for fit in found.fits:
        if fit is not None:
            values = np.concatenate(
                [resampled(fit.start, len(found.template.start)), resampled(fit.end, len(found.template.end))]
            )
            left.append((values - values.mean()) / max(float(values.std()), 1e-12) - form)
    if len(left) < 2:
        return 0.1, 0.0  # a single capture tells nothing of noise
    spread = float(np.sqrt(np.mean(np.concatenate(left) ** 2)) * np.sqrt(len(left) / (len(left) - 1.0)))
    pairs = np.array([(a, b) for one in left for a, b in pairwise(one)])
    correlation = float((pairs[:, 0] * pairs[:, 1]).mean() / max(float((pairs**2).mean()), 1e-12))
    return spread, float(np.clip(correlation, 0.0, 0.95))


def _copy(form: Template, scale: float, deviation: float, correlation: float, rng: np.random.Generator) -> Floats:
    stretch = rng.uniform(STRETCH_MIN, STRETCH_MAX)
    start, between, end = (
        resampled(part, max(1, round(len(part) * stretch))) if len(part) else part
        for part in (form.start, form.between, form.end)
    )
    at = int(rng.integers(0, len(between) + 1))
    stall = round(rng.uniform(0.0, form.stall_s) / form.period_s)
    stalled_at = between[at - 1] if at else start[-1]
    rest = round(REST_S / form.period_s)
    shape = np.concatenate(
        [np.full(rest, start[0]), start, between[:at], np.full(stall, stalled_at), between[at:], end, np.full(rest, end[-1])]
    )
    noise = np.empty(len(shape))
    last = rng.standard_normal()
    for n in range(len(shape)):
        last = correlation * last + np.sqrt(1.0 - correlation**2) * rng.standard_normal()
        noise[n] = last
    return np.asarray(scale * (shape + deviation * noise))
