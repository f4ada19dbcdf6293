"""Part programs of a cell: operations with a tool each, straight pass by straight pass, as text with line numbers.

    share of the engaged arc at s along a pass = clip((s − lead + r) / r, 0, 1) · clip((lead + L − s) / r, 0, 1)
    r = √(2 R a − a²) for a width a below the radius R, else R          lead: from where the pass begins to the stock

Each operation has a band of the stock to itself: faces from the edge at y = 0, slots in full width, walls as a slot that is made
wider. Every pass but the first of a wall then has one stated width, so its engaged arc needs no simulation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from math import acos, pi, sqrt
from typing import NamedTuple

import numpy as np

from benchmarks.simulated_cell.tooling import FACE_MILLS, FINISHERS, ROUGHERS, EndMill

CLEAR_MM, BESIDE_MM, GAP_MM = 5.0, 2.0, 3.0
SIZED_FOR_KW = 5.5 * 0.85
"""Cuts are planned as shares of what the smallest spindle of the cell gives."""


class Work(IntEnum):
    """The kinds of a stretch of time on a machine."""

    STANDING = 0
    LOADING = 1
    WARM_UP = 2
    RAPID = 3
    CUTTING = 4
    TOOL_CHANGE = 5
    STOP = 6
    """A spindle stop with the same tool: measuring, chips, a look at the part. Like a tool change, but nothing tells of it."""


class Sense(StrEnum):
    """The side of the tool on which it cuts."""

    SLOT = "slot"
    UP = "up"
    CLIMB = "climb"


class Cut(NamedTuple):
    """The engagement of a pass."""

    depth_mm: float
    width_mm: float
    sense: Sense

    def arc_rad(self, diameter_mm: float) -> tuple[float, float]:
        """Return where a tooth enters and leaves.

        >>> [round(angle, 3) for angle in Cut(2.0, 5.0, Sense.CLIMB).arc_rad(20.0)]
        [2.094, 3.142]
        """
        swept = acos(max(-1.0, 1.0 - 2.0 * self.width_mm / diameter_mm))
        return {Sense.SLOT: (0.0, pi), Sense.UP: (0.0, swept), Sense.CLIMB: (pi - swept, pi)}[self.sense]

    def reach_mm(self, diameter_mm: float) -> float:
        """Return how far the engaged arc reaches ahead of the tool's centre."""
        radius = 0.5 * diameter_mm
        return radius if self.width_mm >= radius else sqrt(2.0 * radius * self.width_mm - self.width_mm**2)


class Line(NamedTuple):
    """A line of a program that moves. feed_mm_min: 0 = rapid; cut: place in the operation's cuts, −1 = in air."""

    number: int
    length_mm: float
    feed_mm_min: float
    cut: int


@dataclass(frozen=True, slots=True)
class Operation:
    """The work of one tool on a part. first: the line of the tool change; stock_mm: length of the stock along a pass."""

    kind: str
    tool: int
    rpm: float
    is_wet: bool
    first: int
    cuts: tuple[Cut, ...]
    lines: tuple[Line, ...]
    stock_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class PartProgram:
    """A program: its name, what it does, its text, the box that it cuts from."""

    name: str
    operations: tuple[Operation, ...]
    text: str
    stock_min_mm: tuple[float, float, float]
    stock_max_mm: tuple[float, float, float]


class Sort(NamedTuple):
    """Ranges from which an operation is drawn. load: planned share of the spindle's power, in the cut."""

    share: float
    tools: tuple[int, ...]
    speed_m_min: tuple[float, float]
    chip_mm: tuple[float, float]
    load: tuple[float, float]
    width: tuple[float, float]
    depth_mm: tuple[float, float]
    duration_s: tuple[float, float]


SORTS = {
    "facing": Sort(0.15, FACE_MILLS, (160, 260), (0.10, 0.20), (0.15, 0.45), (0.6, 0.75), (0.5, 3.0), (30, 110)),
    "slotting": Sort(0.20, ROUGHERS, (120, 220), (0.06, 0.12), (0.20, 0.50), (1.0, 1.0), (0.6, 8.0), (30, 120)),
    "wall": Sort(0.30, ROUGHERS, (140, 260), (0.08, 0.16), (0.25, 0.65), (0.25, 0.45), (1.0, 14.0), (40, 140)),
    "floor_finishing": Sort(0.20, FINISHERS, (200, 320), (0.04, 0.08), (0.06, 0.15), (0.5, 0.7), (0.3, 2.0), (30, 100)),
    "wall_finishing": Sort(0.15, FINISHERS, (200, 320), (0.04, 0.08), (0.08, 0.20), (0.05, 0.12), (2.0, 14.0), (30, 110)),
}
"""width: of the tool's diameter; the depth follows from the planned power and is kept in its range."""


WALL = list(SORTS).index("wall")


def draw_program(name: str, tools: Mapping[int, EndMill], rng: np.random.Generator) -> PartProgram:
    """A program of 4 to 8 operations, 3 to 12 minutes long; at most one faces, first, and one finishes the far edge, last."""
    kinds, shares = list(SORTS), np.array([sort.share for sort in SORTS.values()])
    chosen = sorted(int(number) for number in rng.choice(len(kinds), size=int(rng.integers(4, 9)), p=shares / shares.sum()))
    last = len(kinds) - 1
    once = [number for place, number in enumerate(chosen) if number not in (0, last) or number not in chosen[:place]]
    kept = [kinds[number] for number in sorted(once + [WALL] * (4 - len(once)))]
    length_mm = round(float(rng.uniform(80.0, 200.0)))
    writer = _Writer(name, length_mm)
    for kind in kept:
        writer.operation(kind, tools, rng)
    return writer.finished()


