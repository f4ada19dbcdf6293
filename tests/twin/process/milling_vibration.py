"""The vibration of a tool in a cut, step by step: an integration of its own of the delay differential equation of milling.

m q" + c q' + k q = F for each direction, in the axes of the feed (x along it, y to its left, one mode each); every tooth that is
in the arc takes the chip Δx sin φ + Δy cos φ, Δ from where the tool was a tooth period ago, and bears K_t b h against its motion
and K_e K_t b h towards the axis. The feed itself is left out: it moves the tool, and does not decide whether a vibration grows.
Runge–Kutta of the fourth order; the past between two steps by Hermite's cubic. No code of the twin is used.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEPS_BY_TOOTH = 100


@dataclass(frozen=True)
class Rotor:
    """A tool with straight edges in its arc, its speed and its depth."""

    teeth: int
    tangential_n_per_mm2: float
    radial_ratio: float
    entry_rad: float
    exit_rad: float
    rpm: float
    depth_mm: float

    def force_by_step(self) -> Array:
        """Force on the tool, N by mm of Δ, at each half step of a tooth period: (half steps, 2, 2)."""
        matrices = np.empty((2 * STEPS_BY_TOOTH, 2, 2))
        for half_step in range(2 * STEPS_BY_TOOTH):
            phi = 2.0 * math.pi / self.teeth * (half_step / (2 * STEPS_BY_TOOTH) + np.arange(self.teeth))
            phi = phi[(phi > self.entry_rad) & (phi <= self.exit_rad)]
            sine, cosine = np.sin(phi), np.cos(phi)
            bears = np.array([-cosine - self.radial_ratio * sine, sine - self.radial_ratio * cosine])
            matrices[half_step] = self.tangential_n_per_mm2 * self.depth_mm * (bears @ np.array([sine, cosine]).T)
        return matrices


def growth(
    stiffness: tuple[float, float],
    frequency_hz: tuple[float, float],
    damping: tuple[float, float],
    rotors: Sequence[Rotor],
    tooth_periods: int = 120,
) -> Array:
    """By how much the vibration of each is larger in the last quarter than in the second; all of them at once."""
    omega = 2.0 * math.pi * np.array(frequency_hz)[:, None]
    inverse_mass = omega**2 / np.array(stiffness)[:, None]
    friction = 2.0 * np.array(damping)[:, None] * omega
    step = np.array([60.0 / (rotor.teeth * rotor.rpm) for rotor in rotors]) / STEPS_BY_TOOTH
    matrices = np.stack([rotor.force_by_step() for rotor in rotors], axis=-1)

    def slope(state: Array, before: Array, half_step: int) -> Array:
        force = (matrices[half_step % (2 * STEPS_BY_TOOTH)] * (state[:2] - before)).sum(axis=1)
        return np.concatenate([state[2:], inverse_mass * force - friction * state[2:] - omega**2 * state[:2]])

    ticks = tooth_periods * STEPS_BY_TOOTH
    past = np.zeros((ticks + 1, 4, len(rotors)))
    past[0, :2] = [[1.0], [0.7]]
    zero = np.zeros((4, len(rotors)))
    for tick in range(ticks):
        at = tick - STEPS_BY_TOOTH
        old, new = (past[at], past[at + 1]) if at >= 0 else (zero, zero)
        between = 0.5 * (old[:2] + new[:2]) + step / 8.0 * (old[2:] - new[2:])
        state = past[tick]
        k1 = slope(state, old[:2], 2 * tick)
        k2 = slope(state + 0.5 * step * k1, between, 2 * tick + 1)
        k3 = slope(state + 0.5 * step * k2, between, 2 * tick + 1)
        k4 = slope(state + step * k3, new[:2], 2 * tick + 2)
        past[tick + 1] = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    size = np.sqrt((past[:, :2] ** 2).sum(axis=1))
    quarter = ticks // 4
    grown: Array = size[3 * quarter :].max(axis=0) / size[quarter : 2 * quarter].max(axis=0)
    return grown
