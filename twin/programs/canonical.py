"""Canonical moves: what a part program asks of a machine, with no dialect left in it.

All lengths are in mm, feeds in mm/min, in machine coordinates: work offset, tool length and cutter compensation are in. Rotary
axes, where configured, follow in degrees. The idea is that of the canonical machining functions of RS274/NGC (NIST IR 6556).

The first field of each is `line`, the 0-based index of its source line in the main text (as recorders count blocks). Every
one has `program`: None in the main text; in a subprogram that has a text of its own its name, and `line` counts in that text.
"""

from typing import NamedTuple

Position = tuple[float, ...]
"""One number an axis in the order of `Settings.axes`: mm, rotary axes in degrees."""


class Rapid(NamedTuple):
    """G0: straight to `end_mm` as fast as the axes can."""

    line: int
    end_mm: Position
    program: str | None = None


class Linear(NamedTuple):
    """A straight cut to `end_mm`.

    feed_mm_min: along the path, resolved from G93, G94 or G95
    feed_per_rev_mm: the programmed feed where the move is tied to the spindle (G95, tapping, threads), else None
    """

    line: int
    end_mm: Position
    feed_mm_min: float
    feed_per_rev_mm: float | None = None
    program: str | None = None


class Arc(NamedTuple):
    """A circular or helical cut.

    centre_mm: x, y, z of the centre; its coordinate out of the plane is that of the start
    plane: 17, 18 or 19
    sweep_rad: + counter-clockwise seen from the plane's positive normal; beyond 2π for several turns
    feed_mm_min: along the helix
    feed_ratio: the feed of the tool's centre over the F word, where the control keeps F at the contour (CFC, M109)
    """

    line: int
    end_mm: Position
    centre_mm: tuple[float, float, float]
    plane: int
    sweep_rad: float
    feed_mm_min: float
    feed_per_rev_mm: float | None = None
    program: str | None = None
    feed_ratio: float = 1.0


class Dwell(NamedTuple):
    """G4, and the pauses of cycles."""

    line: int
    seconds: float
    program: str | None = None


class ToolChange(NamedTuple):
    """M6: `tool` is in the spindle afterwards; 0 = none."""

    line: int
    tool: int
    program: str | None = None


class Spindle(NamedTuple):
    """The commanded speed, rev/min, and direction: +1 clockwise (M3), -1 counter-clockwise (M4), 0 stopped (M5)."""

    line: int
    rpm: float
    direction: int
    program: str | None = None


class SpindleOrient(NamedTuple):
    """M19, and the oriented stop of G76 and G87: the spindle stands at its angle afterwards."""

    line: int
    program: str | None = None


class Coolant(NamedTuple):
    """M7, M8: on; M9: off."""

    line: int
    on: bool
    program: str | None = None


class ProgramStop(NamedTuple):
    """M0, and M1 (`optional`) where the switch is on: waits for cycle start."""

    line: int
    optional: bool
    program: str | None = None


class ProgramEnd(NamedTuple):
    """M2, M30."""

    line: int
    program: str | None = None


class ExactStop(NamedTuple):
    """G61 (on) and G64 (off); G9 comes as on before and off after its one move."""

    line: int
    on: bool
    program: str | None = None


class ToolLength(NamedTuple):
    """The length in force along z, mm (negative: G44): from the end of the next move on, which contains it."""

    line: int
    length_mm: float
    program: str | None = None


class LookAhead(NamedTuple):
    """G5.1 Q1 and G8 P1 (on), G5.1 Q0 and G8 P0 (off)."""

    line: int
    on: bool
    program: str | None = None


class Tolerance(NamedTuple):
    """The contour tolerance from here on: how far the control may leave the programmed path to run it smoothly.

    HEIDENHAIN cycle 32, SINUMERIK CYCLE832, G64x with ADIS and CTOL. None = back to what the machine does by itself.
    rotary_deg: the same for rotary axes
    """

    line: int
    contour_mm: float | None
    rotary_deg: float | None = None
    program: str | None = None


class JerkLimit(NamedTuple):
    """SOFT (limited) and BRISK (not): the machine's jerk limit from here on, or none."""

    line: int
    limited: bool
    program: str | None = None


class FeedForward(NamedTuple):
    """FFWON and FFWOF: the feed-forward of the servo loops."""

    line: int
    on: bool
    program: str | None = None


Motion = Rapid | Linear | Arc
"""A canonical move that moves axes."""

Move = (
    Motion
    | Dwell
    | ToolChange
    | Spindle
    | SpindleOrient
    | Coolant
    | ProgramStop
    | ProgramEnd
    | ExactStop
    | LookAhead
    | ToolLength
    | Tolerance
    | JerkLimit
    | FeedForward
)
"""Any canonical move."""
