"""The state of the interpreter between two blocks: modes, feed and speed, frames, position, and what was put out so far.

It is the one thing that changes while a program runs; functions of the other files take it and change it, block by block.
"""

from dataclasses import dataclass, field
from typing import Final

from twin.programs.canonical import Move, Position, ToolLength
from twin.programs.cutter_path import CompensatedSection
from twin.programs.planes import PLANES
from twin.programs.put_out import PutOut
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings, ToolOffset
from twin.programs.sinumerik.frames import Frames

MM_PER_INCH: Final = 25.4
START: Final = {
    **{"motion": "G1", "plane": "G17", "cutter": "G40", "work": "G500", "path": "G64", "distance": "G90", "feed": "G94"},
    **{"contour_feed": "CFC", "approach": "NORM", "corner": "G450", "jerk": "SOFT", "feed_forward": "FFWOF", "dialect": "G290"},
}
"""The G codes in force at the start: those that a control comes with, and continuous path as milling machines are set up."""


@dataclass(slots=True)
class Pole:
    """The pole of polar coordinates in the plane, and the last radius and angle. Program coordinates, mm and degrees."""

    centre: tuple[float, float] = (0.0, 0.0)
    radius_mm: float | None = None
    angle_deg: float | None = None


@dataclass(frozen=True, slots=True)
class PendingCorner:
    """A move that ended in a chamfer or a rounding: where it was put, where it began, and the corner.

    kind: CHF, CHR or RND; feed: of FRC, None = that of its block; is_modal: RNDM, which is left out where it does not fit
    """

    at: int
    start_mm: Position
    kind: str
    size_mm: float
    text: str
    feed_mm_min: float | None
    is_modal: bool


@dataclass(frozen=True, slots=True)
class PendingAngle:
    """A straight line of which only its angle is known yet, in program coordinates (ANG=)."""

    angle_deg: float
    start: Position
    line: int
    text: str


@dataclass(slots=True)
class Compensation:
    """G41, G42: the section so far. left: how far to the left of its path the tool's centre is now; leaving: G40 was read."""

    section: CompensatedSection
    left: float
    leaving: bool = False


@dataclass(slots=True)
class State(PutOut):
    """See the file's docstring. `out` is what moves go to now: `moves`, or the buffer of the cutter compensation.

    feed_word: mm/min, mm/rev or 1/min as the feed mode says; tangent: direction in the plane at the end of the last motion
    edge: the D number in force
    """

    settings: Settings
    modal: dict[str, str] = field(default_factory=lambda: dict(START))
    moves: list[Move] = field(default_factory=list)
    out: list[Move] = field(default_factory=list)
    frames: Frames = field(init=False)
    axes: tuple[str, ...] = field(init=False)
    position: Position = field(init=False)
    tool_offsets: dict[int, ToolOffset] = field(init=False)
    speed_max: float | None = field(init=False)
    line: int = 0
    program: str | None = None
    feed_word: float = 0.0
    block_feed: float | None = None
    rpm: float = 0.0
    speed_word: float = 0.0
    spindle_direction: int = 0
    tool: int = 0
    preselected: int | None = None
    edge: int = 1
    length_is_due: bool = False
    compensation: Compensation | None = None
    corner: PendingCorner | None = None
    pending_angle: PendingAngle | None = None
    pole: Pole = field(default_factory=Pole)
    tangent: tuple[float, float] | None = None
    rounding_mm: float = 0.0
    corner_feed: float | None = None
    allowance_mm: float = 0.0
    distance_mm: dict[str, float] = field(default_factory=dict)
    tolerance_mm: float | None = None
    rotary_tolerance_deg: float | None = None

    def __post_init__(self) -> None:
        self.out = self.moves
        self.frames, self.axes = Frames(self.settings), self.settings.axes
        self.position = self.settings.start_mm or (0.0,) * len(self.axes)
        self.tool_offsets, self.speed_max = dict(self.settings.tool_offsets), self.settings.spindle_rpm_max
        self.modal["units"] = "G70" if self.settings.inch else "G71"

    @property
    def plane(self) -> int:
        return int(self.modal["plane"][1:])

    @property
    def normal(self) -> int:
        """The axis of the tool: that out of the plane."""
        return PLANES[self.plane][2]

    @property
    def unit_mm(self) -> float:
        """One unit of a programmed length, mm."""
        return MM_PER_INCH if self.modal["units"] in ("G70", "G700") else 1.0

    @property
    def feed_unit_mm(self) -> float:
        """One unit of a programmed feed, mm: G70 leaves feeds in mm, G700 does not."""
        return MM_PER_INCH if self.modal["units"] == "G700" or (self.settings.inch and self.modal["units"] == "G70") else 1.0

    @property
    def waits_for_tool(self) -> bool:
        """Return True where a tool with a length was chosen, and none is in the spindle yet: nothing can be cut so."""
        return self.tool == 0 and bool(self.preselected) and bool(self.tool_offsets)

    def take_length(self) -> None:
        """Say the tool length before the first move that is told where z goes since it changed: that move contains it."""
        if self.length_is_due:
            self.length_is_due = False
            self.emit(ToolLength(self.line, self.frames.tool[2], self.program))

    def feed(self, length_mm: float) -> tuple[float, float | None]:
        """Feed of the next cut of that length: mm/min, and mm/rev where it hangs on the spindle. RefusedError without one."""
        mode = self.modal["feed"]
        word = self.feed_word if self.block_feed is None else self.block_feed
        if word <= 0.0:
            raise RefusedError("", "this cut has no feed; write F in this block or before")
        if mode in ("G94", "G961", "G971"):
            return word, None
        if mode == "G93":
            return max(length_mm, 1e-9) * word, None
        return self.per_revolution(word)

    def per_revolution(self, feed_per_rev_mm: float) -> tuple[float, float]:
        """A feed tied to the spindle: mm/min and mm/rev."""
        if self.rpm <= 0.0 or self.spindle_direction == 0:
            raise RefusedError("", "a feed per revolution needs a turning spindle; write S and M3 before")
        return feed_per_rev_mm * self.rpm, feed_per_rev_mm
