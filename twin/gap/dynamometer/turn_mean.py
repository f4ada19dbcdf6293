"""The synchronous mean: what the forces do in a turn of the spindle, over blocks of turns of an even stretch.

What is not locked to the spindle (vibration at frequencies of its own, noise, drift) averages out, and what blocks still differ
by is what repeats: revolutions are repeats of each other. Orders up to three tooth passings are kept, fitted by least squares to
the samples as they fell, so any rate of sampling will do that carries them; above, a dynamometer shows more of its own resonance
than of the cut.

    f(θ) = Σ_k a_k cos kθ + b_k sin kθ,   k ≤ 3 teeth
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Complexes = NDArray[np.complex128]

PASSINGS = 3
"""Harmonics of the tooth passing that are kept."""
SAMPLES_PER_TOOTH = 8
"""Points in which a mean turn is given, for each tooth: enough for PASSINGS harmonics."""
BLOCKS_MAX, BLOCK_TURNS_MIN = 16, 2
CARRIED = 0.42
"""Part of the rate of sampling up to which an order is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnMeans:
    """Mean turns. force: (signals, blocks, points); at: (blocks,) sample in the middle; highest: last order that is known."""

    force: Floats
    at: Ints
    highest: int


def highest_order(teeth: int, samples_per_turn: float) -> int:
    """Order up to which the rate of sampling carries a mean turn.

    >>> highest_order(4, 200.0), highest_order(4, 20.0)
    (12, 8)
    """
    return min(PASSINGS * teeth, int(CARRIED * samples_per_turn))


def turn_means(force: Floats, angle_rad: Floats, turn: Ints, teeth: int, *, with_mean: bool) -> TurnMeans:
    """The mean turns of one even stretch.

    force: (signals, n) without the offset of the sensors; angle_rad, turn: (n,); with_mean: keep the mean force
    """
    numbers = np.unique(turn)
    count = int(np.clip(len(numbers) // 8, min(4, len(numbers) // BLOCK_TURNS_MIN), BLOCKS_MAX))
    block = np.searchsorted(numbers, turn) * count // len(numbers)
    order = highest_order(teeth, len(turn) / len(numbers))
    points = teeth * SAMPLES_PER_TOOTH
    found = np.zeros((len(force), count, points))
    at = np.zeros(count, dtype=np.intp)
    for number in range(count):
        here = np.flatnonzero(block == number)
        at[number] = here[len(here) // 2]
        found[:, number] = _turn(force[:, here], angle_rad[here], order, points)
    if not with_mean:
        found -= found.mean(axis=2, keepdims=True)
    return TurnMeans(found, at, order)


def _turn(force: Floats, angle_rad: Floats, order: int, points: int) -> Floats:
    """One mean turn, (signals, points), by least squares over the samples."""
    turned = np.exp(1j * np.outer(np.arange(1, order + 1), angle_rad))
    columns = np.concatenate([np.ones((1, len(angle_rad))), turned.real, turned.imag])
    gram = columns @ columns.T
    fitted = np.linalg.lstsq(gram + 1e-9 * len(angle_rad) * np.eye(len(gram)), columns @ force.T, rcond=None)[0]
    at = np.exp(1j * np.outer(np.arange(1, order + 1), np.arange(points) * 2.0 * np.pi / points))
    return np.asarray(fitted.T @ np.concatenate([np.ones((1, points)), at.real, at.imag]))
