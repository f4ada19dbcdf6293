"""CYCLE83: deep-hole drilling, with chip breaking (VARI = 0) or chip removal (VARI = 1).

The strokes, as the manual gives them: the first goes to FDEP, or by FDPR. DAM > 0 takes that much off each further stroke as
long as the stroke stays longer than DAM; then strokes of DAM follow as long as more than twice DAM is left; the last two are of
equal length. DAM < 0 is a factor, down to _MDEP at least. DAM = 0 keeps the stroke. FRF is a factor on the feed of the first
stroke.

Chip removal leaves to the start and comes back in rapid to the limit distance above the last depth: _DIS1, or 0.6 mm, over
30 mm of depth a fiftieth of it, at most 7 mm. Chip breaking draws back by _VRT, or 1 mm, with feed.
"""

from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.cycles.levels import Levels, fed, levels, pause, to
from twin.programs.sinumerik.state import State

SHALLOW_MM: Final = 30.0
LIMIT_MM: Final = 0.6
LIMIT_MM_MAX: Final = 7.0
DRAW_BACK_MM: Final = 1.0
ROUNDING_MM: Final = 1e-9
DEGRESSION_DIGIT: Final = 10_000_000


def strokes(total: float, first: float, degression: float, least: float, many_max: int) -> list[float]:
    """The depths of all strokes below the reference plane, mm, rising to `total`.

    >>> strokes(145.0, 50.0, 20.0, 0.0, 100)
    [50.0, 80.0, 100.0, 120.0, 132.5, 145.0]
    """
    first = min(first, total)
    found, done, stroke = [first], first, first
    while done < total - ROUNDING_MM:
        left = total - done
        if degression > 0.0:
            if stroke - degression > degression:
                stroke = min(stroke - degression, left)
            elif left > 2.0 * degression:
                stroke = degression
            else:
                found += [done + left / 2.0, total]
                return found
        elif degression < 0.0:
            stroke = max(stroke * -degression, least)
        stroke = min(stroke, left)
        done = total if left - stroke < ROUNDING_MM else done + stroke
        found.append(done)
        if len(found) > many_max or stroke < ROUNDING_MM:
            raise RefusedError(
                "CYCLE83", f"takes more than {many_max} strokes; a smaller degression, or _MDEP, or Settings.pecks_max"
            )
    return found


def first_stroke(given: Arguments, heights: Levels, total: float) -> float:
    """FDPR, else FDEP, else the whole depth. RefusedError beyond it (61107)."""
    first = given.size("FDPR")
    if first == 0.0 and given.has("FDEP"):
        first = (given.length("FDEP") - heights.surface) * heights.down
    elif first == 0.0:
        first = total
    if not 0.0 < first <= total:
        raise RefusedError("CYCLE83 FDEP", f"the first stroke of {first:g} mm is not within the depth of {total:g} mm (61107)")
    return first


def deep_hole(state: State, given: Arguments) -> None:
    """CYCLE83."""
    given.only_zero("_GMODE")
    if given.whole("_AMODE", 0, 999_999_999) // DEGRESSION_DIGIT:
        raise RefusedError("CYCLE83 _AMODE", "degression in per cent is not read; write DAM as a length, or as a negative factor")
    heights = levels(state, given)
    total = abs(heights.depth - heights.surface)
    degression = given.number("DAM") if given.number("DAM") < 0.0 else given.length("DAM")
    if degression < -1.0:
        raise RefusedError("CYCLE83 DAM", "as a factor is from -0.001 to -1")
    depths = strokes(total, first_stroke(given, heights, total), degression, given.size("_MDEP"), state.settings.pecks_max)
    factor = given.number("FRF") or 1.0
    factor = factor / 100.0 if factor > 1.0 else factor
    if factor <= 0.0:
        raise RefusedError("CYCLE83 FRF", "a factor of the feed is from 0.001 to 1")
    removes = given.whole("VARI", 0, 1) == 1
    last_pause = given.number("_DTD") or given.number("DTB")
    to(state, heights.start)
    feed: float | None = state.feed_word * factor
    for place, depth in enumerate(depths):
        fed(state, heights.surface + heights.down * depth, feed)
        feed = None
        is_last = place + 1 == len(depths)
        pause(state, last_pause if is_last else given.number("DTB"))
        if is_last:
            break
        if removes:
            to(state, heights.start)
            pause(state, given.number("DTS"))
            reach = depth - (given.size("_DIS1") or limit_distance(total))
            if heights.surface + heights.down * reach != heights.start:
                to(state, heights.surface + heights.down * max(reach, 0.0))
        else:
            fed(state, heights.surface + heights.down * (depth - (given.size("_VRT") or DRAW_BACK_MM)), None)
    to(state, heights.back)


def limit_distance(total: float) -> float:
    """Return how far above the last depth rapid ends.

    >>> limit_distance(20.0), limit_distance(100.0), limit_distance(1000.0)
    (0.6, 2.0, 7.0)
    """
    return LIMIT_MM if total <= SHALLOW_MM else min(total / 50.0, LIMIT_MM_MAX)
