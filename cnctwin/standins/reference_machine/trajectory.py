"""The course that the control wants of the axes: blocks of a program turned into positions, eight to a millisecond.

The speed of a block is a trapezium, smoothed by its mean over a stretch of time, which bounds the jerk. With the displacement
s(t) of the trapezium and S its integral, the smoothed one is (S(t) − S(t − w)) / w: both are sums of powers of the times since
the acceleration last changed, so no step is rounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PER_MS = 8
"""Points of the path in a millisecond."""


@dataclass(frozen=True, slots=True)
class Dwell:
    """Waits; with a speed, the spindle turns at it from the start of the block."""

    seconds: float
    spindle_rpm: float | None = None


@dataclass(frozen=True, slots=True)
class Line:
    """Straight to a place, mm; axes that are not named stay."""

    to: tuple[float | None, float | None, float | None]
    feed_mm_min: float
    depth_mm: float = 0.0
    arc_rad: tuple[float, float] = (0.0, 0.0)
    """The engaged arc, where it cuts."""


@dataclass(frozen=True, slots=True)
class Circle:
    """A full turn in x and y about a centre that lies `centre` from where it begins."""

    centre: tuple[float, float]
    clockwise: bool
    feed_mm_min: float


Block = Dwell | Line | Circle


@dataclass(frozen=True, slots=True)
class Dynamics:
    """Acceleration, and the time over which the speed is smoothed."""

    acceleration_mm_s2: float
    smoothing_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """position_mm: (3, n · PER_MS + 1); block: (n,) index of the block of each millisecond."""

    position_mm: Floats
    block: NDArray[np.int64]

    def at_ticks(self, axis: int, delay_s: float = 0.0) -> Floats:
        """An axis at each tick, looked at `delay_s` late, (n,)."""
        return self._looked_at(self.position_mm[axis], delay_s)

    def velocity(self, axis: int, delay_s: float = 0.0) -> Floats:
        """Its velocity, mm/s, (n,)."""
        return self._looked_at(np.gradient(self.position_mm[axis], 0.001 / PER_MS), delay_s)

    def acceleration(self, axis: int, delay_s: float = 0.0) -> Floats:
        """Its acceleration, mm/s², (n,)."""
        velocity = np.gradient(self.position_mm[axis], 0.001 / PER_MS)
        return self._looked_at(np.gradient(velocity, 0.001 / PER_MS), delay_s)

    def _looked_at(self, values: Floats, delay_s: float) -> Floats:
        place = (np.arange(len(self.block)) - 1000.0 * delay_s) * PER_MS
        return np.asarray(np.interp(place, np.arange(len(values)), values))


def path_of(blocks: Sequence[Block], dynamics: Dynamics) -> Path:
    """The path of a program that begins at 0, 0, 0 and halts after each block."""
    place = np.zeros(3)
    parts, numbers = [], []
    for number, block in enumerate(blocks):
        points = _points(block, place, dynamics)
        parts.append(points[:, :-1])
        numbers.append(np.full((points.shape[1] - 1) // PER_MS, number))
        place = points[:, -1]
    return Path(np.concatenate([*parts, place[:, None]], axis=1), np.concatenate(numbers))


def _points(block: Block, place: Floats, dynamics: Dynamics) -> Floats:
    """(3, k · PER_MS + 1) from the place where the block begins to the one where it ends, both in it."""
    if isinstance(block, Dwell):
        return np.repeat(place[:, None], round(1000.0 * block.seconds) * PER_MS + 1, axis=1)
    if isinstance(block, Line):
        end = np.array([at if to is None else to for at, to in zip(place, block.to, strict=True)])
        length = float(np.linalg.norm(end - place))
        part = _travelled(length, block.feed_mm_min / 60.0, dynamics) / length
        points = place[:, None] + (end - place)[:, None] * part
        points[:, -1] = end
        return points
    radius = sqrt(block.centre[0] ** 2 + block.centre[1] ** 2)
    turned = _travelled(2.0 * np.pi * radius, block.feed_mm_min / 60.0, dynamics) / radius
    turned = -turned if block.clockwise else turned
    points = np.repeat(place[:, None], len(turned), axis=1)
    from_x, from_y = -block.centre[0], -block.centre[1]
    points[0] += block.centre[0] + np.cos(turned) * from_x - np.sin(turned) * from_y
    points[1] += block.centre[1] + np.sin(turned) * from_x + np.cos(turned) * from_y
    points[:, -1] = place
    assert abs(cos(turned[-1]) - 1.0) < 1e-9 and abs(sin(turned[-1])) < 1e-9, "a circle ends where it began"
    return points


def _travelled(length_mm: float, speed_mm_s: float, dynamics: Dynamics) -> Floats:
    """Length along a block at each point until it halts."""
    acceleration = dynamics.acceleration_mm_s2
    speed = min(speed_mm_s, sqrt(length_mm * acceleration))
    ramp_s, cruise_s = speed / acceleration, length_mm / speed
    total_s = cruise_s + ramp_s + dynamics.smoothing_s
    t_s: Floats = np.arange(int(np.ceil(1000.0 * total_s)) * PER_MS + 1, dtype=np.float64) * (0.001 / PER_MS)
    jumps = ((0.0, 1.0), (ramp_s, -1.0), (cruise_s, -1.0), (cruise_s + ramp_s, 1.0))

    def integral(at_s: Floats) -> Floats:
        since = [(sign, np.maximum(at_s - jump_s, 0.0)) for jump_s, sign in jumps]
        return np.asarray(sum(sign * acceleration * late**3 / 6.0 for sign, late in since))

    part = (integral(t_s) - integral(np.asarray(t_s - dynamics.smoothing_s))) / dynamics.smoothing_s
    return np.asarray(np.clip(part, 0.0, length_mm))
