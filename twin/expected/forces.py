"""The mean tangential force of each row of engagement, over the advance a tooth.

Without effects on the process it grows with the advance, F = c · f, and one figure of a row says all. With an edge force or a
size effect it is sampled at advances that stand for any feed, and interpolated along powers of the advance. Cuts that are alike
are worked out once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.effects.added import added_effects
from twin.engagement.along_path import PathRows
from twin.expected.expected import RATIOS
from twin.machine import MachineFile, Tool
from twin.motion.path import Path
from twin.optimisation.forces import mean_tangential_n, process_constants
from twin.process.kernel import process_quantities
from twin.process.milling import tool_constants

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
ADVANCES_MM = np.array([1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0])
UNIT_MM = 0.1
DIGITS = 4
BLOCK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class RowForces:
    """The forces of the rows of a path.

    rows: the engagement; kind: (rows,) which of the different cuts, −1 = cuts nothing; sampled_n: (kinds, advances)
    teeth: (rows,); horizontal: (segments,) part of the way that is horizontal, which the chip comes from
    is_linear: (kinds,) one figure says all
    """

    rows: PathRows
    kind: Ints
    sampled_n: Floats
    is_linear: NDArray[np.bool_]
    teeth: Ints
    horizontal: Floats

    def of_segment(self, segment: int, feed_mm_min: float, rpm: float) -> tuple[Floats, bool]:
        """Return the forces of the rows of a segment at RATIOS of a feed, (rows, ratios), and if all of them grow with it."""
        own = slice(int(self.rows.first[segment]), int(self.rows.first[segment + 1]))
        kind = self.kind[own]
        out = np.zeros((len(kind), len(RATIOS)))
        cuts = kind >= 0
        if not cuts.any() or rpm <= 0.0 or feed_mm_min <= 0.0:
            return out, True
        advance = np.outer(feed_mm_min * self.horizontal[segment] / (rpm * self.teeth[own][cuts]), RATIOS)
        linear = self.is_linear[kind[cuts]]
        straight = self.sampled_n[kind[cuts], 0][:, None] * advance
        out[cuts] = (
            straight if linear.all() else np.where(linear[:, None], straight, _between(self.sampled_n[kind[cuts]], advance))
        )
        return out, bool(linear.all())


def row_forces(machine: MachineFile, path: Path, rows: PathRows, tool: Ints, tools: Sequence[tuple[int, Tool]]) -> RowForces:
    """Return the forces of the engagement along a path. tool: (segments,) index into `tools`, −1 = not described."""
    of_row = tool[rows.segment]
    cuts = np.flatnonzero((rows.axial_depth_mm > 0.0) & (of_row >= 0))
    arcs = (rows.axial_depth_mm[cuts], rows.entry_angle_rad[cuts], rows.exit_angle_rad[cuts])
    table = np.column_stack([of_row[cuts].astype(np.float64), *(np.round(one, DIGITS) for one in arcs)])
    different, own = np.unique(table, axis=0, return_inverse=True)
    kind = np.full(len(rows.segment), -1, dtype=np.int64)
    kind[cuts] = own.reshape(-1)
    sampled, linear = np.zeros((len(different), len(ADVANCES_MM))), np.ones(len(different), dtype=np.bool_)
    for index, (number, one) in enumerate(tools):
        mine = np.flatnonzero(different[:, 0] == index)
        if len(mine):
            with_it = machine.with_tool(str(number))
            effects = tuple(added_effects(with_it, process_quantities()))
            linear[mine] = not effects
            constants = {**tool_constants(one), **process_constants(with_it)}
            for part in (mine[k : k + BLOCK] for k in range(0, len(mine), BLOCK)):
                cut = (different[part, 1], different[part, 2], different[part, 3])
                for k, advance in enumerate(ADVANCES_MM if effects else [UNIT_MM]):
                    force = mean_tangential_n(constants, effects, one.teeth, cut, np.full(len(part), advance))
                    sampled[part, k] = force if effects else force / UNIT_MM
    teeth = np.array([one.teeth for _, one in tools] + [1], dtype=np.int64)[of_row]
    return RowForces(rows, kind, sampled, linear, teeth, _horizontal(path))


def _horizontal(path: Path) -> Floats:
    """Return the part of the way of each segment that is horizontal, (segments,)."""
    segments = np.arange(len(path))
    start, end = path.tip_ends_mm(segments)
    up = np.abs(end[:, 2] - start[:, 2])
    length = np.maximum(path.length_mm, 1e-12)
    return np.asarray(np.sqrt(np.maximum(1.0 - (up / length) ** 2, 0.0)))


def _between(sampled_n: Floats, advance_mm: Floats) -> Floats:
    """Return the forces at advances, (cuts, ratios), along powers of the advance between those that were sampled."""
    known = np.log(ADVANCES_MM)
    place = np.clip(np.interp(np.log(np.maximum(advance_mm, 1e-9)), known, np.arange(len(known))), 0.0, len(known) - 1.0)
    below = np.minimum(place.astype(np.intp), len(known) - 2)
    part = place - below
    rows = np.arange(len(sampled_n))[:, None]
    low, high = np.maximum(sampled_n[rows, below], 1e-12), np.maximum(sampled_n[rows, below + 1], 1e-12)
    return np.asarray(low ** (1.0 - part) * high**part)
