"""CYCLE71, face milling: a rectangle in parallel cuts ("Cycles", chapter "Face milling").

Roughing goes down in equal infeeds of at most _MID to the allowance _FALD, finishing once to the depth. The tens of _VARI are the
way: 1 along the first axis of the plane in one direction, 2 along the second, 3 and 4 to and fro. The cuts are of equal width, at
most _MIDA; the tool begins and ends beside the face, by _FDP or its radius and the safety clearance, and the last cut goes over
the edge by _FDP1.
"""

import math

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import Levels, levels, to
from twin.programs.sinumerik.cycles.milling import SMALL_MM, Shape, steps
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.tool import cutter_radius

CUTS_MAX = 10_000


def face(state: State, given: Arguments) -> None:
    """CYCLE71: from the corner (_PA, _PO), _LENG along the first and _WID along the second axis, turned by _STA."""
    if state.spindle_direction == 0:
        raise RefusedError(given.cycle, "needs a turning spindle; write S and M3 before")
    heights = levels(state, given)
    size = (given.length("_LENG"), given.length("_WID"))
    shape = Shape(state, (given.length("_PA"), given.length("_PO")), math.radians(given.number("_STA")))
    over = given.size("_FDP")
    cut(state, given, heights, shape, (size[0], size[1], given.size("_MIDA"), over))


def cut(state: State, given: Arguments, heights: Levels, shape: Shape, how: tuple[float, float, float, float]) -> None:
    """All infeeds."""
    leng, wid, most, over = how
    radius = cutter_radius(state, given.cycle)
    work = given.whole("_VARI", 0, 99)
    way = work // 10
    if work % 10 not in (1, 2) or way not in (1, 2, 3, 4):
        raise RefusedError(f"{given.cycle} _VARI", "is 1 roughing or 2 finishing, in the tens 1 to 4 for the way (61102)")
    if abs(leng) <= SMALL_MM or abs(wid) <= SMALL_MM:
        raise RefusedError(f"{given.cycle} _LENG", "the face needs a length and a width")
    most = most or 2.0 * radius * 0.8
    if most > 2.0 * radius + SMALL_MM:
        raise RefusedError(
            f"{given.cycle} _MIDA", f"is wider than the tool, {2.0 * radius:g} mm: it would leave material (61105)"
        )
    along, across = (leng, wid) if way in (1, 3) else (wid, leng)
    across += math.copysign(given.size("_FDP1"), across)
    count = max(math.ceil(abs(across) / most - SMALL_MM), 1)
    if count > CUTS_MAX:
        raise RefusedError(f"{given.cycle} _MIDA", f"makes more than {CUTS_MAX} cuts; a larger one")
    floor = heights.depth - heights.down * given.size("_FALD") if work % 10 == 1 else heights.depth
    most_down = given.size("_MID") if work % 10 == 1 else 0.0
    feed = given.number("_FFP1") * state.feed_unit_mm
    beside = (over or radius + given.size("SDIS")) * math.copysign(1.0, along)
    swapped = way in (2, 4)

    def place(reach: float, line: int) -> tuple[float, float]:
        beyond = across * (line + 1) / count - math.copysign(min(radius, abs(across) / 2.0), across)
        return (beyond, reach) if swapped else (reach, beyond)

    to(state, heights.back)
    for level in steps(state, given, heights.surface, floor, most_down):
        forward = True
        for line in range(count):
            begin, end = (-beside, along + beside) if forward else (along + beside, -beside)
            if line == 0 or way in (1, 2):
                to(state, heights.start)
                shape.rapid(place(begin, line))
                to(state, level)
            else:
                shape.line(place(begin, line), feed)
            shape.line(place(end, line), feed)
            forward = not forward if way in (3, 4) else True
        to(state, heights.start)
    to(state, heights.back)
