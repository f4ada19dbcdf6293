"""Parts made one after the other with tools that wear and are replaced, in batches of material that differ.

Written down before anything was judged: a tool lives 80 to 400 parts on average, its lives spread by 20 %; wear follows a
break-in, an even stretch and a steep end (ISO 8688-2, annex), spread in shape from life to life; at its end the edge force is
40 N/mm larger and the tangential coefficient 12 % (carbide in steel, VB 0.3 mm). It is replaced where the wear is 1 ± 0.08.
Batches of 20 to 80 parts differ by 5 %, parts of a batch by 0.5 %, sharp tools by 2 %. The meter shows whole per cents, noise
0.15 %; the reference of the ratio is an expectation with constants 3 % off. A tool that wears fast does so 3 or 15 times as
fast. Drift: the meter's scale moves by 6 % within four weeks.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import exp, pi

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.reference_machine.milling import CutPhysics, forces
from cnctwin.standins.reference_machine.physics import physics_of
from cnctwin.standins.reference_machine.production import Operation, operations_of
from cnctwin.standins.reference_machine.spindle import MeterPhysics, load_pct
from cnctwin.standins.reference_machine.stated import drawn_machine
from twin.wear.cut import Cut

Floats = NDArray[np.float64]
EDGE_SHARP_N_MM, EDGE_WORN_N_MM, TANGENTIAL_WORN = 20.0, 40.0, 0.12
BATCH, PART, SHARP, CONSTANTS = 0.05, 0.005, 0.02, 0.03
LIFE_SPREAD, END_SPREAD = 0.2, 0.08
IDLE_S, SHIFT_S, DAY_S = 60.0, 54_000.0, 86_400.0
PROGRAMS = (("O1", (0, 1, 2, 3)), ("O2", (0, 2, 4)))
DRIFT, DRIFT_DAYS = 0.06, 28.0


@dataclass(frozen=True, slots=True)
class Power:
    """Mean cutting power of an operation, W: linear in the coefficients, the chip being the same."""

    by_tangential: float
    by_edge: float


@dataclass(slots=True)
class Held:
    """A tool in the magazine. end: the wear at which it is replaced; shape: of its curve; rate: in lives of its own a part"""

    mean_uses: float
    uses: int
    age: float
    rate: float
    end: float
    shape: tuple[float, float]
    sharp: float
    life: int = 0
    is_fast: bool = False

    @property
    def wear(self) -> float:
        """The wear, 1 at the usual end of a life."""
        return wear_at(self.age, self.shape)


@dataclass(frozen=True, slots=True)
class Truth:
    """A tool after a part: which life, parts of it so far, whether it wears fast, and whether it was replaced just after."""

    tool: int
    life: int
    uses: int
    is_fast: bool
    is_replaced: bool


@dataclass(frozen=True, slots=True)
class Part:
    """A part: its cuts as the records tell them, the truth of its tools, and the day on which it was made."""

    number: int
    day: float
    cuts: tuple[Cut, ...]
    tools: tuple[Truth, ...]


def wear_at(age: float, shape: tuple[float, float]) -> float:
    """Return the wear at an age in lives: a break-in, an even stretch, a steep end; 1 at 1."""
    break_in, steep = shape
    even = 1.0 - break_in - steep
    return break_in * (1.0 - exp(-age / 0.06)) + even * age + steep * max(age, 0.0) ** 6


def power_of(operation: Operation, cut: CutPhysics, depth_mm: float) -> Power:
    """Return the power of an operation by the reference machine's forces, slice by slice of the edge, over half a second."""
    count = 500
    turn = operation.rpm * 2.0 * pi / 60.0 * 0.001 * np.arange(count)
    velocity = np.zeros((2, count))
    velocity[0] = operation.feed_mm_min / 60.0
    arc = np.zeros((2, count))
    arc[0], arc[1] = pi / 2.0, pi
    found = []
    for tangential, edge in ((1.0, 0.0), (0.0, 1.0)):
        physics = cut._replace(tangential=tangential, edge_n_per_mm=edge)
        power = np.zeros(count)
        forces(
            physics, turn, np.full(count, operation.rpm), velocity, velocity, np.full(count, depth_mm), arc,
            np.zeros((2, count)), np.zeros((2, count * 20)), power,
        )  # fmt: skip
        found.append(float(power.mean()))
    return Power(*found)


@dataclass(frozen=True, slots=True, eq=False)
class Work:
    """An operation: its power, the tool, seconds of cut, load in air, and the cutting load that is expected of it."""

    operation: Operation
    power: Power
    seconds: int
    meter: MeterPhysics
    tangential: float
    expected_pct: float

    def load_pct(self, tangential: float, edge: float) -> float:
        """Return what the meter shows with these coefficients, before its steps."""
        watts = self.power.by_tangential * tangential * self.tangential + self.power.by_edge * edge
        return float(load_pct(self.meter, np.full(1, watts), np.full(1, self.operation.rpm))[0])

    @property
    def idle_pct(self) -> float:
        """The load in air."""
        return self.load_pct(0.0, 0.0)


