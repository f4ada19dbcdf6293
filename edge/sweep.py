"""The frame of a control that sends no documents of its own: one look at it, or one delivery of a subscription, as JSON.

The connection gathers what the control answered, call by call, with no thought of what it means, and numbers the frames of its
life; the adapter's `parse` makes samples of it. So a recorded frame is readable, can be played back, and parsing stays pure.

Accounting: each fact is one observation. A number that is left out is a frame that got lost on our way (a hole); looks that could
not be made because the control did not answer, or notifications that its server says it lost, are holes that the connection
states itself, with the most that they can have held.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from edge.errors import DocumentError
from edge.place import EDGE_RESTARTED, Place
from edge.sample import ClockReading, Drop, Gap, SampleSet

FRAME_BYTES_MAX = 4 * 1024 * 1024
FACTS_MAX = 20_000
Plain = str | int | float | bool | None


class Fact(NamedTuple):
    """One value as the control gave it. `fault`: why it gave none; `t_ms`: the control's own stamp, where it sets one."""

    key: str
    value: Plain = None
    fault: str = ""
    t_ms: int | None = None


class Hole(NamedTuple):
    """A time in which nothing could be had, ms since 1970 of the edge; `lost`: observations, the most that it can have been."""

    reason: str
    from_ms: int
    to_ms: int
    lost: int


@dataclass(frozen=True, slots=True)
class Sweep:
    """One frame. `life` is the connection's own (one for each run of the edge), `number` counts its frames from 0.

    t_ms: the edge's clock at the middle of the look; interval_ms: from look to look, 0 for a subscription
    clock: the control's clock, where this look has read it
    available: whether the control itself is there, where only its server answers; None = not said
    error: what the control answered in place of values
    """

    life: str
    number: int
    t_ms: int
    facts: tuple[Fact, ...] = ()
    holes: tuple[Hole, ...] = ()
    interval_ms: int = 0
    clock: ClockReading | None = None
    available: bool | None = None
    error: str | None = None

    def encode(self) -> bytes:
        """Return the sweep as JSON.

        >>> Sweep.decode(Sweep("a", 0, 1, (Fact("acts", 3500),)).encode()).facts
        (Fact(key='acts', value=3500, fault='', t_ms=None),)
        """
        clock = self.clock
        document = {
            "life": self.life,
            "number": self.number,
            "t_ms": self.t_ms,
            "facts": self.facts,
            "holes": self.holes,
            "interval_ms": self.interval_ms,
            "clock": None
            if clock is None
            else [clock.control_ms, clock.edge_ms, clock.round_trip_ms, clock.resolution_ms, clock.stamps_samples],
            "available": self.available,
            "error": self.error,
        }
        return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")

    @classmethod
    def decode(cls, raw: bytes) -> "Sweep":
        """Read a frame; DocumentError where it is none, or beyond the bounds."""
        if len(raw) > FRAME_BYTES_MAX:
            raise DocumentError(f"a frame of {len(raw)} bytes is above the limit of {FRAME_BYTES_MAX}")
        try:
            return _sweep(json.loads(raw))
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise DocumentError(f"no frame of a sweep: {error}") from error


def _sweep(document: Mapping[str, Any]) -> Sweep:
    facts, holes = document["facts"], document["holes"]
    if len(facts) + len(holes) > FACTS_MAX:
        raise ValueError(f"{len(facts)} facts are above the limit of {FACTS_MAX}")
    available, error = document["available"], document["error"]
    if available not in (None, True, False) or not isinstance(error, str | None):
        raise ValueError("available or error is of another type")
    clock = document["clock"]
    return Sweep(
        life=_text(document["life"]),
        number=_whole(document["number"]),
        t_ms=_whole(document["t_ms"]),
        facts=tuple(_fact(*entry) for entry in facts),
        holes=tuple(Hole(_text(why), _whole(a), _whole(b), _whole(lost)) for why, a, b, lost in holes),
        interval_ms=_whole(document["interval_ms"]),
        clock=None if clock is None else _clock(*clock),
        available=available,
        error=error,
    )


def _fact(key: Any, value: Any, fault: Any, t_ms: Any) -> Fact:
    if not isinstance(value, Plain):
        raise TypeError(f"value of {key!r} is no plain value")
    return Fact(_text(key), value, _text(fault), None if t_ms is None else _whole(t_ms))


def _clock(control_ms: Any, edge_ms: Any, round_trip_ms: Any, resolution_ms: Any, stamps_samples: Any) -> ClockReading:
    times = _whole(control_ms), _whole(edge_ms), _whole(round_trip_ms), _whole(resolution_ms)
    return ClockReading(*times, stamps_samples=stamps_samples is True)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _whole(value: Any) -> int:
    if type(value) is not int or not 0 <= value < 2**62:
        raise ValueError(f"{value!r} is no whole number")
    return value


@dataclass(frozen=True, slots=True)
class SweepPosition:
    """The place of a parser in the sweeps: the life and the number of the next frame, and the time up to which all is taken."""

    life: str = ""
    next_number: int = 0
    taken_ms: int = 0

    def place(self) -> Place | None:
        """The place to be kept over a restart; None while nothing was taken."""
        return Place(self.life, self.taken_ms) if self.life else None

    @classmethod
    def resumed(cls, kept: Place) -> "SweepPosition":
        """Return where an edge stands that was here before: the time is known, the life is over."""
        return cls("", 0, kept.next_sequence)


class Taken(NamedTuple):
    """The result of taking a frame: the sweep to make samples of (None: refused, or taken before), and what is known already.

    `about` has gaps, errors, duplicates and counts but no samples; add them with `dataclasses.replace`. `is_baseline`: the values
    are the state as found, not events.
    """

    position: SweepPosition
    sweep: Sweep | None
    about: SampleSet
    is_baseline: bool = False


def take(position: SweepPosition, raw: bytes) -> Taken:
    """Take a frame, once, and find the holes before it."""
    try:
        sweep = Sweep.decode(raw)
    except DocumentError as error:
        return Taken(position, None, SampleSet(error=str(error)))
    received = len(sweep.facts)
    is_new_life = sweep.life != position.life
    if not is_new_life and sweep.number < position.next_number:
        dropped: dict[str, int] = {Drop.DUPLICATE: received} if received else {}
        return Taken(position, None, SampleSet(received=received, dropped=dropped, instance=sweep.life))
    gaps = [Gap(hole.reason, hole.from_ms, hole.to_ms, hole.lost) for hole in sweep.holes]
    if is_new_life and position.taken_ms:
        gaps.insert(0, _away(position, sweep))
    elif not is_new_life and sweep.number > position.next_number:
        missing = sweep.number - position.next_number
        gaps.insert(0, Gap("frames missing", position.taken_ms, sweep.t_ms, missing * max(received, 1)))
    after = SweepPosition(sweep.life, sweep.number + 1, max(sweep.t_ms, position.taken_ms))
    newest = max((fact.t_ms for fact in sweep.facts if fact.t_ms is not None), default=sweep.t_ms if sweep.facts else None)
    about = SampleSet(
        gaps=tuple(gaps),
        received=received,
        instance=sweep.life,
        newest_ms=newest,
        available=sweep.available,
        clock=sweep.clock,
        error=sweep.error,
    )
    return Taken(after, sweep, about, is_baseline=is_new_life or bool(gaps))


def _away(position: SweepPosition, sweep: Sweep) -> Gap:
    looks = (sweep.t_ms - position.taken_ms) // sweep.interval_ms if sweep.interval_ms else 1
    return Gap(EDGE_RESTARTED, position.taken_ms, sweep.t_ms, max(looks, 0) * len(sweep.facts))
