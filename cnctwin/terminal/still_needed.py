"""A plan for what there is too little of: how much was seen, how much is needed, and when that will be at the present rate."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

DATED_S = 1e9
"""Times beyond it count from 1970."""
YEARS_MAX = 100.0


@dataclass(frozen=True, slots=True)
class StillNeeded:
    """One thing that there is too little of.

    what: in words; seen_h, needed_h: hours of it; over_h: the length of the stretch in which it was seen
    end_s: the end of that stretch, s since 1970; of a run without a date, any smaller number
    """

    what: str
    seen_h: float
    needed_h: float
    over_h: float
    end_s: float = 0.0

    @property
    def waits_h(self) -> float | None:
        """Return how long it takes at the rate of the stretch; None where nothing of it was seen."""
        if self.seen_h <= 0.0 or self.over_h <= 0.0:
            return None
        return max(0.0, self.needed_h - self.seen_h) * self.over_h / self.seen_h

    @property
    def at(self) -> str | None:
        """Return the moment in UTC at which there is enough; None where that cannot be told."""
        waits_h = self.waits_h
        if waits_h is None or self.end_s < DATED_S or waits_h > YEARS_MAX * 8766.0:
            return None
        return datetime.fromtimestamp(self.end_s + 3600.0 * waits_h, UTC).strftime("%Y-%m-%d %H:%M")

    def sentence(self) -> str:
        """Say it in one line.

        >>> StillNeeded("cutting", 10.0, 40.0, 48.0, 1_795_327_200.0).sentence()
        'cutting: 10 h of 40 h seen in 48 h; 30 h more, at the present rate in 6 days (2026-11-28 06:00 UTC)'
        >>> StillNeeded("cutting", 0.0, 1.0, 24.0).sentence()
        'cutting: none of the 1 h needed seen in 24 h; at the present rate there never will be'
        """
        waits_h = self.waits_h
        if waits_h is None:
            return f"{self.what}: none of the {length(self.needed_h)} needed seen in {length(self.over_h)}; " + (
                "at the present rate there never will be"
            )
        when = "" if self.at is None else f" ({self.at} UTC)"
        more = f"{length(self.needed_h - self.seen_h)} more, at the present rate in {length(waits_h)}{when}"
        return f"{self.what}: {length(self.seen_h)} of {length(self.needed_h)} seen in {length(self.over_h)}; {more}"

    def as_json(self) -> dict[str, Any]:
        """Return it for a program to read."""
        figures = {name: getattr(self, name) for name in ("what", "seen_h", "needed_h", "over_h", "waits_h", "at")}
        return figures | {"sentence": self.sentence()}


def length(hours: float) -> str:
    """Return a length of time as people say it.

    >>> length(0.005), length(0.5), length(6.04), length(200.0)
    ('18 s', '30 min', '6.04 h', '8.33 days')
    """
    if hours < 120.0 / 3600.0:
        return f"{3600.0 * hours:.3g} s"
    if hours < 1.0:
        return f"{60.0 * hours:.3g} min"
    return f"{hours:.3g} h" if hours <= 96.0 else f"{hours / 24.0:.3g} days"
