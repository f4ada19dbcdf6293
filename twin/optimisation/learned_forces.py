"""The forces of a cut as the learned terms of a machine make them, over those without: sampled, since a table has no closed form.

Of a term the greatest is taken over all that a program does not tell (place, speed, time); over chip and depth it is sampled at
angles of a whole turn, and so that the force grows with the advance. A force in one direction adds to the resultant with all
that it has.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.learned.bounds import greatest, largest
from twin.learned.cutting import KNOWN, direction_of, sampled_forces
from twin.learned.section import LearnedSection
from twin.learned.standing import terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile, Tool
from twin.process.milling import tool_constants

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ADVANCES_MM = np.geomspace(1e-4, 2.0, 33)
BLOCK = 64
"""Cuts that are sampled at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class LearnedForces:
    """peak, tangential: (kinds, advances) over what they are without the terms; kind: (cuts,) of each cut

    push_n: that forces in one direction add to a resultant
    """

    peak: Floats
    tangential: Floats
    kind: Ints
    push_n: float

    @classmethod
    def of(
        cls, learned: Sequence[LearnedSection], cuts: Floats, tools: Sequence[Tool], tool: Ints,
        effects: tuple[str, ...], constants: Mapping[str, float],
    ) -> Self | None:  # fmt: skip
        """Return those of the cuts of a program; None where the machine has no such term. cuts: depth, entry, exit, (3, cuts)"""
        terms = terms_at(learned, (LearnedSite.CUT_FORCE,))
        if not terms:
            return None
        push_x, push_y = (sum((largest(t) for t in terms if direction_of(t.on) == direction), 0.0) for direction in ("x", "y"))
        specific = [greatest(term, KNOWN) for term in terms if not direction_of(term.on)]
        every: Floats = np.vstack([cuts, tool.astype(np.float64)])
        rows, kind = np.unique(np.round(every, 4), axis=1, return_inverse=True)
        peak, tangential = np.ones((2, rows.shape[1], len(ADVANCES_MM)))
        for index, own in enumerate(tools):
            mine = np.flatnonzero(rows[3] == index)
            for part in (mine[k : k + BLOCK] for k in range(0, len(mine) if specific else 0, BLOCK)):
                given = {**tool_constants(own), **constants}
                peak[part], tangential[part] = _ratios(specific, rows[:3, part], own.teeth, given, effects)
        return cls(peak, tangential, kind.reshape(-1).astype(np.int64), float(np.hypot(push_x, push_y)))

    def peaks_n(self, chosen: Ints, advance_mm: Floats, without_n: Floats) -> Floats:
        """Return the peaks of some cuts at advances from those without the terms, all (…, chosen)."""
        return np.asarray(without_n * _at(self.peak, self.kind[chosen], advance_mm) + np.where(without_n > 0.0, self.push_n, 0.0))

    def tangential_n(self, chosen: Ints, advance_mm: Floats, without_n: Floats) -> Floats:
        """Return the mean tangential forces likewise."""
        return np.asarray(without_n * _at(self.tangential, self.kind[chosen], advance_mm))


def _at(ratios: Floats, kind: Ints, advance_mm: Floats) -> Floats:
    """Ratios between the sampled advances, (…, chosen), along powers of the advance, so that what grows goes on growing."""
    place = np.interp(np.log(np.maximum(advance_mm, 1e-12)), np.log(ADVANCES_MM), np.arange(len(ADVANCES_MM)))
    below = np.minimum(place.astype(np.intp), len(ADVANCES_MM) - 2)
    part = place - below
    return np.asarray(ratios[kind, below] ** (1.0 - part) * ratios[kind, below + 1] ** part)


def _ratios(
    terms: Sequence[Term], cuts: Floats, teeth: int, constants: Mapping[str, ArrayLike], effects: tuple[str, ...]
) -> tuple[Floats, Floats]:
    """Peak and mean tangential force of cuts, (cuts, advances) each, over those without the terms."""
    each = [sampled_forces(terms, cuts, np.full(cuts.shape[1], a), teeth, constants, effects) for a in ADVANCES_MM]
    with_n, without_n = np.array(each).transpose(1, 2, 3, 0)  # (peak and tangential, cuts, advances) each
    growing = np.maximum.accumulate(np.maximum(with_n, 0.0), axis=-1)
    peak, tangential = growing / np.maximum(without_n, 1e-12)
    return peak, tangential


def learned_notes(machine: MachineFile) -> list[str]:
    """Return what the figures of an optimisation have and have not of the learned terms of a machine."""
    sites = {section.site for section in machine.learned if not section.is_recording}
    notes = []
    if sites & {LearnedSite.CUT_FORCE, LearnedSite.SPINDLE_POWER}:
        notes.append(
            "force and power have the learned terms in them: sampled, and the greatest where a program does not tell which"
        )
    if LearnedSite.PROGRAM_TIME in sites:
        notes.append("the learned term of the program's time is in the simulated times only: it tells no line from another")
    return notes
