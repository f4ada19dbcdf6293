r"""The oriented frequency response of a cut: what the vibration of a tooth period does to the force of the next, by frequency.

A displacement (u along the heading, l to its left) of the tool against where it was a tooth period ago thickens the chip of the
tooth at φ by u sin φ + l cos φ (twin/engagement says where φ counts from). With the force of twin/process/tooth.py, along
−F_t cos φ − F_r sin φ and across F_t sin φ − F_r cos φ on the tool, F_t = K_t b h, F_r = K_e F_t, that is ½ b K_t A(φ) (u, l),

    a_xx = −[sin 2φ + K_e (1 − cos 2φ)]      a_xy = −[(1 + cos 2φ) + K_e sin 2φ]
    a_yx =   (1 − cos 2φ) − K_e sin 2φ       a_yy =   sin 2φ − K_e (1 + cos 2φ)

(x along, y to the left). Its mean over a turn is A0 = N / 2π ∫ A dφ from entry to exit; zero order keeps nothing else (Altintas &
Budak, CIRP Annals 44(1), 1995, 357–362, with the same signs; Altintas, Manufacturing Automation, 2nd ed., ch. 4). Turned into
machine axes and set on the modes of the tool, it is at the limit of stability when det(I − ½ b K_t (1 − e^{−iωT}) A0 G(iω)) = 0.
That is, λ being an eigenvalue of A0 G and T the tooth period,

    b = 1 / (K_t Re λ),    ωT = π + 2 arg λ + 2πk,    k = 0, 1, …    where Re λ > 0

for 1 / (1 − e^{−iε}) = ½ (1 − i cot ε/2). Both eigenvalues count: one direction chatters through the other.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.machine import Mode

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

NODES_BY_MODE = 160
NODES_BETWEEN = 60
SMALLEST_PART = 1e-9
"""of the largest eigenvalue: less than this is rounding, not a response."""


@dataclass(frozen=True, slots=True)
class ChatterCut:
    """The cut, and how the tool stands in it.

    entry_angle_rad, exit_angle_rad: of the engaged arc, as in twin/engagement, from the left of the heading in the sense in which
    the tool turns (M3); a slot is 0 to π, entry = exit cuts nothing, an exit before the entry goes through 2π
    heading_rad: of the feed in machine coordinates; 0 = towards +x, π/2 = towards +y. For M4 give −heading and the angles in the
    sense in which the tool then turns: the picture is mirrored, and modes in x and y mirror into themselves
    """

    teeth: int
    tangential_coefficient_n_per_mm2: float
    radial_ratio: float
    entry_angle_rad: float
    exit_angle_rad: float
    heading_rad: float = 0.0


def directional_matrix(cut: ChatterCut) -> Floats:
    """A0 in machine axes, (2, 2).

    A slot with four teeth: two are in the cut at any time, −K_e each along and across, ∓1 from one to the other.

    >>> directional_matrix(ChatterCut(4, 900.0, 0.4, 0.0, math.pi)).round(12).tolist()
    [[-0.8, -2.0], [2.0, -0.8]]
    """
    width = cut.exit_angle_rad - cut.entry_angle_rad
    width = width + 2.0 * math.pi if width < 0.0 else width
    ratio = cut.radial_ratio
    ends = 2.0 * np.array([cut.entry_angle_rad, cut.entry_angle_rad + width])
    sine, cosine = (0.5 * float(values[1] - values[0]) for values in (np.sin(ends), np.cos(ends)))
    mean = (cut.teeth / (2.0 * math.pi)) * np.array(
        [
            [cosine - ratio * width + ratio * sine, -width - sine + ratio * cosine],
            [width - sine + ratio * cosine, -cosine - ratio * width - ratio * sine],
        ]
    )
    u, l = math.cos(cut.heading_rad), math.sin(cut.heading_rad)  # noqa: E741 - the letters of the docstring
    turn = np.array([[u, -l], [l, u]])
    matrix: Floats = turn @ mean @ turn.T
    return matrix


def tip_response(modes: Sequence[Mode], frequency_rad_s: Floats) -> Complexes:
    """G of the tip in x and y, (2, frequencies), mm/N.

    >>> mode = Mode(direction="x", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)
    >>> tip_response([mode], np.array([0.0]))[:, 0].real.tolist()
    [0.000125, 0.0]
    """
    response = np.zeros((2, len(frequency_rad_s)), dtype=np.complex128)
    for mode in modes:
        r = frequency_rad_s / (2.0 * math.pi * mode.frequency_hz)
        response["xy".index(mode.direction)] += 1.0 / (mode.stiffness_n_per_mm * (1.0 - r * r + 2j * mode.damping_ratio * r))
    return response


def eigenvalues(matrix: Floats, response: Complexes) -> Complexes:
    """Return the eigenvalues of A0 G, (2, frequencies), in no order; exactly 0 where one direction does not give way."""
    half = 0.5 * (matrix[0, 0] * response[0] + matrix[1, 1] * response[1])
    product = (matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]) * response[0] * response[1]
    root = np.sqrt(half * half - product)
    larger = half + np.where((half.conj() * root).real < 0.0, -root, root)
    other = np.divide(product, larger, out=np.zeros_like(larger), where=larger != 0.0)
    return np.stack([larger, other])


class Oriented(NamedTuple):
    """Both eigenvalues of A0 G, each followed along the frequency.

    frequency_rad_s: (nodes,) from 0 upwards; eigenvalue: (2, nodes), mm/N
    """

    modes: tuple[Mode, ...]
    matrix: Floats
    frequency_rad_s: Floats
    eigenvalue: Complexes

    @classmethod
    def of(cls, modes: Sequence[Mode], cut: ChatterCut, shortest_period_s: float) -> "Oriented":
        """On nodes that are dense at each mode and thin out with the distance from it, up to two waves in a tooth period."""
        natural = np.array([2.0 * math.pi * mode.frequency_hz for mode in modes])
        top = max(4.0 * float(natural.max()), 4.0 * math.pi / shortest_period_s)
        width = natural * np.array([mode.damping_ratio for mode in modes])
        furthest = np.arcsinh(np.maximum(natural, top - natural) / width)
        near = (natural[:, None] + width[:, None] * np.sinh(furthest[:, None] * np.linspace(-1.0, 1.0, NODES_BY_MODE))).ravel()
        wide = np.geomspace(0.05 * float(natural.min()), top, NODES_BETWEEN)
        frequency = np.unique(np.concatenate([[0.0], wide, near[(near > 0.0) & (near < top)]]))
        matrix = directional_matrix(cut)
        return cls(tuple(modes), matrix, frequency, _followed(eigenvalues(matrix, tip_response(modes, frequency))))

    def least_gain(self) -> float:
        """Below this a real part is rounding; mm/N."""
        return SMALLEST_PART * float(np.abs(self.eigenvalue).max())

    def exact(self, branch: int | Ints, frequency_rad_s: Floats) -> Complexes:
        """The eigenvalue of the branch (0 or 1, of each frequency or of all) between its nodes."""
        both = eigenvalues(self.matrix, tip_response(self.modes, frequency_rad_s))
        nodes, (first, second) = self.frequency_rad_s, self.eigenvalue
        if isinstance(branch, int):
            near = np.interp(frequency_rad_s, nodes, self.eigenvalue[branch])
        else:
            near = np.where(branch == 0, np.interp(frequency_rad_s, nodes, first), np.interp(frequency_rad_s, nodes, second))
        values: Complexes = np.where(np.abs(both[0] - near) <= np.abs(both[1] - near), both[0], both[1])
        return values


def _followed(pair: Complexes) -> Complexes:
    """The two sorted so that each goes on smoothly from one frequency to the next."""
    kept = np.abs(np.diff(pair, axis=1)).sum(axis=0)
    crossed = np.abs(pair[:, 1:] - pair[::-1, :-1]).sum(axis=0)
    swapped = np.concatenate([[False], np.cumsum(crossed < kept) % 2 == 1])
    return np.where(swapped, pair[::-1], pair)