class _Writer:
    """The text of a program and what its lines do, as they are added."""

    def __init__(self, name: str, length_mm: float) -> None:
        self.name, self.length_mm = name, length_mm
        self.text = ["%", f"{name} (PART OF {length_mm:.0f} MM)", f"N{3} G21 G90 G94 G17"]
        self.operations: list[Operation] = []
        self.band_mm, self.deepest_mm = 0.0, 0.0
        self.at = [0.0, 0.0, 100.0]

    def word(self, text: str) -> int:
        """Add a line; its N word is its line of the text, counted from 1."""
        self.text.append(f"N{len(self.text) + 1} {text}")
        return len(self.text)

    def operation(self, kind: str, tools: Mapping[int, EndMill], rng: np.random.Generator) -> None:
        sort = SORTS[kind]
        number = int(rng.choice(sort.tools))
        tool = tools[number]
        rpm = round(1000.0 * _drawn(rng, sort.speed_m_min) / (pi * tool.diameter_mm), -2)
        feed = float(round(_drawn(rng, sort.chip_mm) * tool.teeth * rpm, -1))
        width = round(_drawn(rng, sort.width) * tool.diameter_mm, 2)
        removed = 6e7 * _drawn(rng, sort.load) * SIZED_FOR_KW / tool.tangential_n_per_mm2
        depth = round(float(np.clip(removed / (width * feed), *sort.depth_mm)), 2)
        one_s = 60.0 * (self.length_mm + tool.diameter_mm + 2.0 * BESIDE_MM) / feed
        passes = max(2, round(_drawn(rng, sort.duration_s) / one_s))
        is_wet = bool(rng.random() < 0.6) or not self.operations
        first = self.word(f"T{number} M6")
        self.word(f"S{rpm:.0f} M3")
        self.word("M8" if is_wet else "M9")
        cuts, lines = self._passes(kind, tool.diameter_mm, (width, depth), feed, passes)
        lines.append(self.move(z=100.0))
        self.operations.append(Operation(kind, number, rpm, is_wet, first, cuts, tuple(lines), self.length_mm))

    def _passes(
        self, kind: str, diameter_mm: float, engaged_mm: tuple[float, float], feed: float, passes: int
    ) -> tuple[tuple[Cut, ...], list[Line]]:
        """Pass after pass, to and fro; on to the next level after six of them, in a slot after each."""
        (width, depth), radius = engaged_mm, 0.5 * diameter_mm
        is_slot, is_edge = kind == "slotting", kind in ("facing", "wall_finishing")
        across = min(passes, 1 if is_slot else 6)
        far_mm = self.band_mm + (across + 1) * width
        first_y = {"facing": self.band_mm - radius + width, "wall_finishing": far_mm + radius - width}
        from_y, step = first_y.get(kind, self.band_mm + radius), -width if kind == "wall_finishing" else width
        opening = Cut(depth, diameter_mm, Sense.SLOT)
        senses = (Sense.CLIMB, Sense.UP) if kind == "wall_finishing" else (Sense.UP, Sense.CLIMB)
        cuts = (opening,) if is_slot else (opening, *(Cut(depth, width, sense) for sense in senses))
        ends = (-radius - BESIDE_MM, self.length_mm + radius + BESIDE_MM)
        lines = [self.move(x=ends[0], y=from_y), self.move(z=CLEAR_MM)]
        for number in range(passes):
            level, place = divmod(number, across)
            lines.append(self.move(y=from_y + place * step))
            if place == 0:
                lines.append(self.move(z=-(level + 1) * depth))
            opens = is_slot or (place == 0 and not is_edge)
            slower = 0.5 if opens and not is_slot else 1.0
            cut = 0 if opens else 1 + number % 2
            lines.append(self.move(x=ends[1 - number % 2], feed=round(feed * slower), cut=cut))
        self.deepest_mm = max(self.deepest_mm, depth * (1 + (passes - 1) // across))
        used = {"facing": across * width, "slotting": diameter_mm, "wall_finishing": far_mm - self.band_mm}
        self.band_mm += used.get(kind, diameter_mm + (across - 1) * width) + (0.0 if kind == "wall_finishing" else GAP_MM)
        return cuts, lines

    def move(
        self, x: float | None = None, y: float | None = None, z: float | None = None, feed: float = 0.0, cut: int = -1
    ) -> Line:
        goal = [at if to is None else to for at, to in zip(self.at, (x, y, z), strict=True)]
        length = sqrt(sum((to - at) ** 2 for at, to in zip(self.at, goal, strict=True)))
        words = " ".join(f"{letter}{to:.3f}" for letter, to in zip("XYZ", (x, y, z), strict=True) if to is not None)
        self.at = goal
        return Line(self.word(f"G1 {words} F{feed:.0f}" if feed else f"G0 {words}"), length, feed, cut)

    def finished(self) -> PartProgram:
        self.word("M9 M5")
        self.text += [f"N{len(self.text) + 1} M30", "%"]
        lowest, highest = (0.0, 0.0, -self.deepest_mm - 10.0), (self.length_mm, self.band_mm, 0.0)
        return PartProgram(self.name, tuple(self.operations), "\n".join(self.text) + "\n", lowest, highest)


def _drawn(rng: np.random.Generator, bounds: Sequence[float]) -> float:
    """A figure drawn evenly over its logarithm."""
    return float(np.exp(rng.uniform(*np.log(bounds)))) if bounds[0] < bounds[1] else float(bounds[0])
