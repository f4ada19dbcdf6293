"""Acceleration and velocity of the band from 10 to 1000 Hz, streaming, without numpy: cheap enough for a gateway.

The same band-pass as `twin/vibration.py` (Butterworth, order 4 at each edge, ISO 2954) and the same integrator
H(z) = T (b0 + b1/z) / (1 - 1/z), b0 + b1 = 1, b0 b1 = 1/12; a test holds both against each other. Here all four sections are

    w[n] = x[n] - a1 w[n-1] - a2 w[n-2],    y[n] = w[n] - w[n-2]

since the zeros are four times z = 1 and four times z = -1, one of each in a section. The last section has two outputs: velocity
takes, in place of its zero at z = 1, the zero of the integrator, whose pole that is:

    v[n] = (w[n] + w[n-1]) b0 + (w[n-1] + w[n-2]) b1

So a sample costs four sections and not eight, 1 % of a core at 10 kHz (`benchmarks/edges/accelerometer.py`).
"""

import cmath
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

STANDARD_GRAVITY_M_S2 = 9.80665
MM_PER_M = 1000.0
ORDER = 4
LEADING = (1.0 + math.sqrt(2.0 / 3.0)) / 2.0
LOW_HZ, HIGH_HZ = 10.0, 1000.0
RATE_BANDS_MIN = 4.0
"""The sample rate is at least so many times the upper edge."""


class Band(NamedTuple):
    """Feedback of the four sections: a1, a2 of each; gains from w of the last one to g, and to mm/s."""

    sections: tuple[tuple[float, float], ...]
    gain: float
    velocity_gain: float


class Carried(NamedTuple):
    """w[n-1] and w[n-2] of each section, flat."""

    w: tuple[float, ...]


class Sums(NamedTuple):
    """The number of samples, and their sums of squares of acceleration in g and of velocity in mm/s."""

    samples: int = 0
    acceleration: float = 0.0
    velocity: float = 0.0

    def plus(self, other: "Sums") -> "Sums":
        """Return the sums of both."""
        return Sums(self.samples + other.samples, self.acceleration + other.acceleration, self.velocity + other.velocity)

    @property
    def rms_g(self) -> float:
        """Root of the mean square; there has to be a sample."""
        return math.sqrt(self.acceleration / self.samples)

    @property
    def velocity_mm_s(self) -> float:
        """Root of the mean square; there has to be a sample."""
        return math.sqrt(self.velocity / self.samples)


@lru_cache(maxsize=32)
def band(rate_hz: float) -> Band:
    """Design the filter: the analogue prototype, made a band-pass, by the bilinear transform. ValueError at too low a rate.

    >>> len(band(10_000.0).sections)
    4
    """
    if not rate_hz >= RATE_BANDS_MIN * HIGH_HZ:
        raise ValueError(f"a sample rate of {rate_hz:g} Hz is below {RATE_BANDS_MIN * HIGH_HZ:g}")
    # Frequencies are bent beforehand, in units of half the sample rate, so that the edges lie right after the transform.
    low, high = (4.0 * math.tan(math.pi * hz / rate_hz) for hz in (LOW_HZ, HIGH_HZ))
    width, centre = high - low, low * high
    poles = list[complex]()
    for number in range(ORDER):
        prototype = -cmath.exp(1j * math.pi * (2 * number - ORDER + 1) / (2 * ORDER))
        half = prototype * width / 2.0
        root = cmath.sqrt(half * half - centre)
        poles += [half + root, half - root]
    # 4 is twice the sample rate where that is 2.
    gain = (width**ORDER * 4.0**ORDER / math.prod((4.0 - pole for pole in poles), start=1.0 + 0.0j)).real
    digital = [(4.0 + pole) / (4.0 - pole) for pole in poles]
    upper = sorted((pole for pole in digital if pole.imag > 0.0), key=abs)
    sections = tuple((-2.0 * pole.real, abs(pole) ** 2) for pole in upper)
    assert len(sections) == ORDER
    return Band(sections, gain, gain / rate_hz * STANDARD_GRAVITY_M_S2 * MM_PER_M)


def started(filters: Band, first_g: float) -> Carried:
    """Return the state as if the first value had stood for ever: the first section rests at it, the others at nothing."""
    a1, a2 = filters.sections[0]
    rest = first_g / (1.0 + a1 + a2)
    return Carried((rest, rest) + (0.0,) * (2 * ORDER - 2))


def filtered(filters: Band, carried: Carried, samples_g: Sequence[float]) -> tuple[Carried, Sums]:
    """The sums of squares of some samples, and the state after them."""
    (a1, a2), (b1, b2), (c1, c2), (d1, d2) = filters.sections
    p1, p2, q1, q2, r1, r2, s1, s2 = carried.w
    lead, trail = LEADING, 1.0 - LEADING
    acceleration = velocity = 0.0
    for x in samples_g:
        p = x - a1 * p1 - a2 * p2
        q = p - p2 - b1 * q1 - b2 * q2
        r = q - q2 - c1 * r1 - c2 * r2
        s = r - r2 - d1 * s1 - d2 * s2
        y = s - s2
        v = lead * (s + s1) + trail * (s1 + s2)
        acceleration += y * y
        velocity += v * v
        p2, p1, q2, q1, r2, r1, s2, s1 = p1, p, q1, q, r1, r, s1, s
    gain, velocity_gain = filters.gain, filters.velocity_gain
    sums = Sums(len(samples_g), acceleration * gain * gain, velocity * velocity_gain * velocity_gain)
    return Carried((p1, p2, q1, q2, r1, r2, s1, s2)), sums
