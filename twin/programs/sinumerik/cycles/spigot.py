"""CYCLE76, a rectangular spigot, and CYCLE77, a round one ("Cycles", chapter "Milling cycles").

The tool goes beside the blank on the positive first axis, down to each depth there (equal infeeds of at most _MID, with _FFD), on
a half circle to the contour, once round it, and back on a half circle. Roughing leaves _FAL round the spigot and _FALD on its
base; finishing takes the wall at each infeed down to the depth, or where only the base has an allowance, the last lap alone.
Lengths count from the middle of the spigot; what is wider than one lap needs a call for each width, as on the control.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import levels, to
from twin.programs.sinumerik.cycles.milling import SMALL_MM, Segment, Shape, circle_ring, rounded_ring, steps, turns_left
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.tool import cutter_radius

MODES: Final = ("_GMODE", "_AMODE")


class Spigot(NamedTuple):
    """half: of the finished spigot along its length, mm; blank: of the blank, 0 = not given

    ring: the way of the tool's centre at a distance from the wall, once round from the length's axis
    """

    half: float
    blank: float
    ring: Callable[[float], list[Segment]]


def rectangle(state: State, given: Arguments) -> None:
    """CYCLE76: _LENG by _WID with corners of _CRAD, turned by _STA; the blank is _AP1 by _AP2."""
    half_u, half_v, corner = abs(given.length("_LENG")) / 2.0, abs(given.length("_WID")) / 2.0, given.size("_CRAD")
    left = turns_left(state, given, outside=True)
    for name, half in (("_LENG", half_u), ("_WID", half_v)):
        if half <= SMALL_MM:
            raise RefusedError(f"{given.cycle} {name}", "is needed, and not 0")
    if corner > min(half_u, half_v) + SMALL_MM:
        raise RefusedError(f"{given.cycle} _CRAD", f"is {corner:g} mm: the corners are rounder than the spigot is wide")
    if given.has("_AP2") and 0.0 < given.size("_AP2") < 2.0 * half_v:
        raise RefusedError(f"{given.cycle} _AP2", "the blank is narrower than the spigot")

    def ring(away: float) -> list[Segment]:
        return rounded_ring(half_u + away, half_v + away, corner + away, left)

    mill(state, given, Spigot(half_u, given.size("_AP1") / 2.0, ring), math.radians(given.number("_STA")), left)


def circle(state: State, given: Arguments) -> None:
    """CYCLE77: _PRAD is the diameter of the spigot, _AP1 that of the blank."""
    half, left = given.needed("_PRAD") / 2.0, turns_left(state, given, outside=True)
    mill(state, given, Spigot(half, given.size("_AP1") / 2.0, lambda away: circle_ring(half + away, left)), 0.0, left)


def mill(state: State, given: Arguments, spigot: Spigot, angle_rad: float, left: bool) -> None:
    """Rough or finish, lap by lap, then leave to the retraction plane."""
    given.older_form(*MODES)
    if state.spindle_direction == 0:
        raise RefusedError(given.cycle, "needs a turning spindle; write S and M3 before")
    heights, radius = levels(state, given), cutter_radius(state, given.cycle)
    work, side, base = given.whole("_VARI", 0, 9), given.size("_FAL"), given.size("_FALD")
    if work not in (1, 2):
        raise RefusedError(f"{given.cycle} _VARI", f"is {work}; read are 1 roughing and 2 finishing (61102)")
    if 0.0 < spigot.blank < spigot.half:
        raise RefusedError(f"{given.cycle} _AP1", "the blank is smaller than the spigot")
    if base > abs(heights.depth - heights.surface):
        raise RefusedError(f"{given.cycle} _FALD", "is more than the spigot is high")
    away = radius + side if work == 1 else radius
    floor = heights.depth - heights.down * base if work == 1 else heights.depth
    most = 0.0 if work == 2 and side == 0.0 < base else given.size("_MID")
    shape = Shape(state, (given.length("_PA"), given.length("_PO")), angle_rad)
    beside = max(spigot.blank + radius + given.size("SDIS"), spigot.half + side + 2.0 * radius)
    contour, middle = spigot.half + away, (beside + spigot.half + away) / 2.0
    turn = -math.pi if left else math.pi
    feed, down_feed = given.number("_FFP1") * state.feed_unit_mm, given.number("_FFD") * state.feed_unit_mm
    to(state, heights.back)
    shape.rapid((beside, 0.0))
    to(state, heights.start)
    for level in steps(state, given, heights.surface, floor, most):
        shape.line((beside, 0.0), down_feed, level)
        shape.arc(Segment((contour, 0.0), (middle, 0.0), turn), feed)
        shape.along(spigot.ring(away), feed)
        shape.arc(Segment((beside, 0.0), (middle, 0.0), turn), feed)
    to(state, heights.back)
