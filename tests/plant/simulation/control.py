"""A machine of the plant, and the edge's adapter for it: values that the seed draws, in a buffer like an agent's.

The numbers of a machine are its own: spindle speeds of machine i lie in [1000 (i + 1), 1000 (i + 1) + 999], so that a value which
somebody else was given is seen at once. Each observation has a number and a stamp that no other one has.
"""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from pydantic import BaseModel

from edge.adapter import Adapter
from edge.config import EdgeConfig
from edge.place import EDGE_RESTARTED, Place
from edge.sample import EdgeSample, Gap, Offer, SampleSet
from tests.plant.simulation.kernel import EPOCH_S, Kernel, Process

LOAD, SPEED, FEED, STATE, TOOL = "spindle_load_pct", "spindle_rpm", "feed_mm_min", "exec_state", "tool_number"
OFFERS = tuple(Offer(name, name) for name in (LOAD, SPEED, FEED, STATE, TOOL))
BUFFER = 4_000
FRAME_MAX = 60
POLL_S = 0.1


class Observed(NamedTuple):
    """One observation: when the machine made it (s of the run), its signal and its value."""

    at_s: float
    signal: str
    value: float | int | str


class Told(NamedTuple):
    """The memory of a cursor: the place, and whether the machine has described itself."""

    next_sequence: int
    is_begun: bool = False


@dataclass(slots=True)
class Machine:
    """A machine: what it observes in its run, in order. `high_s`: when its load is far too high, and an alarm is due."""

    name: str
    number: int
    day: list[Observed]
    high_s: list[tuple[float, float]]

    def known(self, now_s: float) -> int:
        """Return how many observations it has made."""
        low, high = 0, len(self.day)
        while low < high:
            middle = (low + high) // 2
            if self.day[middle].at_s <= now_s:
                low = middle + 1
            else:
                high = middle
        return low

    def owns(self, speed: float) -> bool:
        """Return True if a spindle speed is one of this machine's."""
        return 1000 * (self.number + 1) <= speed < 1000 * (self.number + 2)

    def last(self, signal: str) -> float | int | str:
        """Return the value of a signal at the end of the run."""
        return next(one.value for one in reversed(self.day) if one.signal == signal)


def machine(name: str, number: int, end_s: float, chance: Random) -> Machine:
    """Draw a machine's run; it is quiet from `end_s` on."""
    base = 1000 * (number + 1)
    day = [Observed(0.0, LOAD, 20.0), Observed(0.0, SPEED, float(base)), Observed(0.0, FEED, 0.0)]
    day += [Observed(0.0, STATE, "READY"), Observed(0.0, TOOL, 1)]
    high_s = []
    begin_s = chance.uniform(3.0, end_s / 3)
    while begin_s < end_s - 8.0:
        high_s.append((begin_s, begin_s + chance.uniform(6.0, 8.0)))
        begin_s = high_s[-1][1] + chance.uniform(8.0, 20.0)
    at_s, count, tool = 0.3, 0, 1
    step_s = chance.choice((0.15, 0.3, 0.6))
    while at_s < end_s:
        is_high = any(a <= at_s < b for a, b in high_s)
        count += 1
        day.append(Observed(at_s, SPEED, float(base + count % 1000)))
        if chance.random() < 0.6:
            day.append(Observed(at_s, LOAD, round((150.0 if is_high else 40.0) + chance.random() * 10.0, 3)))
        if chance.random() < 0.1:
            day.append(Observed(at_s, FEED, round(chance.uniform(0.0, 5_000.0), 1)))
        if chance.random() < 0.03:
            day.append(Observed(at_s, STATE, chance.choice(("ACTIVE", "READY", "STOPPED"))))
        if chance.random() < 0.02:
            tool = tool % 12 + 1
            day.append(Observed(at_s, TOOL, tool))
        at_s += step_s * chance.uniform(0.6, 1.6)
    day += [Observed(end_s, LOAD, 30.0), Observed(end_s, FEED, 0.0), Observed(end_s, STATE, "READY")]
    # A stamp in milliseconds that no other observation has.
    apart = [one._replace(at_s=round(one.at_s, 3) + 0.001 * place) for place, one in enumerate(day[:5])]
    for one in day[5:]:
        apart.append(one._replace(at_s=max(round(one.at_s, 3), round(apart[-1].at_s + 0.001, 3))))
    return Machine(name, number, apart, high_s)


