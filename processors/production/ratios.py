"""Availability, performance, quality and OEE out of the sums of a shift, each a number or the reason why there is none.

    availability = APT / (PBT − unknown)        ISO 22400-2 availability: APT / PBT
    performance  = Σ ideal / Σ production time  ISO 22400-2 effectiveness: PRI · PQ / APT
    quality      = good / (good + scrap)        ISO 22400-2 quality ratio: GQ / PQ
    OEE          = availability · performance · quality        ISO 22400-2 OEE index

Where less is known than a share of what there is (of planned time, of production time, of parts), a ratio is not told.
"""

from collections.abc import Mapping
from typing import NamedTuple

KNOWN_SHARE_MIN = 0.9
NO_CALENDAR = "no shift calendar: [production] calendar names a file"
NOTHING_PLANNED = "no planned time so far"
NOT_HEARD = "the machine was not heard for too much of the planned time"
NO_PART = "no complete part has ended"
NO_IDEAL = "of too many parts the ideal time is not known: cnctwin expect, or [production] ideal_s"
NO_QUALITY = "of too many parts nothing says whether they are good: the signal part_quality"


class Sums(NamedTuple):
    """The sums that the ratios take; those of several shifts or parts add up."""

    has_calendar: bool = True
    planned_s: float = 0.0
    production_s: float = 0.0
    unknown_s: float = 0.0
    ideal_s: float = 0.0
    judged_s: float = 0.0
    made_s: float = 0.0
    made: int = 0
    good: int = 0
    scrap: int = 0


class Ratio(NamedTuple):
    """A ratio, or None with the reason."""

    value: float | None
    why: str = ""


def ratios(sums: Sums, known_share_min: float = KNOWN_SHARE_MIN) -> Mapping[str, Ratio]:
    """Return the four ratios.

    >>> shift = Sums(True, 27000.0, 20250.0, 0.0, ideal_s=900.0, judged_s=1000.0, made_s=1000.0, made=20, good=19, scrap=1)
    >>> {name: round(ratio.value, 4) for name, ratio in ratios(shift).items()}
    {'availability': 0.75, 'performance': 0.9, 'quality': 0.95, 'oee': 0.6412}
    """
    found = {
        "availability": _availability(sums, known_share_min),
        "performance": _performance(sums, known_share_min),
        "quality": _quality(sums, known_share_min),
    }
    missing = next((f"{name}: {ratio.why}" for name, ratio in found.items() if ratio.value is None), "")
    if missing:
        return {**found, "oee": Ratio(None, missing)}
    product = 1.0
    for ratio in found.values():
        product *= ratio.value or 0.0
    return {**found, "oee": Ratio(product)}


def _availability(sums: Sums, known_share_min: float) -> Ratio:
    if not sums.has_calendar:
        return Ratio(None, NO_CALENDAR)
    if sums.planned_s <= 0.0:
        return Ratio(None, NOTHING_PLANNED)
    seen_s = sums.planned_s - sums.unknown_s
    if seen_s <= 0.0 or seen_s < known_share_min * sums.planned_s:
        return Ratio(None, NOT_HEARD)
    return Ratio(min(sums.production_s / seen_s, 1.0))  # rounding of the sums may go past 1


def _performance(sums: Sums, known_share_min: float) -> Ratio:
    if sums.made_s <= 0.0:
        return Ratio(None, NO_PART)
    if sums.judged_s <= 0.0 or sums.judged_s < known_share_min * sums.made_s:
        return Ratio(None, NO_IDEAL)
    return Ratio(sums.ideal_s / sums.judged_s)


def _quality(sums: Sums, known_share_min: float) -> Ratio:
    if sums.made <= 0:
        return Ratio(None, NO_PART)
    judged = sums.good + sums.scrap
    if judged <= 0 or judged < known_share_min * sums.made:
        return Ratio(None, NO_QUALITY)
    return Ratio(sums.good / judged)
