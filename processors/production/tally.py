"""The sums of one shift of a machine: seconds by time element, stops by reason, parts, energy; all of bounded size.

planned time = production + setup + delay + down + unknown. What the machine does beside planned time (in a break, outside all
shifts) is counted apart, so that none of these shares can exceed 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from processors.production.calendar import Slot
from processors.production.doing import Doing, Kind

REASONS_MAX, REASON_MAX = 24, 80
OTHER = "other"
_FIELDS = {
    Kind.PRODUCTION: "production_s",
    Kind.SETUP: "setup_s",
    Kind.DELAY: "delay_s",
    Kind.DOWN: "down_s",
    Kind.UNKNOWN: "unknown_s",
}


@dataclass(frozen=True, slots=True)
class Stop:
    """The stops for one reason within a shift."""

    kind: Kind
    seconds: float = 0.0
    count: int = 0


@dataclass(frozen=True, slots=True)
class Tally:
    """The sums. shift None: no shift; begin_s, end_s: of the shift; began_s: when it was first looked at.

    has_calendar: without one, no time is planned, and the elements are of the whole day
    beside_s: produced in breaks or outside all shifts
    made, good, scrap: parts that ended in the shift, and what is known of their quality
    judged: of them, parts with an ideal time; ideal_s, judged_s: theirs, and the production time that they took
    made_s: production time of all complete parts that ended in the shift
    energy_kwh: of energy_s seconds in which the power was known
    """

    shift: str | None
    begin_s: float
    end_s: float
    began_s: float
    has_calendar: bool
    planned_s: float = 0.0
    production_s: float = 0.0
    setup_s: float = 0.0
    delay_s: float = 0.0
    down_s: float = 0.0
    unknown_s: float = 0.0
    beside_s: float = 0.0
    stops: Mapping[str, Stop] = field(default_factory=dict)
    made: int = 0
    good: int = 0
    scrap: int = 0
    judged: int = 0
    ideal_s: float = 0.0
    judged_s: float = 0.0
    made_s: float = 0.0
    energy_kwh: float = 0.0
    energy_s: float = 0.0

    def is_of(self, slot: Slot) -> bool:
        """Return True if a slot belongs to this shift."""
        return self.shift == slot.shift and self.begin_s == slot.begin_s

    @property
    def is_empty(self) -> bool:
        """True outside all shifts if nothing was made there: nobody has to hear of it."""
        return self.shift is None and self.has_calendar and not (self.beside_s or self.made)


def opened(slot: Slot, at_s: float, *, has_calendar: bool) -> Tally:
    """Return the empty tally of a slot's shift, first looked at now."""
    return Tally(slot.shift, slot.begin_s, slot.end_s, at_s, has_calendar)


def spent(tally: Tally, slot: Slot, doing: Doing, seconds: float, *, is_new: bool) -> Tally:
    """Return the tally with time spent in one way within one slot; is_new: a stop begins with it."""
    if seconds <= 0.0:
        return tally
    if tally.has_calendar and not slot.is_planned:
        return replace(tally, beside_s=tally.beside_s + seconds) if doing.kind is Kind.PRODUCTION else tally
    name = _FIELDS[doing.kind]
    added: dict[str, float] = {name: getattr(tally, name) + seconds}
    if slot.is_planned:
        added["planned_s"] = tally.planned_s + seconds
    if doing.kind is Kind.PRODUCTION:
        return replace(tally, **added)  # type: ignore[arg-type]  # floats only
    return replace(tally, stops=_with_stop(tally.stops, doing, seconds, is_new), **added)  # type: ignore[arg-type]


def with_part(tally: Tally, *, active_s: float | None, ideal_s: float | None) -> Tally:
    """Return the tally with one more part; active_s None: it is not complete, so it tells nothing of how fast it was made."""
    tally = replace(tally, made=tally.made + 1)
    if active_s is None:
        return tally
    tally = replace(tally, made_s=tally.made_s + active_s)
    if ideal_s is None:
        return tally
    return replace(tally, judged=tally.judged + 1, ideal_s=tally.ideal_s + ideal_s, judged_s=tally.judged_s + active_s)


def with_quality(tally: Tally, before: bool | None, now: bool) -> Tally:
    """Return the tally with what was said of a part: good or scrap, in place of what was said of it before."""
    good = tally.good + (now is True) - (before is True)
    scrap = tally.scrap + (now is False) - (before is False)
    return replace(tally, good=good, scrap=scrap)


def _with_stop(stops: Mapping[str, Stop], doing: Doing, seconds: float, is_new: bool) -> Mapping[str, Stop]:
    reason = doing.reason[:REASON_MAX]
    if reason not in stops and len(stops) >= REASONS_MAX:
        reason = OTHER
    known = stops.get(reason)
    if known is None:
        return {**stops, reason: Stop(doing.kind, seconds, 1)}
    return {**stops, reason: Stop(known.kind, known.seconds + seconds, known.count + is_new)}
