"""The settings of a control before the first block: axes, offsets, switches, and the parameters that change a meaning."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from twin.errors import TwinError
from twin.programs.canonical import Position

WORK_NAME: Final = re.compile(
    r"external|G5[4-9]|G54\.1 P([1-9]|[1-3][0-9]|4[0-8])"  # FANUC
    r"|G50[5-9]|G5[1-9][0-9]"  # SINUMERIK
    r"|(preset|datum) [0-9]{1,4}"  # HEIDENHAIN: preset table, datum table
)
PARAMETER_NAME: Final = re.compile(r"(Q[LRS]?|R)[0-9]{1,4}")


class IntegerWords(StrEnum):
    """The meaning of a length without a decimal point (FANUC parameter 3401#0, DPI)."""

    UNITS = "units"
    """`X100` is 100 mm (DPI = 1, "calculator type")."""
    INCREMENTS = "increments"
    """`X100` is 100 least increments, 0.1 mm (DPI = 0)."""


class DwellUnit(StrEnum):
    """The unit of P in G4 and in cycles."""

    MILLISECONDS = "ms"
    SECONDS = "s"
    """As LinuxCNC reads it."""


class OutsideCorner(StrEnum):
    """The way of a compensated path round an outside corner (FANUC parameter 19607#2, CCC)."""

    LINE = "line"
    """Up to the crossing of the tangents; round a corner sharper than 90° in a straight line between two points (CCC = 0)."""
    ARC = "arc"
    """On an arc about the corner (CCC = 1; LinuxCNC; SINUMERIK G450)."""
    CROSSING = "crossing"
    """Up to where the parallels cross; on an arc where they do not, and round a corner sharper than 100° (SINUMERIK G451)."""


class LeadIn(StrEnum):
    """The end of the first compensated block (FANUC parameter 5003#0, SUP)."""

    NEXT = "next"
    """Beside the start of the next block, square to it (type A)."""
    OWN = "own"
    """Beside its own end, square to itself; the corner to the next block is then like any other (LinuxCNC; like type B)."""


class OffsetLookup(StrEnum):
    """The offset that G43, G41 and G42 take where their block has no H or D."""

    WORD = "word"
    """That of the last H or D; none = offset 0 (FANUC)."""
    TOOL = "tool"
    """That of the tool in the spindle (LinuxCNC)."""


@dataclass(frozen=True, slots=True)
class ToolOffset:
    """One line of the offset table (memory C): what H and D name. Geometry and wear add up; `radius` is a radius."""

    length_mm: float = 0.0
    radius_mm: float = 0.0
    length_wear_mm: float = 0.0
    radius_wear_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that is not in the program text. The defaults are those of a FANUC mill with three axes.

    dialect: name of the language of the text; None = told from the text

    axes: "x", "y", "z" first; then rotary axes out of "a", "b", "c"
    start_mm: machine position at the start; empty = all zero
    inch: G20 at the start instead of G21
    work_offsets_mm: "G54" … "G59", "G54.1 P1" … "G54.1 P48" and "external" (FANUC), "G54" … "G57", "G505" … "G599" (SINUMERIK),
        "preset 1" and "datum 1" (lines of the preset and of the datum table, HEIDENHAIN); one number an axis
    tool_offsets: by the number that H and D name (FANUC), or that of the tool; where there is no table at all, lengths are 0
        (the moves are those of the tool's tip) and a radius is an error
    references_mm: machine positions of G28 and G30 P2, P3, P4; missing ones are all zero
    integer_words: `UNITS` by default. Programs of our day carry a point in every length, so it seldom matters; where it does, a
        wrong guess has to show: a program meant in increments, read as units, leaves the machine by a factor of 1000, while the
        other way round it shrinks to a dot that nobody sees
    feed_units_integer: with `INCREMENTS`, one unit of an integer F in G20 is 0.01 inch/min; in G21 1 mm/min
    peck_retract_mm: G73, parameter 5114; peck_clearance_mm: G83, parameter 5115
    bore_shift_deg: direction of the shift by Q in G76 and G87 in the plane: 0, 90, 180, 270 (parameter 5101#4, #5)
    scale_unit: magnification of one unit of an integer P, I, J, K in G51 (parameter 5400#7)
    angle_signed: ATAN[]/[] in -180..180 and ASIN in -90..90 instead of 0..360 and 270..90 (parameter 6004#0)
    arc_radius_error_mm_max: how far start and end may differ in their distance from the centre (parameter 3410)
    block_skip: numbers of the block-skip switches that are on; a bare `/` is number 1 (FANUC), 0 (SINUMERIK)
    optional_stop: M1 stops
    subprograms: texts by O number; one that stands in the main text goes first
    programs: texts of other programs by their names without folder and suffix: what CALL PGM and the call of a SINUMERIK
        subprogram name (`called_text`)
    parameters: values of parameters before the start, by name: "Q1", "QL1", "QR1" (HEIDENHAIN), "R10" (SINUMERIK)
    tool_numbers: numbers of tools by their names, where a program calls a tool by name
    variables: values of # variables before the start, also of system variables that a twin cannot know (#3011 …)
    spindle_rpm_max: clamp of G96
    builder_m_codes: M codes of the machine builder, which move no axis; they are passed over
    …_max: bounds, so that an endless program is an error and not a hang

    Raises TwinError for a position without one number for each axis, and for names of axes or offsets that do not exist.
    """

    dialect: str | None = None
    axes: tuple[str, ...] = ("x", "y", "z")
    start_mm: Position = ()
    inch: bool = False
    work_offsets_mm: Mapping[str, Position] = field(default_factory=dict)
    tool_offsets: Mapping[int, ToolOffset] = field(default_factory=dict)
    references_mm: tuple[Position, ...] = ()
    integer_words: IntegerWords = IntegerWords.UNITS
    dwell_unit: DwellUnit = DwellUnit.MILLISECONDS
    offset_lookup: OffsetLookup = OffsetLookup.WORD
    outside_corner: OutsideCorner = OutsideCorner.LINE
    lead_in: LeadIn = LeadIn.NEXT
    peck_retract_mm: float = 1.0
    peck_clearance_mm: float = 1.0
    bore_shift_deg: float = 0.0
    scale_unit: float = 0.001
    angle_signed: bool = False
    arc_radius_error_mm_max: float = 0.05
    block_skip: frozenset[int] = frozenset()
    optional_stop: bool = False
    subprograms: Mapping[int, str] = field(default_factory=dict)
    programs: Mapping[str, str] = field(default_factory=dict)
    variables: Mapping[int, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    tool_numbers: Mapping[str, int] = field(default_factory=dict)
    spindle_rpm_max: float | None = None
    builder_m_codes: frozenset[int] = frozenset()
    jumps_max: int = 200_000
    blocks_max: int = 20_000_000
    moves_max: int = 20_000_000
    call_depth_max: int = 15
    repeats_max: int = 9_999
    pecks_max: int = 10_000
    bracket_depth_max: int = 32

    def __post_init__(self) -> None:
        many = len(self.axes)
        rotary = self.axes[3:]
        if self.axes[:3] != ("x", "y", "z") or len(set(rotary)) != len(rotary) or not set(rotary) <= {"a", "b", "c"}:
            raise TwinError(f"axes are {self.axes!r}; they are x, y, z, then rotary axes out of a, b, c")
        positions = {"start_mm": self.start_mm or (0.0,) * many, **self.work_offsets_mm}
        positions |= {f"references_mm[{at}]": place for at, place in enumerate(self.references_mm)}
        for name, position in positions.items():
            if len(position) != many or not all(map(math.isfinite, position)):
                raise TwinError(f"{name} is {tuple(position)!r}; it needs one number for each of the axes {', '.join(self.axes)}")
        for name in self.work_offsets_mm:
            if not WORK_NAME.fullmatch(name):
                raise TwinError(
                    f"work offset {name!r} is not known; names are G54 to G59, G54.1 P1 to G54.1 P48, external; "
                    "G505 to G599 (SINUMERIK); preset 1, datum 1 (HEIDENHAIN)"
                )
        for name in self.parameters:
            if not PARAMETER_NAME.fullmatch(name):
                raise TwinError(f"parameter {name!r} is not known; names are such as Q1, QL1, QR1 (HEIDENHAIN), R10 (SINUMERIK)")

    def called_text(self, name: str) -> str | None:
        """Return the text of a program by the name that calls it, with folder and suffix or without; None = it is not there.

        >>> Settings(programs={"pocket": "M30"}).called_text("TNC:/NC/POCKET.H")
        'M30'
        """
        wanted = _bare(name)
        known = next((one for one in self.programs if _bare(one) == wanted), None)
        return None if known is None else self.programs[known]


def _bare(name: str) -> str:
    """Return the name of a program without folder, suffix and the marks of its kind, in small letters."""
    last = re.split(r"[/\\]", name.strip().strip('"'))[-1].casefold().removeprefix("_n_")
    return re.sub(r"[._](h|i|mpf|spf)$", "", last)
