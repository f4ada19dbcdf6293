"""Bounds of a clock's offset: what each look at the control's clock proves, and what many of them prove together.

An offset is the control's clock minus the edge's, in seconds. A clock that was read over a round trip proves an interval: it was
read somewhere between question and answer, and shows the start of the step of its resolution that it was in (clocks truncate):

    control - edge - round_trip/2  <=  offset  <=  control - edge + round_trip/2 + resolution

With readings at different phases of the second such intervals overlap by little, and the offset lies in what is left (`agreed`).

What comes one way only (a stamp, a document with the time of its making) was made before it arrived, so its time minus its
arrival is a lower bound. It is below the offset by its latency, and by what the clock's resolution hid. How large a latency is
cannot be known from one way, so this is assumed: of `QUICK_AMONG` documents one took no more than a stated latency L, and so did
one of any `QUICK_IN_ARC` that arrived in one arc of the clock's second; of fewer documents, one took no more than 2 L. A document
that took L at most and arrives L to L + h after a full second is below the offset by L + h at most. So h is the shortest arc that
holds `QUICK_IN_ARC` arrivals wherever it lies (`arc_holding`), and the whole second where there are fewer (`above`). An arc with
a single arrival would not do: that document may have been a slow one.

A bound ages: a clock may have drifted since, by as much as `DRIFT_PPM_MAX`.

Marzullo, K.: Maintaining the time in a distributed system, Stanford, 1984 (as in NTP, RFC 5905, 11.2.1).
"""

from collections.abc import Sequence
from typing import NamedTuple

from edge.sample import ClockReading

DRIFT_PPM_MAX = 500.0
"""The fastest drift of a clock against another: a quartz is within 100, and NTP turns a clock by 500 at most."""
ROUNDING_MS = 1.0
"""The error of times that are whole milliseconds."""
QUICK_AMONG, QUICK_IN_ARC = 12, 8
"""Documents of which one at least took no more than the stated latency."""
NEWEST_WEIGHT = 1.5
"""The weight of the newest bound against 1 of each other: where two disagree, the newer one is believed."""


class Bound(NamedTuple):
    """The offset was in `low_s` ... `high_s` at the edge's monotonic time `at_s`."""

    at_s: float
    low_s: float
    high_s: float

    @property
    def offset_s(self) -> float:
        """The middle."""
        return (self.low_s + self.high_s) / 2.0

    @property
    def spread_s(self) -> float:
        """Half the width: the offset is within so much of the middle."""
        return (self.high_s - self.low_s) / 2.0

    def aged(self, at_s: float) -> "Bound":
        """Return what is left of it at another time.

        >>> Bound(0.0, 1.0, 2.0).aged(1000.0)
        Bound(at_s=1000.0, low_s=0.5, high_s=2.5)
        """
        wider_s = abs(at_s - self.at_s) * DRIFT_PPM_MAX * 1e-6
        return Bound(at_s, self.low_s - wider_s, self.high_s + wider_s)

    def moved(self, by_s: float) -> "Bound":
        """Return it moved `by_s`, for an edge whose own clock was set."""
        return Bound(self.at_s, self.low_s + by_s, self.high_s + by_s)

    def meets(self, other: "Bound") -> bool:
        """Return whether both can be true."""
        return self.low_s <= other.high_s and other.low_s <= self.high_s

    def both(self, other: "Bound") -> "Bound":
        """Return what is left where both are true; they have to meet."""
        return Bound(self.at_s, max(self.low_s, other.low_s), min(self.high_s, other.high_s))


class OneWay(NamedTuple):
    """Evidence that came one way within a bucket: the offset is above `low_s`, the largest lower bound of them.

    latency_s: what the quick ones took at most
    resolution_s: the step of the clock, the finest that they show
    phases: when they arrived, in steps of the clock modulo 1
    """

    at_s: float
    low_s: float
    latency_s: float
    resolution_s: float = 0.0
    phases: tuple[float, ...] = ()

    @property
    def doubt_s(self) -> float:
        """Return how far below the offset the bound of a quick one is at most."""
        return self.latency_s + self.resolution_s

    def moved(self, by_s: float) -> "OneWay":
        """Return it moved `by_s`, for an edge whose own clock was set."""
        phases = tuple((phase - by_s / self.resolution_s) % 1.0 for phase in self.phases)
        return self._replace(low_s=self.low_s + by_s, phases=phases)


