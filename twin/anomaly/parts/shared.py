"""The disturbances that all machines of a hall feel at a tick: a floor that shakes, a coolant whose pressure falls.

    vibration    E = mean over 4 s of (v² − usual²)          g²; a shaken floor adds the same to quiet and to loud machines
    load         c = mean over 8 s of the change of the cut    ln; a lubricant that fails makes every cut harder

A machine tells its peers what it feels. What they share of a vibration is the mean of their E, each by its precision: one that
stands still feels a small one, one that mills hard does not. What they share of a load is the lower median, so that a single one
with a fault of its own explains nothing to the others; of two it is the mean.
"""

from collections.abc import Sequence
from math import exp, log, sqrt
from typing import Protocol

SHAKEN_S, HARDER_S = 4.0, 8.0
SHAKEN_FRESH_S, HARDER_FRESH_S = 5.0, 30.0
LEAST_TOLD, TOLD_MIN = 0.1, 0.15
OF_USUAL, OF_FELT = 0.25, 0.3
"""Standard deviation of E, as shares of what is usual and of what is felt."""
SHAKEN_GAIN, HARDER_GAIN = 2.0, 3.0
"""A machine may feel so many times what its peers do: where it stands decides. Training knows the first one better."""
GAIN_QUANTILE, GAINS = 0.9, (1.5, 6.0)
SHOWS_G2, TICKS_MIN = 0.002, 30
NOISE_LN = 0.05
"""The change of a load that chance alone shows."""
STILL_LEAST = 1e-4
LEARNED_MAX = 0.02
"""A tick at which the peers share more of a ln ratio is no part's own, and teaches nothing."""


class Feels(Protocol):
    """A machine that tells its peers what it feels, as its state has it (`own.py`)."""

    @property
    def felt(self) -> tuple[tuple[float, float], ...]:
        """Two figures of each signal: energy and usual² of a vibration, sum and weight of a load."""

    @property
    def felt_at(self) -> int:
        """Tick at which a vibration was last felt while the spindle stood."""

    @property
    def told_at(self) -> tuple[int, ...]:
        """Tick at which each signal was last told of in a cut."""


def felt_shares(tick_s: float) -> tuple[float, float]:
    """Return the shares of a new tick in what is felt of a vibration and of a load."""
    return 1.0 - exp(-tick_s / SHAKEN_S), 1.0 - exp(-tick_s / HARDER_S)


def felt(before: tuple[float, float], share: float, value: float, usual: float) -> tuple[float, float]:
    """Return E and the mean of usual², after one more reading of a vibration."""
    energy, quiet = before
    usual = usual * usual if usual > 0.0 else 0.0
    return energy + share * (value * value - usual - energy), quiet + share * (usual - quiet)


def harder_after(before: tuple[float, float], share: float, change: float, tells: float) -> tuple[float, float]:
    """Return the sum and the weight of what is felt of a load, after one more tick; change: times its weight."""
    total, weight = before
    return total + share * (change - total), weight + share * (tells - weight)


def shaken(peers: Sequence[Feels], at: int, oldest: int) -> float:
    """Return the energy that a machine may feel as its peers do, as the peers feel it; at: of the vibration among the signals."""
    total = weights = 0.0
    for peer in peers:
        if peer.felt_at >= oldest or peer.told_at[at] >= oldest:
            energy, quiet = peer.felt[at]
            spread = OF_USUAL * quiet + STILL_LEAST + (OF_FELT * energy if energy > 0.0 else 0.0)
            weight = 1.0 / (spread * spread)
            total += weight * energy
            weights += weight
    return total / weights if total > 0.0 else 0.0


def harder(peers: Sequence[Feels], at: int, oldest: int) -> float:
    """Return the change of the cut that peers share, ln; at: of the load among the signals."""
    fresh = [peer for peer in peers if peer.told_at[at] >= oldest and peer.felt[at][1] >= TOLD_MIN]
    changes = sorted([own_shift(peer.felt[at]) for peer in fresh])
    count = len(changes)
    if count == 2:
        changes = [0.5 * (changes[0] + changes[1])] * 2
    if not count:
        return 0.0
    return max(0.0, changes[(count - 1) // 2] - NOISE_LN) or min(0.0, changes[count // 2] + NOISE_LN)


def own_shift(felt: tuple[float, float]) -> float:
    """Return the change of the cut that a machine feels, ln."""
    return felt[0] / (felt[1] + LEAST_TOLD)


def gain_of(pairs: Sequence[tuple[float, float]]) -> float:
    """Return how many times as much a machine is shaken as its peers, from pairs of the energies that it and they feel.

    It is what nine in ten ticks stay below at which the peers feel something; SHAKEN_GAIN where there are too few of these.

    >>> gain_of([(0.09, 0.01)] * 40), gain_of([])
    (3.0, 2.0)
    """
    ratios = sorted([own / theirs for own, theirs in pairs if theirs > SHOWS_G2])
    if len(ratios) < TICKS_MIN:
        return SHAKEN_GAIN
    return round(min(GAINS[1], max(GAINS[0], sqrt(max(0.0, ratios[int(GAIN_QUANTILE * len(ratios))])))), 4)


def shift_of(energy: float, usual: float, floor: float) -> float:
    """Return by how much a shared energy raises the ln ratio of a vibration that is usually so large.

    >>> round(shift_of(0.04, 0.1, 0.05), 2)
    0.6
    """
    usual = usual if usual > 0.0 else 0.0
    return log((sqrt(usual * usual + energy) + floor) / (usual + floor))
