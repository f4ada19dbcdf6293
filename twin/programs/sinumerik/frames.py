"""From the coordinates of the program to those of the machine:

    machine = basic offset + settable offset (G54 …) + programmable frame (point) + tool length

The programmable frame is a matrix and a translation. TRANS, ROT, SCALE and MIRROR begin it again; ATRANS, AROT, ASCALE and
AMIRROR act in the coordinates that it has made so far. Several angles of one ROT turn about Z, then the new Y, then the new X
("Fundamentals", chapter "Coordinate transformations (frames)").
"""

import math
from typing import Final, NamedTuple

from twin.programs.canonical import Position
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

Row = tuple[float, float, float]
Matrix = tuple[Row, Row, Row]
IDENTITY: Final[Matrix] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
SCALE_MAX: Final = 1e5
FLAT: Final = 1e-9
"""Rounding of a rotation: far below the least increment at any machine's size."""


class Frame(NamedTuple):
    """point → matrix · point + shift; shift has one figure an axis, the matrix turns x, y and z."""

    matrix: Matrix
    shift: Position


def times(a: Matrix, b: Matrix) -> Matrix:
    rows = [tuple(sum(row[k] * b[k][column] for k in range(3)) for column in range(3)) for row in a]
    return ((rows[0][0], rows[0][1], rows[0][2]), (rows[1][0], rows[1][1], rows[1][2]), (rows[2][0], rows[2][1], rows[2][2]))


def turned(matrix: Matrix, vector: Position) -> Position:
    """`matrix` on the first three figures; the others stay."""
    a, b, c = vector[:3]
    return (*(row[0] * a + row[1] * b + row[2] * c for row in matrix), *vector[3:])


def inverse(m: Matrix) -> Matrix:
    """The inverse by the adjugate; a frame is never singular, since SCALE has bounds."""
    cofactors = [
        [m[(i + 1) % 3][(j + 1) % 3] * m[(i + 2) % 3][(j + 2) % 3] - m[(i + 1) % 3][(j + 2) % 3] * m[(i + 2) % 3][(j + 1) % 3]
         for i in range(3)]
        for j in range(3)
    ]  # fmt: skip
    determinant = sum(m[0][k] * cofactors[k][0] for k in range(3))
    rows = [tuple(figure / determinant for figure in row) for row in cofactors]
    return ((rows[0][0], rows[0][1], rows[0][2]), (rows[1][0], rows[1][1], rows[1][2]), (rows[2][0], rows[2][1], rows[2][2]))


def sine_cosine(angle_deg: float) -> tuple[float, float]:
    """Exact at the quarter turns."""
    quarter = angle_deg / 90.0
    if quarter.is_integer():
        return ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))[int(quarter) % 4]
    return math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))


def rotation(axis: int, angle_deg: float) -> Matrix:
    """Counter-clockwise about an axis, seen from its positive end.

    >>> turned(rotation(2, 90.0), (1.0, 0.0, 5.0))
    (0.0, 1.0, 5.0)
    """
    sine, cosine = sine_cosine(angle_deg)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rows = [list(row) for row in IDENTITY]
    rows[first][first], rows[first][second] = cosine, -sine
    rows[second][first], rows[second][second] = sine, cosine
    return ((rows[0][0], rows[0][1], rows[0][2]), (rows[1][0], rows[1][1], rows[1][2]), (rows[2][0], rows[2][1], rows[2][2]))


def diagonal(factors: list[float]) -> Matrix:
    return ((factors[0], 0.0, 0.0), (0.0, factors[1], 0.0), (0.0, 0.0, factors[2]))


