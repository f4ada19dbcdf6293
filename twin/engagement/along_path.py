"""The engagement along the path of a program: every segment cut into rows, tool after tool, from the same workpiece.

Arcs are followed by chords of at most RESOLUTION_MM; a line is cut into rows by the engagement itself. It depends on neither feed
nor speed, so it is worked out once for a path.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.engagement.engaged import Collision, Engagement
from twin.engagement.removal import cut
from twin.engagement.workpiece import Workpiece
from twin.errors import EngagementError, MachineError
from twin.machine import Stock
from twin.motion.path import Kind, Path

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
RESOLUTION_MM = 0.25
ROWS_MAX = 2_000_000
CELLS_PER_DIAMETER = 16.0
NO_ROWS: Ints = np.empty(0, dtype=np.int64)


class Section(NamedTuple):
    """Segments `first` up to before `stop` are travelled by a tool of this diameter; 0 = by nothing that cuts."""

    first: int
    stop: int
    tool_diameter_mm: float


@dataclass(frozen=True, slots=True)
class PathRows:
    """The rows of a path. segment: (rows,) the path's own; first: (segments + 1,) rows of segment i are first[i] … first[i + 1].

    Rows of one segment are of one length. The other fields are as of `Engagement`, (rows,); collisions count the path's segments.
    """

    first: Ints
    segment: Ints
    axial_depth_mm: Floats
    entry_angle_rad: Floats
    exit_angle_rad: Floats
    length_mm: Floats
    end_face_mm2: Floats
    collisions: tuple[Collision, ...]

    def lines_met(self, path: Path) -> frozenset[int]:
        """The lines of the path that feed into material, by the side of the tool or by its end."""
        inside = (self.axial_depth_mm > 0.0) | (self.end_face_mm2 > 0.0)
        met = self.segment[inside & (path.kind[self.segment] != Kind.RAPID)]
        return frozenset(path.line[met].tolist())

    def row_at(self, segment: Ints, part: Floats) -> Ints:
        """The row at that part (0 … 1) of each segment."""
        count = self.first[segment + 1] - self.first[segment]
        inside = np.minimum((part * count).astype(np.int64), count - 1)
        return np.asarray(self.first[segment] + inside)


def engaged_along(path: Path, stock: Stock, sections: Sequence[Section]) -> PathRows:
    """The engagement of all sections of a path (in order, covering it), from a whole stock on.

    Raises MachineError where the path is too long to follow, EngagementError where a section cannot be cut.
    """
    if path.axes[:3] != ("x", "y", "z"):
        raise EngagementError(f"the axes of the path are {', '.join(path.axes)}; a workpiece needs x, y, z first")
    chords = np.maximum(1, np.ceil(path.length_mm / RESOLUTION_MM)).astype(np.int64)
    if chords.sum() > ROWS_MAX:
        raise MachineError(f"the path is {path.length_mm.sum():.0f} mm long, too long to follow in steps of {RESOLUTION_MM} mm")
    chords[(path.sweep_rad == 0.0) | (path.length_mm == 0.0)] = 1
    parts: list[PathRows] = []
    workpiece: Workpiece | None = None
    for section in sections:
        if section.stop <= section.first:
            continue
        if section.tool_diameter_mm <= 0.0:
            parts.append(_nothing(section))
            continue
        if workpiece is None:
            workpiece = Workpiece.of(stock, section.tool_diameter_mm / CELLS_PER_DIAMETER)
        workpiece, rows = _section(path, chords, workpiece, section)
        parts.append(rows)
    return _joined(parts, len(path))


def _section(path: Path, chords: Ints, workpiece: Workpiece, section: Section) -> tuple[Workpiece, PathRows]:
    """One section cut; its rows count their segments as the path does."""
    count = chords[section.first : section.stop]
    segment = np.repeat(np.arange(section.first, section.stop), count)
    before = np.concatenate([[0], np.cumsum(count)])
    part = (np.arange(len(segment)) - before[segment - section.first] + 1) / count[segment - section.first]
    points = np.concatenate(
        [path.tip_ends_mm(np.array([section.first]))[0], path.tip_at(segment, part * path.length_mm[segment])]
    )
    feeding = path.kind[segment] != Kind.RAPID
    left, rows = cut(workpiece, points, section.tool_diameter_mm, RESOLUTION_MM, feeding)
    own = segment[rows.segment]
    hits = tuple(Collision(int(segment[hit.segment]), hit.path_mm, hit.position_mm) for hit in rows.collisions)
    return left, _rows(own, rows, hits)


def _rows(own: Ints, rows: Engagement, hits: tuple[Collision, ...]) -> PathRows:
    arc = rows.entry_angle_rad, rows.exit_angle_rad
    return PathRows(NO_ROWS, own, rows.axial_depth_mm, *arc, rows.length_mm, rows.end_face_mm2, hits)


def _nothing(section: Section) -> PathRows:
    zero = np.zeros(section.stop - section.first)
    return PathRows(NO_ROWS, np.arange(section.first, section.stop), zero, zero, zero, zero, zero, ())


def _joined(parts: Sequence[PathRows], segments: int) -> PathRows:
    fields = ("segment", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "length_mm", "end_face_mm2")
    empty: list[NDArray[np.generic]] = [np.empty(0)]
    joined = {name: np.concatenate([getattr(part, name) for part in parts] or empty) for name in fields}
    segment = joined.pop("segment").astype(np.int64)
    first = np.searchsorted(segment, np.arange(segments + 1))
    return PathRows(first=first, segment=segment, collisions=tuple(hit for part in parts for hit in part.collisions), **joined)