class World:
    """The machine. Chance is drawn in the order of parts, so a seed is a history."""

    def __init__(self, seed: int, *, fast: float = 0.0, drift_from_day: float = -1.0) -> None:
        """fast: how many times as fast one life in five wears; drift_from_day: when the meter begins to drift, −1 = never"""
        self.chance = np.random.default_rng([31, seed])
        self.fast, self.drift_from_day = fast, drift_from_day
        figures = drawn_machine(self.chance)
        physics = physics_of(figures)
        meter = replace(physics.meter, drop=0.15, turning_kw=0.4)
        drawn: list[Operation] = []
        while len(drawn) < 5:
            drawn += operations_of(self.chance, figures.spindle.rated_power_kw)
        self.held = [self._new(float(self.chance.uniform(80.0, 400.0))) for _ in range(5)]
        for held in self.held:
            held.age = float(self.chance.uniform(0.0, 0.8))
        self.works = {
            (program, tool): self._work(drawn[tool], physics.cut, meter) for program, tools in PROGRAMS for tool in tools
        }

    def _work(self, operation: Operation, cut: CutPhysics, meter: MeterPhysics) -> Work:
        chip = float(self.chance.uniform(0.04, 0.12))
        operation = replace(operation, feed_mm_min=chip * cut.teeth * operation.rpm)
        wanted_w = 1000.0 * float(self.chance.uniform(0.08, 0.35)) * meter.rated_kw
        power = power_of(operation, cut, 1.0)
        depth = wanted_w / (power.by_tangential * cut.tangential + power.by_edge * EDGE_SHARP_N_MM)
        power = Power(power.by_tangential * depth, power.by_edge * depth)
        work = Work(operation, power, max(int(operation.cut_s), 5), meter, cut.tangential, 1.0)
        off = 1.0 + CONSTANTS * float(self.chance.standard_normal())
        return replace(work, expected_pct=(work.load_pct(1.0, EDGE_SHARP_N_MM) - work.idle_pct) * off)

    def _new(self, mean_uses: float, life: int = 0) -> Held:
        chance = self.chance
        is_fast = self.fast > 0.0 and life > 3 and chance.random() < 0.2
        length = mean_uses * float(np.exp(LIFE_SPREAD * chance.standard_normal()))
        shape = (float(chance.uniform(0.1, 0.25)), float(chance.uniform(0.1, 0.35)))
        end = 1.0 + END_SPREAD * float(chance.standard_normal())
        rate = (self.fast if is_fast else 1.0) / length
        return Held(mean_uses, 0, 0.0, rate, end, shape, 1.0 + SHARP * float(chance.standard_normal()), life, is_fast)

    def parts(self, days: float) -> Iterator[Part]:
        """Yield the parts of so many working days."""
        chance, at_s, number, left_of_batch, material = self.chance, 0.0, 0, 0, 1.0
        program, tools = PROGRAMS[0]
        while at_s < days * DAY_S:
            if left_of_batch == 0:
                left_of_batch, material = int(chance.integers(20, 80)), float(np.exp(BATCH * chance.standard_normal()))
                program, tools = PROGRAMS[int(chance.integers(len(PROGRAMS)))]
            left_of_batch -= 1
            stiff = material * float(np.exp(PART * chance.standard_normal()))
            cuts, truths = [], []
            for place in tools:
                cut, at_s = self._cut(program, place, number, at_s, stiff)
                cuts.append(cut)
                truths.append(self._worn(place))
            yield Part(number, at_s / DAY_S, tuple(cuts), tuple(truths))
            number += 1
            at_s += IDLE_S
            if at_s % DAY_S > SHIFT_S:
                at_s += DAY_S - at_s % DAY_S

    def _cut(self, program: str, place: int, number: int, at_s: float, stiff: float) -> tuple[Cut, float]:
        work, held = self.works[program, place], self.held[place]
        tangential = stiff * held.sharp * (1.0 + TANGENTIAL_WORN * held.wear)
        edge = stiff * held.sharp * (EDGE_SHARP_N_MM + EDGE_WORN_N_MM * held.wear)
        days = at_s / DAY_S - self.drift_from_day
        drift = 1.0 + DRIFT * min(max(days / DRIFT_DAYS, 0.0), 1.0) if self.drift_from_day >= 0.0 else 1.0
        load, idle = work.load_pct(tangential, edge), work.idle_pct
        shown = drift * (idle + load - idle) + 0.15 * self.chance.standard_normal(work.seconds)
        ratio = (float(np.round(shown).mean()) - idle) / work.expected_pct
        at_s += work.seconds + 10.0
        operation = f"{program}|T{place + 1}|1"
        return Cut(program, place + 1, operation, number, at_s, max(ratio, 0.05), 0.02, None, "twin"), at_s

    def _worn(self, place: int) -> Truth:
        held = self.held[place]
        held.age += held.rate
        held.uses += 1
        is_over = held.wear >= held.end
        truth = Truth(place + 1, held.life, held.uses, held.is_fast, is_over)
        if is_over:
            self.held[place] = self._new(held.mean_uses, held.life + 1)
        return truth
