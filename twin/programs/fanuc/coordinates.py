"""From program to machine coordinates:

    machine = external + work + g92 + local + tool length + R (S (program))

S is G51 (about its centre, a factor an axis, negative = mirror), R is G68 (in its plane, about its centre). FANUC B-64604EN
(operator's manual, machining centre), chapters "coordinate system", "scaling", "coordinate system rotation", whose order this is.
"""

import math
from typing import NamedTuple

from twin.programs.canonical import Position
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

EXTENDED_MAX = 48


class Scaling(NamedTuple):
    centre: Position
    factors: Position


class Rotation(NamedTuple):
    plane: int
    centre: tuple[float, float]
    angle_deg: float
    cosine: float
    sine: float


class Coordinates:
    """All offsets, and the point arithmetic that follows from them. `offset` is the whole translation, `plain` = nothing else."""

    __slots__ = ("axes", "external", "g92", "local", "offset", "plain", "rotation", "scaling", "tool", "work", "work_name")

    def __init__(self, settings: Settings) -> None:
        self.axes = len(settings.axes)
        self.work = {name: list(position) for name, position in settings.work_offsets_mm.items()}
        self.external = self.work.pop("external", [0.0] * self.axes)
        for name in [f"G{code}" for code in range(54, 60)]:
            self.work.setdefault(name, [0.0] * self.axes)
        self.work_name = "G54"
        self.g92, self.local, self.tool = [0.0] * self.axes, [0.0] * self.axes, [0.0] * self.axes
        self.scaling: Scaling | None = None
        self.rotation: Rotation | None = None
        self.offset: Position = ()
        self.plain = True
        self.refresh()

    def refresh(self) -> None:
        """Bring the derived figures up to date after a change of any offset."""
        parts = (self.external, self.offsets(self.work_name), self.g92, self.local, self.tool)
        self.offset = tuple(map(sum, zip(*parts, strict=True)))
        self.plain = self.scaling is None and self.rotation is None

    def offsets(self, name: str) -> list[float]:
        """The work offset of that name; an extended one that was never set is zero."""
        return self.work.setdefault(name, [0.0] * self.axes)

    def linear(self, vector: Position) -> Position:
        """S and R on a vector: the part without any offset."""
        moved = list(vector)
        if self.scaling is not None:
            moved = [a * factor for a, factor in zip(moved, self.scaling.factors, strict=True)]
        if self.rotation is not None:
            first, second, _ = PLANES[self.rotation.plane]
            a, b, c, s = moved[first], moved[second], self.rotation.cosine, self.rotation.sine
            moved[first], moved[second] = c * a - s * b, s * a + c * b
        return tuple(moved)

    def to_machine(self, program: Position) -> Position:
        """Machine coordinates of a point of the program."""
        moved = list(program)
        if self.scaling is not None:
            triples = zip(moved, self.scaling.centre, self.scaling.factors, strict=True)
            moved = [centre + (a - centre) * factor for a, centre, factor in triples]
        if self.rotation is not None:
            first, second, _ = PLANES[self.rotation.plane]
            centre_a, centre_b = self.rotation.centre
            a, b, c, s = moved[first] - centre_a, moved[second] - centre_b, self.rotation.cosine, self.rotation.sine
            moved[first], moved[second] = centre_a + c * a - s * b, centre_b + s * a + c * b
        return tuple(a + offset for a, offset in zip(moved, self.offset, strict=True))

    def to_program(self, machine: Position) -> Position:
        """The inverse of `to_machine`."""
        moved = [a - offset for a, offset in zip(machine, self.offset, strict=True)]
        if self.rotation is not None:
            first, second, _ = PLANES[self.rotation.plane]
            centre_a, centre_b = self.rotation.centre
            a, b, c, s = moved[first] - centre_a, moved[second] - centre_b, self.rotation.cosine, self.rotation.sine
            moved[first], moved[second] = centre_a + c * a + s * b, centre_b - s * a + c * b
        if self.scaling is not None:
            triples = zip(moved, self.scaling.centre, self.scaling.factors, strict=True)
            moved = [centre + (a - centre) / factor for a, centre, factor in triples]
        return tuple(moved)

    def mirrors(self, plane: int) -> bool:
        """Return True where S turns clockwise into counter-clockwise in that plane."""
        if self.scaling is None:
            return False
        first, second, _ = PLANES[plane]
        return self.scaling.factors[first] * self.scaling.factors[second] < 0

    def arc_scale(self, plane: int) -> float:
        """Return the factor by which a radius in that plane is longer. RefusedError where a circle would not stay one."""
        if self.rotation is not None and self.rotation.plane != plane:
            raise RefusedError("", f"an arc in G{plane} cannot be rotated by G68 of G{self.rotation.plane}; cancel with G69")
        if self.scaling is None:
            return 1.0
        first, second, _ = PLANES[plane]
        a, b = abs(self.scaling.factors[first]), abs(self.scaling.factors[second])
        if not math.isclose(a, b, rel_tol=1e-9):
            raise RefusedError("", f"G51 scales the axes of this arc by {a:g} and {b:g}: it would be an ellipse; use equal ones")
        return a


def rotation(plane: int, centre: tuple[float, float], angle_deg: float) -> Rotation:
    """G68, exact at the quarter turns."""
    quarter = angle_deg / 90.0
    if quarter.is_integer():
        cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    return Rotation(plane, centre, angle_deg, cosine, sine)
