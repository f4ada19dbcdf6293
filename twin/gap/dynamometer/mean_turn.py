"""The mean turn that a twin's tool shows in an even stretch, and the phase at which it lies over a recorded one.

A turn is worked out in fine steps of the angle, each with the mean of the force over it, which a jump at entry or exit does not
upset; then the orders that the recording keeps are taken of it. Where the phase of the spindle is not known it is a nuisance of
each stretch, and the one at which the twin lies best over the recording is taken,

    max over δ of Re Σ_k conj(M_k) P_k exp(−i k δ) / σ²

by a grid and Newton's steps, so that shapes are compared and not phases.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.learned.cutting import cut_arguments, cut_series, milling_with_terms
from twin.learned.term import Term
from twin.process.milling import Milling

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

STEPS_PER_TOOTH = 96
GRID_PER_ORDER = 16
NEWTON_STEPS = 4
TAU = 2.0 * np.pi


@dataclass(frozen=True, slots=True)
class Engagement:
    """The conditions of an even stretch. heading_rad: of the feed, 0 = along x"""

    rpm: float
    feed_mm_s: float
    depth_mm: float
    entry_rad: float
    exit_rad: float
    heading_rad: float

    def over(self, angle_rad: Floats) -> Milling:
        """The same cut at these angles of the spindle."""
        same = [np.full(len(angle_rad), v) for v in (self.rpm, self.feed_mm_s * np.cos(self.heading_rad))]
        same += [np.full(len(angle_rad), self.feed_mm_s * np.sin(self.heading_rad))]
        same += [np.full(len(angle_rad), v) for v in (self.depth_mm, self.entry_rad, self.exit_rad)]
        return Milling(angle_rad, *same)


@dataclass(frozen=True, slots=True, eq=False)
class FineTurn:
    """A turn in fine steps. force: (2, lanes, steps), mean over each step; step_s: how long one takes."""

    force: Floats
    step_s: float

    def orders(self, highest: int) -> Complexes:
        """Amplitudes of the orders 0 to `highest`, (2, lanes, orders), so that f = Re Σ F_k exp(i k θ)."""
        steps = self.force.shape[2]
        k = np.arange(highest + 1)
        half = k * np.pi / steps
        # the mean over a step is that of the wave by sin(half)/half, half a step later
        found = np.fft.rfft(self.force, axis=2)[..., : highest + 1] / steps * np.exp(-1j * half) / np.sinc(half / np.pi)
        found[..., 1:] *= 2.0
        return np.asarray(found)


def fine_turn(
    constants: Mapping[str, ArrayLike], teeth: int, cut: Engagement, effects: Sequence[str], terms: Sequence[Term] = ()
) -> FineTurn:
    """A turn of the tool in this engagement, in all lanes. terms: learned ones of the cut that the machine has"""
    steps = teeth * STEPS_PER_TOOTH
    step_s = 60.0 / (cut.rpm * steps)
    motion = cut.over(np.arange(steps) * TAU / steps)
    series = cut_series(terms, cut_arguments(motion, teeth))
    force = milling_with_terms(constants, teeth, motion, series, period_s=step_s, effects=effects)
    return FineTurn(np.stack([force.mean_force_x_n, force.mean_force_y_n]), step_s)


def orders_of(turn: Floats, highest: int) -> Complexes:
    """Amplitudes of the orders of turns given at even points, (…, points) → (…, orders).

    >>> orders_of(3.0 + np.cos(np.arange(8) * TAU / 8), 1).round(6).real.tolist()
    [3.0, 1.0]
    """
    found = np.fft.rfft(turn, axis=-1)[..., : highest + 1] / turn.shape[-1]
    found[..., 1:] *= 2.0
    return np.asarray(found)


def turn_of(orders: Complexes, points: int) -> Floats:
    """Turns at even points, (…, points), from the amplitudes of their orders."""
    k = np.arange(orders.shape[-1])
    return np.asarray((orders @ np.exp(1j * np.outer(k, np.arange(points) * TAU / points))).real)


def best_phase(measured: Complexes, predicted: Complexes, within_rad: float) -> Floats:
    """The phase by which the predicted turn has to be delayed to lie best over the measured one, (lanes,).

    measured: (rows, orders), predicted: (rows, lanes, orders), both over their noise; within_rad: π = anywhere

    >>> wave = np.array([[0.0, 1.0, 0.5]], dtype=complex)
    >>> late = wave * np.exp(-1j * np.arange(3) * 0.7)
    >>> best_phase(late, wave[:, None, :], np.pi).round(6).tolist()
    [0.7]
    """
    k = np.arange(measured.shape[-1])
    together = np.sum(np.conj(measured)[:, None, :] * predicted, axis=0)
    grid = np.linspace(-within_rad, within_rad, GRID_PER_ORDER * len(k) + 1)
    height = (together @ np.exp(-1j * np.outer(k, grid))).real
    at = grid[np.argmax(height, axis=1)]
    for _ in range(NEWTON_STEPS):
        turned = together * np.exp(-1j * k * at[:, None])
        slope, bend = (turned * (-1j * k)).real.sum(axis=1), (turned * -(k**2)).real.sum(axis=1)
        move = np.where(bend < 0.0, -slope / np.minimum(bend, -1e-300), 0.0)
        at = at + np.clip(move, -grid[1] + grid[0], grid[1] - grid[0])
    return np.asarray(np.clip(at, -within_rad, within_rad))
