"""One part, as every language has to make it: a faced plate, an outline at two depths by a subprogram called twice, four holes.

A language adds its text of this part as `tests/twin/programs/<name>/plate.<suffix>`. It is written for `SETTINGS`: the datum is
`OFFSET_MM` (G54; line 1 of the preset table), tools 1, 2 and 3 have the lengths and radii of `TOOLS`, and the axes stand at 0 at
the start. It has to have

* each tool with its change, its speed and M3 before it cuts; tool length taken up before the first move down
* the face: rapid to (−15, 15) and to z = 0, then three lines of feed 800 to (115, 15), (115, 45), (−15, 45)
* the outline at z = −3 and again at z = −6: down at (30, 15) with feed 100 in a line of its own, the first time from z = 2, then
  the subprogram at feed 500: (80, 15) with a rounding of 8 to the next line, (80, 45) with a chamfer of 5, (28, 45), a quarter
  circle given by its centre (28, 37) to (20, 37), (20, 23), a quarter circle given by its radius 8 to (28, 15), (30, 15)
* the holes at (10, 10), (90, 10), (90, 50), (10, 50): by the drilling cycle, from 2 above the plate to z = −12 with feed 150
* a comment in the language's own way that says `F1 AND S1`, in one line behind a word of feed
* no feed and no speed by an expression

Rapids are the language's own: only what cuts is compared, with where it begins.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from twin.programs import Arc, Linear, Move, Rapid, Settings, Spindle, ToolChange, ToolOffset

OFFSET_MM: Final = (20.0, 30.0, 5.0)
TOOLS: Final = {1: ToolOffset(100.0, 10.0), 2: ToolOffset(80.0, 4.0), 3: ToolOffset(120.0, 3.0)}
SPEEDS_RPM: Final = {1: 2000.0, 2: 3000.0, 3: 1200.0}
SETTINGS: Final = Settings(
    work_offsets_mm={"G54": OFFSET_MM, "preset 1": OFFSET_MM},
    tool_offsets=TOOLS,
    jumps_max=1000,
    blocks_max=5000,
    moves_max=5000,
)
SAME_MM: Final = 1e-6

Place = tuple[float, float, float]


class Cut(NamedTuple):
    """A cut in machine coordinates: with its tool, its signed speed, and the centre and sweep of an arc."""

    tool: int
    rpm: float
    feed_mm_min: float
    start_mm: Place
    end_mm: Place
    centre_mm: Place | None = None
    sweep_rad: float = 0.0


def _placed(tool: int, x: float, y: float, z: float) -> Place:
    return (x + OFFSET_MM[0], y + OFFSET_MM[1], z + OFFSET_MM[2] + TOOLS[tool].length_mm)


def _line(tool: int, feed: float, start: Place, end: Place) -> Cut:
    return Cut(tool, SPEEDS_RPM[tool], feed, _placed(tool, *start), _placed(tool, *end))


def _outline(z: float) -> list[Cut]:
    """The outline, counter-clockwise: lines between the points, quarter circles of 8 mm where a centre stands."""
    way: tuple[tuple[float, float, tuple[float, float] | None], ...] = (
        (30.0, 15.0, None),
        (72.0, 15.0, None),
        (80.0, 23.0, (72.0, 23.0)),
        (80.0, 40.0, None),
        (75.0, 45.0, None),
        (28.0, 45.0, None),
        (20.0, 37.0, (28.0, 37.0)),
        (20.0, 23.0, None),
        (28.0, 15.0, (28.0, 23.0)),
        (30.0, 15.0, None),
    )
    cuts = []
    for (x0, y0, _), (x, y, centre) in pairwise(way):
        cut = _line(2, 500.0, (x0, y0, z), (x, y, z))
        if centre is not None:
            cut = cut._replace(centre_mm=_placed(2, *centre, z), sweep_rad=math.pi / 2.0)
        cuts.append(cut)
    return cuts


TRUTH: Final = (
    _line(1, 800.0, (-15.0, 15.0, 0.0), (115.0, 15.0, 0.0)),
    _line(1, 800.0, (115.0, 15.0, 0.0), (115.0, 45.0, 0.0)),
    _line(1, 800.0, (115.0, 45.0, 0.0), (-15.0, 45.0, 0.0)),
    _line(2, 100.0, (30.0, 15.0, 2.0), (30.0, 15.0, -3.0)),
    *_outline(-3.0),
    _line(2, 100.0, (30.0, 15.0, -3.0), (30.0, 15.0, -6.0)),
    *_outline(-6.0),
    *(_line(3, 150.0, (x, y, 2.0), (x, y, -12.0)) for x, y in ((10.0, 10.0), (90.0, 10.0), (90.0, 50.0), (10.0, 50.0))),
)


def cuts(moves: Sequence[Move]) -> list[Cut]:
    """Return what of the moves cuts. Cuts that go nowhere are left out."""
    found, position, tool, rpm = [], (0.0, 0.0, 0.0), 0, 0.0
    for move in moves:
        if isinstance(move, ToolChange):
            tool = move.tool
        elif isinstance(move, Spindle):
            rpm = move.rpm * move.direction
        elif isinstance(move, Rapid | Linear | Arc):
            x, y, z = move.end_mm
            start, position = position, (x, y, z)
            if isinstance(move, Arc):
                found.append(Cut(tool, rpm, move.feed_mm_min, start, position, move.centre_mm, move.sweep_rad))
            elif isinstance(move, Linear) and math.dist(start, position) > SAME_MM:
                found.append(Cut(tool, rpm, move.feed_mm_min, start, position))
    return found


def figures(cut: Cut) -> list[float]:
    """The figures of a cut, to be compared within `SAME_MM`."""
    return [cut.tool, cut.rpm, cut.feed_mm_min, *cut.start_mm, *cut.end_mm, *(cut.centre_mm or ()), cut.sweep_rad]
