"""The place of a machine within the line that runs: how far it has come, and how far that may be off.

    along += v Δt        planned += planned v Δt while it feeds        doubt = v Δt of the sample in which the line was first told

A control tells of a line some time after it has begun, so the machine is between `along` and `along + doubt`; to either side
comes what it moves in SLACK_S, for a twin whose line begins or ends a little sooner. A line begins where the one before ends:

    began ∈ (sample before, sample]  ∩  end of the line before + lines between + n (block ± BLOCK_OFF_S)

so the doubt shrinks from line to line, as in estimation with bounded errors (Schweppe, IEEE Trans. Autom. Control 13, 1968).
`block` is what a line takes beyond the plan: however many lines are told, the first and the last are late by less than a sample,
so the sum of what lines took over what they should take shows it. An empty intersection leaves the samples alone.

Where the feed that is told is not the
planned one, the machine is taken to be anywhere between the places that both lead to: a told feed may be wrong.
"""

from typing import NamedTuple

from twin.expected.expectation import Expectation

SLACK_S = 0.3
BEYOND = 1.05
"""So much longer than it is, a line has been begun again."""
DT_S_MAX = 10.0
ANYWHERE_MM = 1e9
BLOCK_OFF_S, TIME_OFF = 0.05, 0.005
"""The most that a line's time is off the plan: for itself, and as a share of it."""
BLOCK_S_MAX, BLOCK_OVER, BLOCK_PRIOR = 0.3, 400.0, 20.0
"""The most that a line takes beyond the plan; the lines over which it is learned; those that stand for the plan at first."""
STRAY_S = 2.0
LINES_MAX, BETWEEN_S_MAX = 6, 2.0
"""Over more lines, or lines that take longer, nothing is concluded from the line before."""


class Extra(NamedTuple):
    """Sums over lines that followed each other: seconds beyond the plan, and lines."""

    seconds: float = 0.0
    lines: float = 0.0

    @property
    def block_s(self) -> float:
        """Return what a line takes beyond the plan."""
        return max(-BLOCK_S_MAX, min(BLOCK_S_MAX, self.seconds / (self.lines + BLOCK_PRIOR)))

    @property
    def off_s(self) -> float:
        """Return how far `block_s` may be off: more while few lines have been seen."""
        return BLOCK_OFF_S * (1.0 + BLOCK_PRIOR / (self.lines + 1.0))

    def after(self, seconds: float, lines: int) -> "Extra":
        """Return the sums after one more line was told, and those between.

        >>> found = Extra()
        >>> for late_s in (0.9, -0.8, 0.7, -0.6) * 40:
        ...     found = found.after(late_s, 2)
        >>> round(found.block_s, 2)
        0.02
        """
        if abs(seconds) > STRAY_S:
            return self
        kept = 1.0 - lines / BLOCK_OVER
        return Extra(kept * self.seconds + seconds, kept * self.lines + lines)


class Place(NamedTuple):
    """program, line, tool: as told last, at `at_s`, with that feed; along_mm, planned_mm, doubt_mm: since the line was told

    run: index of the run in the expectation; sure_mm: the least that it had gone when the line was told
    extra: what lines took beyond the plan
    """

    program: str = ""
    line: int | None = None
    tool: int | None = None
    at_s: float = 0.0
    feed_mm_min: float | None = None
    along_mm: float = 0.0
    planned_mm: float = 0.0
    doubt_mm: float = 0.0
    run: int | None = None
    sure_mm: float = 0.0
    extra: Extra = Extra()


class Began(NamedTuple):
    """The begin of a line: between which times, in which run, and what lines took beyond the plan until then."""

    from_s: float
    to_s: float
    run: int | None
    extra: Extra


