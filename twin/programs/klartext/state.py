"""The state of the interpreter between two blocks: feed and speed, tool, coordinates, position, and what was put out so far.

It is the one thing that changes while a program runs; functions of the other files take it and change it, block by block.
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from twin.programs.canonical import Motion, Position, ToolLength
from twin.programs.cutter_path import CompensatedSection
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.flow import Flow
from twin.programs.klartext.frame import Frame
from twin.programs.klartext.source import Text
from twin.programs.klartext.variables import Variables
from twin.programs.planes import PLANES
from twin.programs.put_out import PutOut
from twin.programs.refusal import RefusedError
from twin.programs.settings import Settings, ToolOffset

MM_PER_INCH: Final = 25.4
INCH_FEED: Final = MM_PER_INCH / 10.0
"""In an inch program F counts tenths of an inch a minute (User's Manual iTNC 530, "Feed rate F")."""
FEED_MAX: Final = 1e9


class EdgeFeed(Enum):
    """The arcs in which the feed is that of the cutting edge, not of the tool's centre: M111, M110, M109."""

    NONE = "M111"
    INNER_ARCS = "M110"
    ALL_ARCS = "M109"


@dataclass(slots=True)
class Pole:
    """CC: in program coordinates, mm, and the plane that its two axes span."""

    plane: int
    first_mm: float
    second_mm: float


@dataclass(frozen=True, slots=True)
class PendingCorner:
    """A move that RND or CHF follows: where it was put, where it began, and the corner's own line, size and feed."""

    at: int
    start_mm: Position
    rounds: bool
    size_mm: float
    feed_mm_min: float | None
    line: int
    text: str


@dataclass(frozen=True, slots=True)
class Approach:
    """APPR: the way from the starting point to the first contour point, drawn when the contour's direction is known.

    kind: LT, LN, CT or LCT; side: +1 where the tool is to the left of the contour, -1 to the right
    first: the move to the auxiliary point, as it goes in rapid or with a feed; rest: the same line with the feed behind it
    """

    kind: str
    side: int
    length_mm: float
    angle_rad: float
    depth_mm: float | None
    first: Motion
    rest: Motion


@dataclass(slots=True)
class Tool:
    """The tool in the spindle: its number, its figures in the table, the deltas of TOOL CALL, the feed of F AUTO."""

    number: int = 0
    length_delta_mm: float = 0.0
    radius_delta_mm: float = 0.0
    feed_mm_min: float | None = None


class State(PutOut):
    """See the file's docstring. `out` is what moves go to now: `moves`, or the section of the radius compensation."""

    __slots__ = (
        "approach",
        "axes",
        "calls_cycle",
        "compensation",
        "coolant",
        "corner",
        "cycle",
        "edge_feed",
        "feed_mm_min",
        "feed_per_rev_mm",
        "flow",
        "frame",
        "last",
        "last_rapid",
        "left_mm",
        "length_is_due",
        "open_corners",
        "pattern",
        "per_revolution",
        "plane",
        "plunge_factor",
        "pole",
        "position",
        "rpm",
        "selected",
        "shortest_rotary",
        "side",
        "spindle_direction",
        "stopped_direction",
        "strings",
        "tolerance_mm",
        "tool",
        "tool_offsets",
        "unit_mm",
        "variables",
    )

    def __init__(self, text: str, settings: Settings) -> None:
        self.settings = settings
        self.flow = Flow(Text(text, None), settings)
        self.axes = settings.axes
        self.frame = Frame(settings)
        self.variables = Variables(settings.parameters, self.system_parameter)
        self.position: Position = settings.start_mm or (0.0,) * len(settings.axes)
        self.moves = []
        self.out = self.moves
        self.plane = 17
        self.unit_mm = MM_PER_INCH if settings.inch else 1.0
        self.line = 0
        self.program = None
        self.feed_mm_min = 0.0
        self.feed_per_rev_mm: float | None = None
        self.per_revolution = False
        self.plunge_factor: float | None = None
        self.last_rapid = False
        self.edge_feed = EdgeFeed.NONE
        self.open_corners: list[Motion] = []
        self.rpm = 0.0
        self.spindle_direction = self.stopped_direction = 0
        self.coolant = False
        self.tool = Tool()
        self.tool_offsets: dict[int, ToolOffset] = dict(settings.tool_offsets)
        self.length_is_due = False
        self.pole: Pole | None = None
        self.last: tuple[Position, Motion] | None = None
        self.side = 0
        self.left_mm = 0.0
        self.compensation: CompensatedSection | None = None
        self.approach: Approach | None = None
        self.corner: PendingCorner | None = None
        self.cycle: Definition | None = None
        self.calls_cycle = False
        self.pattern: tuple[Position, ...] = ()
        self.selected: str | None = None
        self.strings: dict[int, str] = {}
        self.tolerance_mm: float | None = None
        self.shortest_rotary = False

    @property
    def normal(self) -> int:
        """The axis of the tool, by index."""
        return PLANES[self.plane][2]

    @property
    def feed_unit(self) -> float:
        """One unit of a programmed feed, mm/min."""
        return INCH_FEED if self.unit_mm != 1.0 else 1.0

    def take_length(self) -> None:
        """Report the tool length before the first move that is told where the tool's axis goes since it changed."""
        if self.length_is_due:
            self.length_is_due = False
            self.emit(ToolLength(self.line, self.frame.length_mm, self.program))

    def set_feed(self, value: float, text: str, per_revolution: bool) -> None:
        """F or FU: modal."""
        if not 0.0 < value <= FEED_MAX:
            raise RefusedError(text, "a feed is more than 0")
        self.per_revolution = per_revolution
        if per_revolution:
            self.feed_per_rev_mm = value * self.unit_mm
        else:
            self.feed_mm_min = value * self.feed_unit

    def feed(self) -> tuple[float, float | None]:
        """Feed of the next cut: mm/min, and mm/rev where it hangs on the spindle. RefusedError without one."""
        if self.per_revolution and self.feed_per_rev_mm is not None:
            if self.rpm <= 0.0 or self.spindle_direction == 0:
                raise RefusedError("", "a feed per revolution needs a turning spindle; write S in TOOL CALL and M3 before")
            return self.feed_per_rev_mm * self.rpm, self.feed_per_rev_mm
        if self.feed_mm_min <= 0.0:
            raise RefusedError("", "this cut has no feed; write F in this block or before")
        return self.feed_mm_min, None

    def tool_offset(self, text: str) -> ToolOffset:
        """The line of the tool table of the tool in the spindle; an empty one where there is no table at all."""
        if self.tool.number == 0 or not self.tool_offsets:
            return ToolOffset()
        found = self.tool_offsets.get(self.tool.number)
        if found is None:
            raise RefusedError(text, f"the tool table has no tool {self.tool.number}; [control] tool_offsets or TOOL DEF sets it")
        return found

    def radius_mm(self, text: str) -> float:
        """The radius of the tool in the spindle. RefusedError where it is not known."""
        if not self.tool_offsets or self.tool.number == 0:
            raise RefusedError(text, "the tool's radius is not known; [control] tool_offsets or TOOL DEF sets it")
        offset = self.tool_offset(text)
        return offset.radius_mm + offset.radius_wear_mm + self.tool.radius_delta_mm

    def enter_tool(self, number: int, length_mm: float, radius_mm: float) -> None:
        """TOOL DEF with figures: a line of the tool table."""
        before = self.tool_offsets.get(number, ToolOffset())
        self.tool_offsets[number] = replace(before, length_mm=length_mm, radius_mm=radius_mm)

    def call_program(self, name: str, word: str) -> None:
        """CALL PGM: another text goes on, with local parameters of its own."""
        self.flow.enter(name, word, self.variables.local, self.unit_mm)
        self.variables.local = {}

    def leave_program(self) -> bool:
        """Back to the caller; False in the main program."""
        left = self.flow.leave()
        if left is None:
            return False
        self.variables.local, self.unit_mm = left.caller_local, left.caller_unit_mm
        return True

    def system_parameter(self, number: int) -> float | None:
        """Q108 … Q114, as the control fills them (User's Manual TNC 640, "Preassigned Q parameters")."""
        if number == 108:
            return self.radius_mm("Q108") / self.unit_mm
        if number == 109:
            return float(self.normal) if self.tool.number else -1.0
        if number == 110:
            return {1: 0.0, -1: 1.0}.get(self.spindle_direction, {1: 2.0, -1: 3.0}.get(self.stopped_direction, -1.0))
        if number == 111:
            return float(self.coolant)
        if number == 113:
            return float(self.unit_mm != 1.0)
        if number == 114:
            return self.frame.length_mm / self.unit_mm
        return None
