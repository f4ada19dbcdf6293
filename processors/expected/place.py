"""The place of a machine within the line that runs: how far it has come, and how far that may be off.

    along += v Δt        planned += planned v Δt while it feeds        doubt = v Δt of the sample in which the line was first told

A control tells of a line some time after it has begun, so the machine is between `along` and `along + doubt`; to either side
comes what it moves in SLACK_S, for a twin whose line begins or ends a little sooner. Where the feed that is told is not the
planned one, the machine is taken to be anywhere between the places that both lead to: a told feed may be wrong.
"""

from typing import NamedTuple

SLACK_S = 0.3
BEYOND = 1.05
"""So much longer than it is, a line has been begun again."""
DT_S_MAX = 10.0
ANYWHERE_MM = 1e9


class Place(NamedTuple):
    """program, line, tool: as told last, at `at_s`, with that feed; along_mm, planned_mm, doubt_mm: since the line was told."""

    program: str = ""
    line: int | None = None
    tool: int | None = None
    at_s: float = 0.0
    feed_mm_min: float | None = None
    along_mm: float = 0.0
    planned_mm: float = 0.0
    doubt_mm: float = 0.0


def placed(
    before: Place, where: tuple[str, int | None, int | None], at_s: float, feed_mm_min: float | None, planned_mm_min: float = 0.0
) -> Place:
    """Return the place after one more sample. where: program, line, tool; planned_mm_min: of the line

    >>> begun = placed(Place("O1", 6, 3, 10.0, 600.0), ("O1", 7, 3), 11.0, 1200.0)
    >>> begun.along_mm, begun.doubt_mm, placed(begun, ("O1", 7, 3), 12.0, 1200.0, 1500.0)[5:]
    (0.0, 20.0, (20.0, 25.0, 20.0))
    """
    since_s = min(max(at_s - before.at_s, 0.0), DT_S_MAX)
    feeds = [one for one in (before.feed_mm_min, feed_mm_min) if one is not None]
    if before.line is None:  # it may be anywhere in the line
        return tuple.__new__(Place, (*where, at_s, feed_mm_min, 0.0, 0.0, ANYWHERE_MM))
    if where != (before.program, before.line, before.tool):
        return tuple.__new__(
            Place, (*where, at_s, feed_mm_min, 0.0, 0.0, max(feed_mm_min or 0.0, planned_mm_min) / 60.0 * since_s)
        )
    went_mm = sum(feeds) / len(feeds) / 60.0 * since_s if feeds else 0.0
    planned_mm = planned_mm_min / 60.0 * since_s if went_mm > 0.0 else 0.0
    gone = (before.along_mm + went_mm, before.planned_mm + planned_mm, before.doubt_mm)
    return tuple.__new__(Place, (*where, at_s, feed_mm_min, *gone))


def window_mm(place: Place) -> tuple[float, float] | None:
    """Return between which distances since the line's beginning the machine is; None where the control tells no feed."""
    if place.feed_mm_min is None:
        return None
    slack_mm = place.feed_mm_min / 60.0 * SLACK_S
    from_mm, to_mm = min(place.along_mm, place.planned_mm), max(place.along_mm, place.planned_mm)
    return from_mm - slack_mm, to_mm + place.doubt_mm + slack_mm