class SimulatedControl:
    """The connection of an edge to its machine. `is_away`: nothing comes from it."""

    def __init__(self, kernel: Kernel, of: Machine, is_away: Callable[[], bool]) -> None:
        self.reconnects, self.last_error = 0, ""
        self._kernel, self._machine, self._is_away = kernel, of, is_away
        self._process: Process = kernel.me().process
        self._next = 1
        self._is_closed = False
        self._heard_s = kernel.now_s

    def frames(self) -> Iterator[bytes]:
        """Documents with what is new, one in each tenth of a second; an empty one where nothing is."""
        while not self._is_closed:
            if self._is_away():
                self._kernel.sleep(POLL_S)
                continue
            self._heard_s = self._kernel.now_s
            known = self._machine.known(self._kernel.now_s)
            first = max(self._next, known - BUFFER + 1, 1)
            told = [[k, *self._machine.day[k - 1]] for k in range(first, min(known, first + FRAME_MAX - 1) + 1)]
            yield json.dumps({"asked": self._next, "first": first, "last": known, "told": told}).encode()
            if first + FRAME_MAX > known:
                self._kernel.sleep(POLL_S)

    def follow(self, cursor: Told) -> None:
        """The parser stands here."""
        self._next = cursor.next_sequence

    def silent_s(self) -> float:
        """Seconds since the machine was last heard."""
        return self._kernel.now_s - self._heard_s

    def close(self) -> None:
        """End."""
        self._is_closed = True


class NoSection(BaseModel):
    """The adapter has no table of its own."""


def parse(_: EdgeConfig[Any], cursor: Told, raw: bytes) -> tuple[Told, SampleSet]:
    """Read a document."""
    document = json.loads(raw)
    samples, dropped, next_sequence = [], 0, cursor.next_sequence
    gaps: tuple[Gap, ...] = ()
    if document["first"] > next_sequence:
        lost = document["first"] - next_sequence
        gaps = (Gap(EDGE_RESTARTED, next_sequence, document["first"] - 1, lost),)
    for number, at_s, signal, value in document["told"]:
        if number < next_sequence:
            dropped += 1
            continue
        next_sequence = number + 1
        samples.append(
            EdgeSample(signal, value, round((EPOCH_S + at_s) * 1000), sequence=number, is_baseline=not cursor.is_begun)
        )
    found = SampleSet(
        samples=tuple(samples),
        gaps=gaps,
        received=len(document["told"]),
        dropped={"duplicate": dropped} if dropped else {},
        offers=None if cursor.is_begun else OFFERS,
        instance="1",
        backlog=max(document["last"] - next_sequence + 1, 0),
        newest_ms=samples[-1].timestamp_ms if samples else None,
        available=True,
    )
    return Told(next_sequence, True), found


def adapter_of(kernel: Kernel, of: Machine, is_away: Callable[[], bool]) -> Adapter:
    """Return the adapter for one machine of the plant."""
    return Adapter(
        name="simulated",
        schemes=(),
        config_model=NoSection,
        start=lambda _: Told(1),
        place=lambda cursor: Place("1", cursor.next_sequence),
        resume=lambda _, place: Told(place.next_sequence),
        parse=parse,
        connect=lambda _: SimulatedControl(kernel, of, is_away),
        describe=lambda _: [],
        draft=lambda _, __: "",
        sample_config=Path(),
    )
