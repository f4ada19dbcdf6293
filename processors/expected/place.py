"""The place of a machine within the line that runs: how far it has come, and how far that may be off.

    along += v Δt        doubt = v Δt of the sample in which the line was first told

A control tells of a line some time after it has begun, so the machine is between `along` and `along + doubt`; to either side
comes what it moves in SLACK_S, for a twin whose line begins or ends a little sooner.
"""

from typing import NamedTuple

SLACK_S = 0.3
BEYOND = 1.05
"""So much longer than it is, a line has been begun again."""
DT_S_MAX = 10.0


class Place(NamedTuple):
    """program, line, tool: as told last, at `at_s`, with that feed; along_mm, doubt_mm: since the line was first told."""

    program: str = ""
    line: int | None = None
    tool: int | None = None
    at_s: float = 0.0
    feed_mm_min: float | None = None
    along_mm: float = 0.0
    doubt_mm: float = 0.0


def placed(
    before: Place, where: tuple[str, int | None, int | None], at_s: float, feed_mm_min: float | None, planned_mm_min: float = 0.0
) -> Place:
    """Return the place after one more sample. where: program, line, tool; planned_mm_min: of the line

    >>> begun = placed(Place("O1", 6, 3, 10.0, 600.0), ("O1", 7, 3), 11.0, 1200.0)
    >>> begun.along_mm, begun.doubt_mm, placed(begun, ("O1", 7, 3), 12.0, 1200.0).along_mm
    (0.0, 20.0, 20.0)
    """
    since_s = min(max(at_s - before.at_s, 0.0), DT_S_MAX)
    feeds = [one for one in (before.feed_mm_min, feed_mm_min) if one is not None]
    if where != (before.program, before.line, before.tool):
        return tuple.__new__(Place, (*where, at_s, feed_mm_min, 0.0, max(feed_mm_min or 0.0, planned_mm_min) / 60.0 * since_s))
    went_mm = sum(feeds) / len(feeds) / 60.0 * since_s if feeds else 0.0
    return tuple.__new__(Place, (*where, at_s, feed_mm_min, before.along_mm + went_mm, before.doubt_mm))


def window_mm(place: Place) -> tuple[float, float] | None:
    """Return between which distances since the line's beginning the machine is; None where the control tells no feed."""
    if place.feed_mm_min is None:
        return None
    slack_mm = place.feed_mm_min / 60.0 * SLACK_S
    return place.along_mm - slack_mm, place.along_mm + place.doubt_mm + slack_mm
