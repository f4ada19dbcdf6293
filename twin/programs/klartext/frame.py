"""From program to machine coordinates:

    machine = preset + datum shift + tool length + M (R (S (program)))

M is cycle 8 (mirror image), R cycle 10 (rotation, in the working plane), S cycles 11 and 26 (scaling). All three refer to the
datum in force. A control lets cycles 8 and 10 act in the order in which they were programmed; here the mirror is always outside.
"""

import math
from typing import Final

from twin.programs.canonical import Position
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings

PRESET_AT_START: Final = 1


class Frame:
    """All shifts and the turns, and the point arithmetic that follows from them.

    plain: it is nothing but `offset`
    """

    __slots__ = (
        "angle_deg",
        "centre",
        "cosine",
        "factors",
        "length_mm",
        "mirrored",
        "offset",
        "plain",
        "plane",
        "preset",
        "presets",
        "shift",
        "sine",
    )

    def __init__(self, settings: Settings) -> None:
        axes = len(settings.axes)
        self.presets = settings.work_offsets_mm
        self.preset: Position = self.presets.get(f"preset {PRESET_AT_START}", (0.0,) * axes)
        self.shift, self.length_mm, self.plane = [0.0] * axes, 0.0, 17
        self.mirrored: frozenset[int] = frozenset()
        self.factors, self.centre = [1.0] * axes, [0.0] * axes
        self.offset: Position = ()
        self.angle_deg, self.cosine, self.sine, self.plain = 0.0, 1.0, 0.0, True
        self.refresh()

    def refresh(self) -> None:
        """Bring the derived figures up to date after a change."""
        moved = [a + b for a, b in zip(self.preset, self.shift, strict=True)]
        moved[2] += self.length_mm
        self.offset = tuple(moved)
        quarter = self.angle_deg / 90.0
        if quarter.is_integer():
            self.cosine, self.sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
        else:
            self.cosine, self.sine = math.cos(math.radians(self.angle_deg)), math.sin(math.radians(self.angle_deg))
        self.plain = not self.mirrored and self.angle_deg == 0.0 and all(factor == 1.0 for factor in self.factors)

    def set_preset(self, number: int, word: str) -> None:
        """Cycle 247. RefusedError for a line that the preset table does not have; without a table all presets are zero."""
        name = f"preset {number}"
        known = any(one.startswith("preset") for one in self.presets)
        if known and name not in self.presets:
            raise RefusedError(word, f"the preset table has no line {number}; [control] work_offsets_mm sets {name!r}")
        self.preset = self.presets.get(name, (0.0,) * len(self.shift))
        self.refresh()

    def to_machine(self, program: Position) -> Position:
        """Machine coordinates of a point of the program."""
        if self.plain:
            return tuple(a + offset for a, offset in zip(program, self.offset, strict=True))
        moved = [c + (a - c) * factor for a, c, factor in zip(program, self.centre, self.factors, strict=True)]
        first, second, _ = PLANES[self.plane]
        a, b = moved[first], moved[second]
        moved[first], moved[second] = self.cosine * a - self.sine * b, self.sine * a + self.cosine * b
        for axis in self.mirrored:
            moved[axis] = -moved[axis]
        return tuple(a + offset for a, offset in zip(moved, self.offset, strict=True))

    def to_program(self, machine: Position) -> Position:
        """The inverse of `to_machine`."""
        moved = [a - offset for a, offset in zip(machine, self.offset, strict=True)]
        if self.plain:
            return tuple(moved)
        for axis in self.mirrored:
            moved[axis] = -moved[axis]
        first, second, _ = PLANES[self.plane]
        a, b = moved[first], moved[second]
        moved[first], moved[second] = self.cosine * a + self.sine * b, -self.sine * a + self.cosine * b
        return tuple(c + (a - c) / factor for a, c, factor in zip(moved, self.centre, self.factors, strict=True))

    def mirrors(self, plane: int) -> bool:
        """Return True where clockwise becomes counter-clockwise in that plane."""
        first, second, _ = PLANES[plane]
        return (first in self.mirrored) != (second in self.mirrored)

    def arc_scale(self, plane: int) -> float:
        """Return the factor by which a radius in that plane is longer. RefusedError where a circle would not stay one."""
        if self.angle_deg != 0.0 and plane != self.plane:
            raise RefusedError("", "an arc outside the working plane cannot be rotated by cycle 10; cancel it with ROT+0")
        first, second, _ = PLANES[plane]
        a, b = self.factors[first], self.factors[second]
        if not math.isclose(a, b, rel_tol=1e-9):
            raise RefusedError(
                "", f"cycle 26 scales the axes of this arc by {a:g} and {b:g}: it would be an ellipse; use equal ones"
            )
        return a
