"""The state of the interpreter between two blocks: modes, feed and speed, offsets, position, and what was put out so far.

It is the one thing that changes while a program runs; functions of the other files take it and change it, block by block.
"""

from dataclasses import dataclass
from typing import Final

from twin.programs.canonical import Position, ToolLength
from twin.programs.cutter_path import CompensatedSection
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.coordinates import Coordinates
from twin.programs.put_out import PutOut
from twin.programs.refusal import RefusedError
from twin.programs.settings import IntegerWords, Settings, ToolOffset

MM_PER_INCH: Final = 25.4


@dataclass(slots=True)
class Modal:
    """The G code in force of each group, in tenths."""

    motion: int = 0
    cycle: int = 800
    plane: int = 170
    distance: int = 900
    feed: int = 940
    units: int = 210
    cutter: int = 400
    length: int = 490
    retract: int = 980
    scaling: int = 500
    macro: int = 670
    speed: int = 970
    work: int = 540
    path: int = 640
    rotation: int = 690
    polar: int = 150


@dataclass(slots=True)
class PolarPole:
    """G16: the pole, and the last radius and angle."""

    centre: tuple[float, float]
    radius_mm: float
    angle_deg: float


@dataclass(slots=True)
class CycleData:
    """The data that a canned cycle keeps until it is cancelled: words in program units of mm, pauses in s."""

    initial_mm: float
    r_mm: float | None = None
    z_mm: float | None = None
    q_mm: float = 0.0
    shift_mm: tuple[float, float] | None = None
    dwell_s: float = 0.0


@dataclass(frozen=True, slots=True)
class PendingCorner:
    """A move that ended in ,C or ,R: where it was put, where it began, and the size of the corner."""

    at: int
    start_mm: Position
    kind: str
    size_mm: float
    text: str


@dataclass(slots=True)
class Compensation(CompensatedSection):
    """G41, G42: the section since, how far to the left the next motion goes, and whether its G40 was read."""

    left: float = 0.0
    leaving: bool = False


class State(PutOut):
    """See the file's docstring. `out` is what moves go to now: `moves`, or the buffer of the cutter compensation."""

    __slots__ = (
        "axes",
        "compensation",
        "coordinates",
        "corner",
        "cycle",
        "feed_per_rev_mm",
        "feed_word",
        "length_is_due",
        "length_number",
        "modal",
        "pole",
        "position",
        "preselected",
        "radius_number",
        "rigid",
        "rpm",
        "skip_position",
        "speed_max",
        "speed_word",
        "spindle_axis",
        "spindle_direction",
        "tool",
        "tool_offsets",
    )

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.modal = Modal(units=200 if settings.inch else 210)
        self.coordinates = Coordinates(settings)
        self.axes = settings.axes
        self.position: Position = settings.start_mm or (0.0,) * len(settings.axes)
        self.skip_position = self.position
        self.moves = []
        self.out = self.moves
        self.corner: PendingCorner | None = None
        self.compensation: Compensation | None = None
        self.cycle: CycleData | None = None
        self.pole: PolarPole | None = None
        self.line = 0
        self.program = None
        self.feed_word = 0.0
        self.feed_per_rev_mm: float | None = None
        self.rpm = self.speed_word = 0.0
        self.speed_max = settings.spindle_rpm_max
        self.spindle_axis = 0
        self.spindle_direction = 0
        self.rigid = False
        self.tool = 0
        self.preselected: int | None = None
        self.length_number: int | None = None
        self.length_is_due = False
        self.radius_number: int | None = None
        self.tool_offsets: dict[int, ToolOffset] = dict(settings.tool_offsets)

    @property
    def plane(self) -> int:
        return self.modal.plane // 10

    @property
    def unit_mm(self) -> float:
        """One unit of a programmed length, mm."""
        return MM_PER_INCH if self.modal.units == 200 else 1.0

    @property
    def increment(self) -> float:
        """The least increment in programmed units: 0.001 mm or 0.0001 inch (IS-B)."""
        return 0.0001 if self.modal.units == 200 else 0.001

    def length(self, words: Words, letter: str) -> float:
        """A length word in mm (a rotary axis: degrees)."""
        value = words.values[letter]
        rotary = letter in "ABC" and letter.lower() in self.axes
        if letter in words.integers and self.settings.integer_words is IntegerWords.INCREMENTS:
            value *= 0.001 if rotary else self.increment
        return value if rotary else value * self.unit_mm

    def angle(self, words: Words, letter: str) -> float:
        """An angle word in degrees."""
        value = words.values[letter]
        fine = letter in words.integers and self.settings.integer_words is IntegerWords.INCREMENTS
        return value * 0.001 if fine else value

    def take_length(self) -> None:
        """Say the tool length before the first move that is told where z goes since it changed: that move contains it."""
        if self.length_is_due:
            self.length_is_due = False
            self.emit(ToolLength(self.line, self.coordinates.tool[2], self.program))

    def feed(self, length_mm: float) -> tuple[float, float | None]:
        """Feed of the next cut of that length: mm/min, and mm/rev where it hangs on the spindle. RefusedError without one."""
        mode = self.modal.feed
        if self.feed_word <= 0.0:
            raise RefusedError("", "this cut has no feed; write F in this block or before")
        if mode == 940:
            return self.feed_word, None
        if mode == 930:
            return max(length_mm, 1e-9) * self.feed_word, None
        if self.rpm <= 0.0 or self.spindle_direction == 0:
            raise RefusedError("", "feed per revolution (G95) needs a turning spindle; write S and M3 before")
        return self.feed_word * self.rpm, self.feed_word