def began(expectation: Expectation, before: Place, where: tuple[str, int, int | None], at_s: float, override: float) -> Began:
    """Return when a line began that is told now for the first time, from where the machine was in the line before."""
    program, line, tool = where
    ended = before.run if before.program == program and (before.run or 0) < len(expectation.runs) else None
    run = expectation.followed(ended, line, tool)
    told = Began(max(before.at_s, at_s - DT_S_MAX), at_s, run, before.extra)
    if run is None or ended is None or not 0 < run - ended <= LINES_MAX or before.doubt_mm >= ANYWHERE_MM:
        return told
    last, window, lines = expectation.runs[ended], window_mm(before, 0.0), run - ended
    between_s = sum(one.time_s for one in expectation.runs[ended + 1 : run])
    if window is None or between_s > BETWEEN_S_MAX or last.feed_mm_min <= 0.0 or override <= 0.0:
        return told
    planned_mm_s = last.feed_mm_min * override / 60.0
    slow, fast = sorted((last.feed_mm_min / 60.0, planned_mm_s))
    off_s = lines * before.extra.off_s + TIME_OFF * last.time_s
    sure_s = before.at_s + between_s + lines * before.extra.block_s
    from_s = max(told.from_s, sure_s + max(last.length_mm - window[1], 0.0) / fast - off_s)
    to_s = min(at_s, sure_s + max(last.length_mm - window[0], 0.0) / slow + off_s)
    should_s = (last.length_mm - before.along_mm + before.sure_mm) / planned_mm_s + between_s
    extra = before.extra.after(at_s - before.at_s - should_s, lines)
    return Began(from_s, to_s, run, extra) if from_s <= to_s else told._replace(extra=extra)


def placed(
    before: Place,
    where: tuple[str, int | None, int | None],
    at_s: float,
    feed_mm_min: float | None,
    planned_mm_min: float = 0.0,
    *,
    begins: Began | None = None,
) -> Place:
    """Return the place after one more sample. where: program, line, tool; planned_mm_min: of the line; begins: where it is new

    >>> begun = placed(Place("O1", 6, 3, 10.0, 600.0), ("O1", 7, 3), 11.0, 1200.0)
    >>> begun.along_mm, begun.doubt_mm, placed(begun, ("O1", 7, 3), 12.0, 1200.0, 1500.0)[5:8]
    (0.0, 20.0, (20.0, 25.0, 20.0))
    """
    since_s = min(max(at_s - before.at_s, 0.0), DT_S_MAX)
    feeds = [one for one in (before.feed_mm_min, feed_mm_min) if one is not None]
    run, extra = (before.run, before.extra) if begins is None else (begins.run, begins.extra)
    if before.line is None:  # it may be anywhere in the line
        return tuple.__new__(Place, (*where, at_s, feed_mm_min, 0.0, 0.0, ANYWHERE_MM, run, 0.0, extra))
    if where != (before.program, before.line, before.tool):
        sure_s, since_s = (0.0, since_s) if begins is None else (at_s - begins.to_s, at_s - begins.from_s)
        along_mm = planned_mm_min / 60.0 * sure_s
        doubt_mm = max(feed_mm_min or 0.0, planned_mm_min) / 60.0 * since_s - along_mm
        return tuple.__new__(Place, (*where, at_s, feed_mm_min, along_mm, along_mm, doubt_mm, run, along_mm, extra))
    went_mm = sum(feeds) / len(feeds) / 60.0 * since_s if feeds else 0.0
    planned_mm = planned_mm_min / 60.0 * since_s if went_mm > 0.0 else 0.0
    gone = (before.along_mm + went_mm, before.planned_mm + planned_mm, before.doubt_mm, run, before.sure_mm, extra)
    return tuple.__new__(Place, (*where, at_s, feed_mm_min, *gone))


def window_mm(place: Place, slack_s: float = SLACK_S) -> tuple[float, float] | None:
    """Return between which distances since the line's beginning the machine is; None where the control tells no feed."""
    if place.feed_mm_min is None:
        return None
    slack_mm = place.feed_mm_min / 60.0 * slack_s
    from_mm, to_mm = min(place.along_mm, place.planned_mm), max(place.along_mm, place.planned_mm)
    return from_mm - slack_mm, to_mm + place.doubt_mm + slack_mm
