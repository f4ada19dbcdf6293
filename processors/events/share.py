"""Share of time in which a machine was ACTIVE: of a rolling window, in as many slots as a state can carry, and of today.

Time in which the state was not known (offline, null, a hole) is neither: the share is of what was seen.
"""

from dataclasses import dataclass
from math import floor

SLOTS = 96
DAY_S = 86_400.0


@dataclass(frozen=True, slots=True)
class Slot:
    """A slot of the window by its number since 1970: seconds ACTIVE, and seconds in which the state was known."""

    number: int
    active_s: float = 0.0
    seen_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Shares:
    """The window's slots, oldest first, and today."""

    slots: tuple[Slot, ...] = ()
    day: Slot = Slot(0)


def with_time(shares: Shares, at_s: float, dt_s: float, *, is_active: bool, window_s: float, day_begins_s: float) -> Shares:
    """Add the `dt_s` that end at `at_s`; they belong to the slot in which they end."""
    slot_s = window_s / SLOTS
    number, day = floor(at_s / slot_s), floor((at_s - day_begins_s) / DAY_S)
    slots = shares.slots
    today = shares.day if shares.day.number == day else Slot(day)
    if slots and slots[-1].number == number and slots[0].number > number - SLOTS:  # no slot begins and none ends
        return Shares((*slots[:-1], _more(slots[-1], dt_s, is_active)), _more(today, dt_s, is_active))
    last = slots[-1] if slots and slots[-1].number == number else Slot(number)
    before = slots[:-1] if slots and slots[-1].number == number else slots
    kept = tuple(slot for slot in before if number - SLOTS < slot.number < number)
    return Shares((*kept[-SLOTS:], _more(last, dt_s, is_active)), _more(today, dt_s, is_active))


def share_pct(slots: tuple[Slot, ...]) -> tuple[float | None, float]:
    """The share in percent, None where nothing was seen; and the seconds that were seen.

    >>> share_pct((Slot(1, 30.0, 60.0), Slot(2, 0.0, 60.0)))
    (25.0, 120.0)
    """
    seen_s = sum(slot.seen_s for slot in slots)
    return (100.0 * sum(slot.active_s for slot in slots) / seen_s if seen_s > 0.0 else None), seen_s


def _more(slot: Slot, dt_s: float, is_active: bool) -> Slot:
    return Slot(slot.number, slot.active_s + (dt_s if is_active else 0.0), slot.seen_s + dt_s)
