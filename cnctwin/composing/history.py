"""A machine's history as composing looks it over: what changes seldom as it was told, what changes often in windows.

A signal holds what it said last until it says something else, or that it is not known any more.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from cnctwin.errors import UsageError
from cnctwin.memory.store.contract import Query, Store, StoreError
from cnctwin.memory.store.known_before import known_before
from sparkplug.quality import Quality
from sparkplug.values import Value

STATE, PROGRAM, COOLANT = "exec_state", "program", "coolant_on"
OVERRIDES = ("feed_override_pct", "rapid_override_pct", "spindle_override_pct")
RPM, LOAD, TEMPERATURE, AMBIENT = "spindle_rpm", "spindle_load_pct", "spindle_temp_c", "ambient_temp_c"
LINE, FEED, CHANGES = "nc_line", "feed_mm_min", "tool_change_active"
SELDOM = (STATE, PROGRAM, COOLANT, *OVERRIDES)
OFTEN = (RPM, LOAD, TEMPERATURE, AMBIENT, LINE, FEED, CHANGES)
WINDOWS_MAX = 40_000
WINDOWS_MS = (100, 200, 500, 1000, 2000, 5000, 10_000, 30_000, 60_000, 300_000)
Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Between:
    """A part of the history, from its beginning to before its end."""

    from_ms: int
    to_ms: int

    @property
    def span_ms(self) -> Span:
        """Its beginning and its end."""
        return self.from_ms, self.to_ms

    @property
    def seconds(self) -> float:
        """Its length."""
        return (self.to_ms - self.from_ms) / 1000.0


@dataclass(frozen=True, slots=True)
class Course:
    """A signal over time: at t_ms[n] it said value[n], which holds until the next; None where it was not good."""

    t_ms: tuple[int, ...] = ()
    value: tuple[Value, ...] = ()

    def at(self, t_ms: float) -> Value:
        """Return what it said last at a moment; None before it said anything.

        >>> course = Course((10, 20), (1.0, None))
        >>> course.at(5), course.at(19), course.at(20)
        (None, 1.0, None)
        """
        place = bisect_right(self.t_ms, t_ms)
        return self.value[place - 1] if place else None

    def within(self, span_ms: Span) -> list[Value]:
        """Return every value that holds somewhere in [from, to), the one before it first."""
        first, last = (bisect_right(self.t_ms, t - 1) for t in span_ms)
        held = [self.at(span_ms[0] - 1)] if not (first < last and self.t_ms[first] == span_ms[0]) else []
        return [*held, *self.value[first:last]]

    def numbers(self, span_ms: Span) -> list[float]:
        """Return the numbers and flags among them."""
        return [float(v) for v in self.within(span_ms) if isinstance(v, bool | int | float)]

    def pieces(self, span_ms: Span) -> Iterator[tuple[int, int, Value]]:
        """Yield (from, to, value) over a stretch, the stretches of one value together."""
        edges = [span_ms[0], *(t for t in self.t_ms if span_ms[0] < t < span_ms[1]), span_ms[1]]
        begun, value = edges[0], self.at(edges[0])
        for t, _ in pairwise(edges[1:]):
            if self.at(t) != value:
                yield begun, t, value
                begun, value = t, self.at(t)
        yield begun, span_ms[1], value


@dataclass(frozen=True, slots=True)
class History:
    """The course of a machine in [from_ms, to_ms), looked over.

    courses: by signal, of all that said anything; told_ms: when anything was told, in order, to the window; window_ms: of those
    that change often
    """

    machine: str
    from_ms: int
    to_ms: int
    window_ms: int
    courses: dict[str, Course]
    told_ms: tuple[int, ...]

    def course(self, signal: str) -> Course:
        """Return the course of a signal; an empty one where it never said anything."""
        return self.courses.get(signal, Course())

    def windows_told(self, span_ms: Span) -> int:
        """Return the number of windows in a stretch in which anything was told."""
        first, last = (bisect_right(self.told_ms, t - 1) for t in span_ms)
        return last - first

    def has(self, *signals: str) -> bool:
        """Return True where each of the signals has a good value somewhere."""
        return all(any(v is not None for v in self.course(s).value) for s in signals)


def history_of(store: Store, machine: str, span_ms: Span | None) -> History:
    """Return the history of a machine, in all that the store has of it where no span is given. Raises UsageError, StoreError."""
    series = [s for s in store.series(machine) if s.signal in (*SELDOM, *OFTEN)]
    if not series:
        others = ", ".join(store.machines()) or "none"
        raise UsageError(f"{machine}: the store has no signal of it that a case is composed of; machines it has: {others}")
    first, last = min(s.first_us for s in series) // 1000, max(s.last_us for s in series) // 1000 + 1
    from_ms, to_ms = span_ms if span_ms is not None else (first, last)
    if to_ms <= from_ms:
        raise StoreError(f"to {to_ms} is not after from {from_ms}; give a stretch of time")
    known = known_before(store, machine, {s.signal for s in series}, from_ms)
    from_ms, to_ms = (from_ms if known else max(from_ms, first)), min(to_ms, last)
    if to_ms <= from_ms:
        raise UsageError(f"{machine}: the store has nothing of it in that stretch; `cnctwin store status` tells what it has")
    window_ms = next((w for w in WINDOWS_MS if (to_ms - from_ms) / w <= WINDOWS_MAX), WINDOWS_MS[-1])
    told: set[int] = set()
    courses: dict[str, Course] = {}
    for signals, every_ms in ((SELDOM, None), (OFTEN, window_ms)):
        for column in store.query(Query(machine, signals, from_ms, to_ms, every_ms)):
            t_ms = [t // 1000 for t in column.t_us]
            told.update(t // window_ms * window_ms for t in t_ms)
            good = [v if q is Quality.GOOD else None for v, q in zip(column.value, column.quality, strict=True)]
            if column.signal in known:
                t_ms, good = [from_ms - 1, *t_ms], [known[column.signal].value, *good]
            if t_ms:
                courses[column.signal] = Course(*_changes(zip(t_ms, good, strict=True)))
    if not told:
        raise UsageError(f"{machine}: the store has nothing of it in that stretch; `cnctwin store status` tells what it has")
    return History(machine, from_ms, to_ms, window_ms, courses, tuple(sorted(told)))


def _changes(told: Iterable[tuple[int, Value]]) -> tuple[tuple[int, ...], tuple[Value, ...]]:
    """Leave out what says the same again."""
    t_ms: list[int] = []
    value: list[Value] = []
    for t, v in told:
        if not value or v != value[-1] or type(v) is not type(value[-1]):
            t_ms.append(t)
            value.append(v)
    return tuple(t_ms), tuple(value)
