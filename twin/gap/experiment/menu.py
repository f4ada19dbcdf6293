"""The menu of experiments: short programs, each made to show one thing, within what the recorded runs have already done.

They follow the ones that drives are set up with: reciprocation at several speeds tells gravity, friction and viscous friction
apart (Mitsubishi MELDAS commissioning, unbalance torque by reciprocation at F1000), reversals of micrometres backlash and
pre-sliding, circles at two radii lost motion and delays (ISO 230-4), a ladder of spindle speeds the idle power, a warm-up with a
cool-down the thermal masses. G4 P counts milliseconds.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

from twin.effects.effect import BuildsUp
from twin.gap.experiment.envelope import Envelope


class Shows(StrEnum):
    """The part of the machine that a program works with."""

    AXIS = "axis"
    SPINDLE = "spindle"
    CUT = "cut"
    HEAT = "heat"


@dataclass(frozen=True, slots=True)
class Snippet:
    """A program of the menu.

    does: what it does, in words; blocks: block and comment, one a line; cuts: numbers of the blocks that cut, from 0
    letters: the axes that it moves; from_block: the first block that counts, after the way to where it starts
    only_for: effects that build up so are worth its minutes; None = any
    """

    does: str
    shows: Shows
    blocks: tuple[tuple[str, str], ...]
    letters: tuple[str, ...] = ()
    cuts: frozenset[int] = frozenset()
    from_block: int = 0
    only_for: BuildsUp | None = None

    def program(self) -> str:
        """The program, numbered, a comment in each line."""
        lines = [f"N{number} {block} ({comment})" for number, (block, comment) in enumerate(self.blocks, start=1)]
        return "\n".join(["%", *lines, "M30", "%"]) + "\n"


SAFE = ("G21 G90 G94 G17", "mm, absolute, coordinates as in the recorded programs")
SHORT_REVERSALS_MM = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
STROKE_MM_MIN = 1.0
"""A box smaller than this is no room to move in."""
WARM_S = 180.0
APART_MS = 120_000
HEAT_S = (2400.0, 2400.0)
COOLANT_S = 900.0


def axis_menu(axis: str, envelope: Envelope, lead_mm: float | None) -> Iterator[Snippet]:
    """Programs that move one axis (and a second one on circles), the short ones first."""
    if axis not in envelope.box_mm or envelope.feed_mm_min[axis] <= 0.0:
        return
    low, high = envelope.box_mm[axis]
    if high - low < STROKE_MM_MIN:
        return
    moves = _Moves(axis, envelope)
    yield moves.snippet("reversals of 2 to 100 µm", _short_reversals(moves))
    yield moves.snippet("short strokes at full speed, which are all acceleration", _sharp_starts(moves))
    yield moves.snippet("full strokes at the fastest feed", _strokes(moves, 1.0, 3))
    yield moves.snippet("strokes at four speeds, the slowest a fiftieth of the fastest", _speeds(moves))
    yield moves.snippet("5 s dwells after approaches from both sides", _dwells(moves))
    if lead_mm is not None:
        yield moves.snippet("slow traverses over many turns of the screw at two speeds", _traverses(moves, lead_mm))
    yield from _circles(moves)
    yield replace(moves.snippet("the same strokes 2 minutes apart", _apart(moves)), only_for=BuildsUp.WAITING)
    yield replace(
        moves.snippet("the same strokes before and after 3 minutes of motion", _warming(moves)), only_for=BuildsUp.MOTION
    )


def machine_menu(envelope: Envelope) -> Iterator[Snippet]:
    """Programs for what is no matter of one axis: spindle, cut, heat."""
    if envelope.spindle_rpm > 0.0:
        ladder = [round(envelope.spindle_rpm * part) for part in (0.25, 0.5, 0.75, 1.0)]
        blocks = [SAFE, *(b for rpm in ladder for b in ((f"S{rpm} M3", "spindle in air"), ("G4 P3000", "steady")))]
        yield Snippet("four spindle speeds in air", Shows.SPINDLE, (*blocks, ("M5", "spindle stops"), ("G4 P2000", "standing")))
    if envelope.cut is not None:
        yield from _slot(envelope)
    if envelope.warmed_s > 600.0:
        rpm = round(envelope.spindle_rpm)
        turn, stand = (round(1000.0 * seconds) for seconds in HEAT_S)
        warm = (SAFE, (f"S{rpm} M3", "spindle in air"), (f"G4 P{turn}", "warming"), ("M5", "stops"), (f"G4 P{stand}", "cooling"))
        yield Snippet("40 minutes of warm-up and 40 of cool-down", Shows.HEAT, warm)
        if envelope.coolant:
            wait = f"G4 P{round(1000.0 * COOLANT_S)}"
            pair = [b for _ in range(2) for b in (("M8", "coolant on"), (wait, "with"), ("M9", "coolant off"), (wait, "without"))]
            blocks = [SAFE, (f"S{rpm} M3", "spindle in air"), (wait, "warming"), *pair]
            yield Snippet("coolant on and off by turns while the spindle turns", Shows.HEAT, (*blocks, ("M5", "stops")))


@dataclass(frozen=True, slots=True)
class _Moves:
    """Blocks of one axis. Places are parts of the way from home to the far end of the box."""

    axis: str
    envelope: Envelope

    @property
    def range_mm(self) -> float:
        """From home to the far end, with its sign."""
        return self.envelope.far_mm(self.axis) - self.envelope.home_mm[self.axis]

    @property
    def fastest(self) -> float:
        """Fastest feed, mm/min."""
        return self.envelope.feed_mm_min[self.axis]

    def to(self, part: float, feed: float, comment: str) -> tuple[str, str]:
        """A move to a part of the way; feed in mm/min, never above the fastest."""
        return self.by(part * self.range_mm, feed, comment)

    def by(self, distance_mm: float, feed: float, comment: str) -> tuple[str, str]:
        """A move to a distance from home."""
        at = self.envelope.home_mm[self.axis] + distance_mm
        return f"G1 {self.axis.upper()}{at:.4f} F{max(1.0, min(feed, self.fastest)):.0f}", comment

    def snippet(self, does: str, blocks: list[tuple[str, str]], letters: tuple[str, ...] = (), start: int = 3) -> Snippet:
        """A program that starts and ends at home."""
        approach = self.to(0.0, 0.3 * self.fastest, "start where the recorded programs start, clear of the part")
        home = self.to(0.0, 0.3 * self.fastest, "back to the start")
        every = (SAFE, approach, ("G4 P300", "settle"), *blocks, home, ("G4 P300", "settle"))
        return Snippet(does, Shows.AXIS, every, letters or (self.axis,), frozenset(), start)


def _short_reversals(moves: _Moves) -> list[tuple[str, str]]:
    sign = 1.0 if moves.range_mm > 0 else -1.0
    blocks = []
    for size in SHORT_REVERSALS_MM:
        for _ in range(2):
            blocks += [moves.by(sign * size, 200.0, f"{1000 * size:.0f} um out"), ("G4 P120", "rest")]
            blocks += [moves.by(0.0, 200.0, "and back"), ("G4 P120", "rest")]
    return blocks


def _sharp_starts(moves: _Moves) -> list[tuple[str, str]]:
    part = min(1.0, 3.0 / abs(moves.range_mm))
    out, back = moves.to(part, moves.fastest, "start and stop sharply"), moves.to(0.0, moves.fastest, "and back")
    return [block for _ in range(5) for block in (out, ("G4 P150", "rest"), back, ("G4 P150", "rest"))]


def _strokes(moves: _Moves, part: float, times: int) -> list[tuple[str, str]]:
    out, back = moves.to(part, moves.fastest, "full stroke out"), moves.to(0.0, moves.fastest, "and back")
    return [block for _ in range(times) for block in (out, back, ("G4 P200", "rest"))]


def _speeds(moves: _Moves) -> list[tuple[str, str]]:
    blocks = []
    for part in (0.02, 0.1, 0.4, 1.0):
        feed = part * moves.fastest
        reach = min(0.9, feed / 60.0 * 1.5 / abs(moves.range_mm))
        blocks += [moves.to(reach, feed, f"out at {100 * part:.0f} % of the fastest feed"), moves.to(0.0, feed, "and back")]
        blocks.append(("G4 P200", "rest"))
    return blocks


def _dwells(moves: _Moves) -> list[tuple[str, str]]:
    feed = min(1000.0, moves.fastest)
    near, far = 0.5 - min(0.2, 5.0 / abs(moves.range_mm)), 0.5 + min(0.2, 5.0 / abs(moves.range_mm))
    blocks = [moves.to(near, feed, "to one side"), moves.to(0.5, feed, "approach from it"), ("G4 P5000", "stand still")]
    return [
        *blocks,
        moves.to(far, feed, "to the other side"),
        moves.to(0.5, feed, "approach from it"),
        ("G4 P5000", "stand still"),
    ]


def _traverses(moves: _Moves, lead_mm: float) -> list[tuple[str, str]]:
    part = min(0.95, 10.0 * lead_mm / abs(moves.range_mm))
    blocks = []
    for seconds in (6.0, 3.0):
        feed = part * abs(moves.range_mm) / seconds * 60.0
        blocks += [
            moves.to(part, feed, "slow traverse"),
            ("G4 P200", "rest"),
            moves.to(0.0, feed, "and back"),
            ("G4 P200", "rest"),
        ]
    return blocks


def _apart(moves: _Moves) -> list[tuple[str, str]]:
    return [*_strokes(moves, 0.9, 1), (f"G4 P{APART_MS}", "wait, nothing moves"), *_strokes(moves, 0.9, 1)]


def _warming(moves: _Moves) -> list[tuple[str, str]]:
    stroke_s = 2.0 * 0.9 * abs(moves.range_mm) / (0.7 * moves.fastest / 60.0) + 0.2
    times = max(1, min(400, round(WARM_S / stroke_s)))
    out, back = moves.to(0.9, 0.7 * moves.fastest, "warming"), moves.to(0.0, 0.7 * moves.fastest, "and back")
    return [*_strokes(moves, 0.9, 1), *(block for _ in range(times) for block in (out, back)), *_strokes(moves, 0.9, 1)]


CIRCLES = {("x", "y"): ("G17", "I"), ("z", "x"): ("G18", "K"), ("y", "z"): ("G19", "J")}


def _circles(moves: _Moves) -> Iterator[Snippet]:
    """Circles at two radii and three feeds, in a plane whose second axis has moved too."""
    envelope = moves.envelope
    for (one, other), (plane, word) in CIRCLES.items():
        partner = other if one == moves.axis else one
        if moves.axis not in (one, other) or partner not in envelope.box_mm:
            continue
        low, high = envelope.box_mm[other]
        first = envelope.far_mm(one) - envelope.home_mm[one]
        radius = min(abs(first) / 2.0, (high - low) / 2.0) * 0.9
        if radius < STROKE_MM_MIN:
            continue
        fastest = min(envelope.feed_mm_min[one], envelope.feed_mm_min[other])
        middle = f"G1 {other.upper()}{(low + high) / 2.0:.4f} F{max(1.0, 0.3 * fastest):.0f}"
        start = f"G1 {one.upper()}{envelope.home_mm[one]:.4f} F{max(1.0, 0.3 * fastest):.0f}"
        blocks = [(start, "start of the circles"), (middle, "to the middle of the second axis"), ("G4 P300", "settle")]
        for size in (radius, radius / 3.0):
            for part in (0.3, 0.8):
                feed = max(1.0, part * fastest)
                centre = f"{word}{size if first > 0 else -size:.4f}"
                blocks += [(f"{plane} G{way} {centre} F{feed:.0f}", f"circle of {size:.1f} mm") for way in (2, 3)]
        back = (f"G1 {other.upper()}{envelope.home_mm[other]:.4f} F{max(1.0, 0.3 * fastest):.0f}", "second axis back")
        yield moves.snippet("circles of two radii at two feeds in both senses", [*blocks, back], (one, other), 6)
        return


def _slot(envelope: Envelope) -> Iterator[Snippet]:
    """The recorded cut at four feeds, where x has room."""
    cut = envelope.cut
    assert cut is not None
    if "x" not in envelope.box_mm or abs(envelope.far_mm("x") - envelope.home_mm["x"]) < STROKE_MM_MIN:
        return
    slowest, fastest = cut.feed_mm_min
    home, whole = envelope.home_mm["x"], envelope.far_mm("x") - envelope.home_mm["x"]
    blocks = [SAFE, (f"S{cut.spindle_rpm:.0f} M3", "speed of the recorded cut"), ("G4 P400", "steady")]
    first = len(blocks)
    feeds = [slowest * (fastest / slowest) ** (i / 3.0) for i in range(4)]
    at = 0.0
    for feed in feeds:
        at += feed * 0.95 / sum(feeds)  # the same time at each feed
        comment = f"full depth of {cut.axial_depth_mm:g} mm, fresh stock, set up as for the recorded cut"
        blocks.append((f"G1 X{home + at * whole:.4f} F{feed:.0f}", comment))
    cutting = frozenset(range(first, len(blocks)))
    blocks += [("G4 P200", "rest"), ("M5", "spindle stops; retract by hand")]
    yield Snippet("one cut at four feeds, as deep as the recorded one", Shows.CUT, tuple(blocks), ("x", "y"), cutting, first)
