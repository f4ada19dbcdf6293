"""The engagement along a path: a table of rows."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.engagement.sweep import Floats

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


class Collision(NamedTuple):
    """A rapid move meets material: its segment, and of the first row that does so the distance along the path and the place."""

    segment: int
    path_mm: float
    position_mm: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Engagement:
    """Rows (arrays of one length) along a path, each for a piece of it, as it is in the middle of the piece. mm and rad.

    first_row: (segments + 1,) segment i owns the rows first_row[i] to first_row[i + 1], all of one length
    segment: index of the segment, from points i to i + 1
    start_mm, length_mm: of the piece along the path; position_mm: (rows, 3) its middle
    axial_depth_mm, entry_angle_rad, exit_angle_rad: as in a run log; all 0 where the rim meets nothing
    section_mm2: of the chip across the feed, R ∫ a(φ) sin φ dφ = a_e a_p; times the feed it is the removal rate
    deepest_mm: largest depth on the rim; arcs: number of separate arcs on it
    exact: one arc of one depth (or none); else depth and angles are those of the rectangle that stands for it (rectangle.py)
    end_face_mm2: part of the end face that goes down into material: ramps and plunges
    removed_mm3: what the piece takes away, by rim and end face
    collisions: the first of each rapid segment
    """

    first_row: Ints
    segment: Ints
    start_mm: Floats
    length_mm: Floats
    position_mm: Floats
    axial_depth_mm: Floats
    entry_angle_rad: Floats
    exit_angle_rad: Floats
    section_mm2: Floats
    deepest_mm: Floats
    arcs: Ints
    exact: Flags
    end_face_mm2: Floats
    removed_mm3: Floats
    collisions: tuple[Collision, ...]

    def __len__(self) -> int:
        return len(self.segment)

    @property
    def engaged(self) -> Flags:
        """The rim cuts."""
        return self.arcs > 0

    @property
    def plunging(self) -> Flags:
        """The end face cuts."""
        return self.end_face_mm2 > 0.0