class Frames:
    """All offsets and frames, and the point arithmetic that follows from them. suppress: 0 = all, 1 = G53, 2 = G153 and SUPA."""

    __slots__ = ("axes", "basic", "program", "settable", "settable_name", "suppress", "tool")

    def __init__(self, settings: Settings) -> None:
        self.axes = len(settings.axes)
        self.settable = {name: list(position) for name, position in settings.work_offsets_mm.items()}
        self.basic = tuple(self.settable.pop("external", [0.0] * self.axes))
        self.settable_name = "G500"
        self.tool = [0.0] * self.axes
        self.program = Frame(IDENTITY, (0.0,) * self.axes)
        self.suppress = 0

    def offsets(self, name: str) -> list[float]:
        """The settable offset of that name; one that was never set is zero, and so is G500."""
        return self.settable.setdefault(name, [0.0] * self.axes)

    def reset(self) -> None:
        """Delete the programmable frame."""
        self.program = Frame(IDENTITY, (0.0,) * self.axes)

    def add(self, matrix: Matrix, shift: Position) -> None:
        """Let one more frame act in the coordinates of those so far."""
        before = self.program
        moved = turned(before.matrix, shift)
        self.program = Frame(times(before.matrix, matrix), tuple(a + b for a, b in zip(moved, before.shift, strict=True)))

    def fixed(self) -> Position:
        """The translation outside the programmable frame: basic and settable offset and the tool."""
        basic = self.basic if self.suppress < 2 else (0.0,) * self.axes
        settable = self.offsets(self.settable_name) if self.suppress < 1 else [0.0] * self.axes
        return tuple(a + b + c for a, b, c in zip(basic, settable, self.tool, strict=True))

    def to_machine(self, point: Position) -> Position:
        """Machine coordinates of a point of the program."""
        if self.suppress:
            return tuple(a + b for a, b in zip(point, self.fixed(), strict=True))
        moved = turned(self.program.matrix, point)
        return tuple(a + b + c for a, b, c in zip(moved, self.program.shift, self.fixed(), strict=True))

    def to_program(self, machine: Position) -> Position:
        """The inverse of `to_machine`."""
        if self.suppress:
            return tuple(a - b for a, b in zip(machine, self.fixed(), strict=True))
        moved = tuple(a - b - c for a, b, c in zip(machine, self.fixed(), self.program.shift, strict=True))
        return moved if self.program.matrix == IDENTITY else turned(inverse(self.program.matrix), moved)

    def vector(self, vector: Position) -> Position:
        """The frame on a vector: the part without any translation."""
        return vector if self.suppress else turned(self.program.matrix, vector)

    def is_flat(self, plane: int) -> bool:
        """Return True where the frame keeps the plane: what is level in the program is level in the machine."""
        first, second, normal = PLANES[plane]
        m = self.program.matrix
        return bool(self.suppress) or all(
            abs(figure) < FLAT for figure in (m[normal][first], m[normal][second], m[first][normal], m[second][normal])
        )

    def mirrors(self, plane: int) -> bool:
        """Return True where the frame turns clockwise into counter-clockwise in that plane."""
        if self.suppress:
            return False
        first, second, _ = PLANES[plane]
        m = self.program.matrix
        return m[first][first] * m[second][second] - m[first][second] * m[second][first] < 0.0

    def arc_scale(self, plane: int, text: str) -> float:
        """Return the factor by which a radius in that plane is longer. RefusedError where a circle would not stay one there."""
        if self.suppress:
            return 1.0
        if not self.is_flat(plane):
            raise RefusedError(text, f"the frame tilts G{plane}: arcs, corners and cycles there need ROT about its normal only")
        first, second, _ = PLANES[plane]
        m = self.program.matrix
        one, other = math.hypot(m[first][first], m[second][first]), math.hypot(m[first][second], m[second][second])
        square = m[first][first] * m[first][second] + m[second][first] * m[second][second]
        if not math.isclose(one, other, rel_tol=1e-9) or abs(square) > FLAT * one * other:
            raise RefusedError(text, f"SCALE scales the axes of G{plane} by {one:g} and {other:g}: a circle would be an ellipse")
        return one
