"""The floor under mean turns, order by order of the spindle: what turns differ by, and what no dynamometer is better than.

Blocks of turns are repeats of each other, and what they differ by is chance. What a dynamometer does to a force is the same in
all of them: its axes are straight and square to a percent or two, and the table with the work on it resonates, which amplifies a
force of frequency f by about 1 + (f / f_n)². A twin that knows neither is not to be blamed for them,

    floor_k² = chance_k² + systematic_k²,   systematic_k² = (part² + (f_k / f_n)⁴) |F_k|² + least² F²
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

PART, LEAST = 0.02, 0.003
"""Parts of the order itself in both directions, and of the whole force."""
RESONANCE_HZ = 1500.0
"""Resonance of a table with work on it, where it is low."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnFloor:
    """chance: of one block; systematic: of all blocks alike; (signals, orders) each, N, of the real and of the imaginary part."""

    chance: Floats
    systematic: Floats

    @property
    def floor(self) -> Floats:
        """Both, (signals, orders)."""
        return np.hypot(self.chance, self.systematic)

    def sigma(self, blocks: int) -> Floats:
        """The noise of a block for a fit to so many of them, in which what is alike in all counts once; (signals, orders)."""
        return np.sqrt(self.chance**2 + blocks * self.systematic**2)

    def rms(self) -> Floats:
        """The floor of a turn as a whole, (signals,), N."""
        return np.asarray(np.sqrt(np.sum(self.floor**2, axis=1)))


def turn_floor(orders: Complexes, spindle_hz: float) -> TurnFloor:
    """The floor of the blocks of one even stretch; orders: (signals, blocks, orders), amplitudes.

    >>> still = np.tile(np.array([0.0, 100.0 + 0.0j]), (2, 4, 1))
    >>> turn_floor(still, 15.0).floor.round(2).tolist()
    [[0.3, 2.84], [0.3, 2.84]]
    """
    count, number = orders.shape[1], np.arange(orders.shape[2])
    away = orders - orders.mean(axis=1, keepdims=True)
    own = np.mean(np.abs(away) ** 2, axis=1) / 2.0 * count / max(count - 1, 1)
    own[:, 0] *= 2.0  # a mean has no imaginary part
    chance = np.sqrt(0.5 * (own + own.mean(axis=1, keepdims=True)))
    both = np.sqrt(np.sum(np.abs(orders.mean(axis=1)) ** 2, axis=0))
    whole = np.sqrt(both[0] ** 2 + np.sum(both[1:] ** 2) / 2.0)
    amplified = (number * spindle_hz / RESONANCE_HZ) ** 2
    systematic = np.sqrt((PART**2 + amplified**2) * both**2 + (LEAST * whole) ** 2)
    return TurnFloor(chance, np.broadcast_to(systematic, chance.shape).copy())
