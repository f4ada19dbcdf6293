"""A spindle's speed: steady, or changing, in which case its load speeds it up or runs it down and is no cut.

It is steady where all that was told of it within `settle_s` is within a band of 2 %, at least 25 rev/min, and so is what was
commanded. The slow drift of a lathe at constant surface speed is steady.
"""

from typing import NamedTuple

BAND_PART, BAND_RPM = 0.02, 25.0
_FINE = 0.125
"""The part of the band that a new value has to differ by to be remembered."""
POINTS_MAX = 64
Points = tuple[tuple[float, float], ...]
"""(s, rev/min): values, each held until the next one; the first one has held at the beginning of the window."""


class SpindleSpeed(NamedTuple):
    """The speed of late. since_s: known since then, None = not known"""

    since_s: float | None = None
    told: Points = ()
    commanded: Points = ()

    def seen(self, at_s: float, rpm: float, command_rpm: float | None, settle_s: float) -> "SpindleSpeed":
        """Return the speed with what holds at this moment; itself where nothing is new."""
        points = self.told
        if len(points) == 1 and command_rpm is None and not self.commanded and abs(rpm - points[0][1]) <= _FINE * BAND_RPM:
            return self  # as nearly always
        fine = _FINE * max(BAND_RPM, BAND_PART * abs(rpm))
        told = _followed(self.told, at_s, rpm, fine, settle_s)
        commanded = () if command_rpm is None else _followed(self.commanded, at_s, command_rpm, fine, settle_s)
        if self.since_s is not None and told is self.told and commanded is self.commanded:
            return self
        return SpindleSpeed(at_s if self.since_s is None else self.since_s, told, commanded)

    def is_steady(self, at_s: float, settle_s: float) -> bool:
        """Return True where the speed has been steady for long enough.

        >>> speed = SpindleSpeed().seen(0.0, 3000.0, None, 1.0).seen(5.0, 3040.0, None, 1.0).seen(9.0, 4000.0, None, 1.0)
        >>> speed.is_steady(9.5, 1.0), speed.seen(10.0, 4000.0, None, 1.0).is_steady(10.0, 1.0)
        (False, True)
        """
        if self.since_s is None or at_s - self.since_s < settle_s:
            return False
        return (len(self.told) == 1 or _is_narrow(self.told)) and (len(self.commanded) < 2 or _is_narrow(self.commanded))


def _is_narrow(points: Points) -> bool:
    values = [rpm for _, rpm in points]
    low, high = min(values), max(values)
    return high - low <= max(BAND_RPM, BAND_PART * max(abs(low), abs(high)))


def _followed(points: Points, at_s: float, rpm: float, fine: float, settle_s: float) -> Points:
    """Return the window with a value, without what is over; itself where nothing is new."""
    if not points:
        return ((at_s, rpm),)
    if not abs(rpm - points[-1][1]) <= fine:
        points = (*points[-POINTS_MAX:], (at_s, rpm))
    first = 0
    while first + 1 < len(points) and points[first + 1][0] <= at_s - settle_s:
        first += 1
    return points[first:] if first else points