class Agreement(NamedTuple):
    """The overlap of most bounds, and how many they are."""

    bound: Bound
    number: int


def of_reading(reading: ClockReading, at_s: float) -> Bound:
    """Return what a reading over a round trip proves.

    A clock of whole seconds, read within 20 ms:

    >>> of_reading(ClockReading(1_700_000_003_000, 1_700_000_000_500, 20, 1000), 7.0)
    Bound(at_s=7.0, low_s=2.489, high_s=3.511)
    """
    ahead_ms, half_ms = reading.control_ms - reading.edge_ms, reading.round_trip_ms / 2.0
    low_ms, high_ms = ahead_ms - half_ms - ROUNDING_MS, ahead_ms + half_ms + max(reading.resolution_ms, 1)
    return Bound(at_s, low_ms / 1000.0, (high_ms + ROUNDING_MS) / 1000.0)


def arc_holding(phases: Sequence[float], number: int) -> float:
    """Return the shortest arc of a circle of length 1 that holds `number` of these phases wherever it lies; 1 at most.

    >>> arc_holding([0.25, 0.5, 0.875], 1), arc_holding([0.25, 0.5, 0.875], 2), arc_holding([0.25, 0.5, 0.875], 4)
    (0.375, 0.75, 1.0)
    """
    if len(phases) < number:
        return 1.0
    ordered = sorted(phases)
    following = [*ordered[number:], *(phase + 1.0 for phase in ordered[:number])]
    return max(right - left for left, right in zip(ordered, following, strict=True))


def agreed(bounds: Sequence[Bound], at_s: float) -> Agreement:
    """Return where most of them overlap, as of `at_s`; the newest comes last. There has to be one.

    >>> agreed([Bound(0.0, 1.0, 2.0), Bound(0.0, 1.5, 2.5), Bound(0.0, 8.0, 9.0)], 0.0)
    Agreement(bound=Bound(at_s=0.0, low_s=1.5, high_s=2.0), number=2)
    """
    edges = list[tuple[float, int, float]]()
    for place, bound in enumerate(bounds):
        now, weight = bound.aged(at_s), NEWEST_WEIGHT if place == len(bounds) - 1 else 1.0
        edges += [(now.low_s, 0, weight), (now.high_s, 1, weight)]
    edges.sort()
    total = best = 0.0
    number = best_number = 0
    low_s = high_s = edges[0][0]
    for (at, is_end, weight), following in zip(edges, [*edges[1:], edges[-1]], strict=True):
        total, number = (total - weight, number - 1) if is_end else (total + weight, number + 1)
        if total > best:
            best, best_number, low_s, high_s = total, number, at, following[0]
    return Agreement(Bound(at_s, low_s, high_s), best_number)


def above(ways: Sequence[OneWay], at_s: float) -> Bound:
    """Return the offset, from what came one way.

    The largest of several is left out, and its phases with it: one stamp from the future is an error of the control's, and no
    offset.

    >>> above([OneWay(0.0, low_s, 1.0) for low_s in (0.5, 0.8, 0.9, 77.0)], 0.0)
    Bound(at_s=0.0, low_s=0.9, high_s=1.9)

    Upwards, the clock may have drifted since the oldest of them came, and with it the phase at which they arrived; and two
    documents are few:

    >>> above([OneWay(0.0, 0.5, 0.5, 1.0, (0.0, 0.5))], 200.0)
    Bound(at_s=200.0, low_s=0.4, high_s=2.6)
    """
    drift = DRIFT_PPM_MAX * 1e-6
    *others, largest = sorted(ways, key=lambda way: way.low_s - abs(at_s - way.at_s) * drift)
    kept = others or [largest]
    resolution_s = min(way.resolution_s for way in kept)
    phases = [phase for way in kept if way.resolution_s == resolution_s for phase in way.phases]
    is_few = 0 < sum(len(way.phases) for way in kept) < QUICK_AMONG
    latency_s = max(way.latency_s for way in kept) * (2.0 if is_few else 1.0)
    hidden_s = resolution_s * arc_holding(phases, QUICK_IN_ARC)
    aged_s = max(abs(at_s - way.at_s) for way in kept) * drift
    low_s = kept[-1].low_s - abs(at_s - kept[-1].at_s) * drift
    return Bound(at_s, low_s, max(way.low_s for way in kept) + latency_s + hidden_s + aged_s)
