"""Programs of the reference machine: drawn by seed, in blocks and as the text of a part program.

A program in air moves each axis at several feeds both ways, turns back within micrometres, goes round circles or zigzags, and
waits. A cutting one goes slot by slot at several feeds and speeds. Strokes, feeds, order and shapes differ from draw to draw.
"""

from collections.abc import Sequence
from math import pi

import numpy as np
from numpy.typing import NDArray

from cnctwin.standins.reference_machine.trajectory import Block, Circle, Dwell, Line

Chance = np.random.Generator
Floats = NDArray[np.float64]
FEEDS = ((240.0, 450.0), (700.0, 2200.0), (3600.0, 9000.0))
"""Ranges of slow, middle and fast feeds, mm/min."""


def air_program(chance: Chance, spindle_rpm: float | None = None) -> tuple[Block, ...]:
    """About 25 s of motion in air."""
    signs = chance.choice([-1.0, 1.0], size=3)
    blocks: list[Block] = [Dwell(0.3, spindle_rpm)]
    for number in chance.permutation(len(FEEDS)):
        feed = _even(chance, *FEEDS[number])
        stroke = min(feed / 60.0 * float(chance.uniform(0.5, 0.95)), 95.0)
        for axis in chance.permutation(3):
            blocks += _there_and_back(int(axis), signs[axis] * stroke, feed)
    blocks.append(Dwell(round(float(chance.uniform(0.2, 0.6)), 3)))
    blocks += _shape(chance)
    blocks += _turning_back(chance, signs)
    far = tuple(round(float(sign * chance.uniform(20.0, 62.0)), 4) for sign in signs)
    blocks.append(Line((far[0], far[1], far[2]), _even(chance, 4000.0, 7000.0)))
    blocks.append(Dwell(round(float(chance.uniform(0.2, 0.7)), 3)))
    blocks.append(Line((0.0, 0.0, 0.0), _even(chance, 6000.0, 10000.0)))
    return (*blocks, Dwell(0.3))


def _even(chance: Chance, low: float, high: float) -> float:
    """A round figure, drawn evenly over its logarithm."""
    return float(np.round(np.exp(chance.uniform(np.log(low), np.log(high)))))


def _there_and_back(axis: int, stroke_mm: float, feed: float) -> list[Block]:
    there: list[float | None] = [None, None, None]
    back: list[float | None] = [None, None, None]
    there[axis], back[axis] = round(stroke_mm, 4), 0.0
    return [Line((there[0], there[1], there[2]), feed), Line((back[0], back[1], back[2]), feed)]


def _shape(chance: Chance) -> list[Block]:
    """Two circles of either sense, or a zigzag of all axes."""
    if chance.random() < 0.6:
        angle, radius = float(chance.uniform(0.0, 2.0 * pi)), float(chance.uniform(8.0, 16.0))
        centre = (round(radius * np.cos(angle), 4), round(radius * np.sin(angle), 4))
        return [Circle(centre, clockwise, _even(chance, 1400.0, 2800.0)) for clockwise in (False, True)]
    corners = [tuple(round(float(v), 4) for v in chance.uniform(-22.0, 22.0, size=3)) for _ in range(5)]
    blocks: list[Block] = [Line((x, y, z), _even(chance, 1200.0, 3600.0)) for x, y, z in corners]
    return [*blocks, Line((0.0, 0.0, 0.0), _even(chance, 2000.0, 4000.0))]


def _turning_back(chance: Chance, signs: Floats) -> list[Block]:
    blocks: list[Block] = []
    for low, high in ((0.015, 0.03), (0.07, 0.15), (0.35, 0.7)):
        stroke = round(float(chance.uniform(low, high)), 4)
        feed = _even(chance, 180.0, 260.0)
        for axis in range(3):
            blocks += _there_and_back(axis, signs[axis] * stroke, feed)
    return blocks


SLOT = (0.0, pi)
CLIMB = (pi / 2.0, pi)
UP = (0.0, pi / 2.0)


FORCE_N = 260.0
"""The force of the roughest chip that a program takes, about: below what moves an axis that rests."""
ROUGHEST_MM = 0.15


def deepest_mm(coefficient_n_per_mm2: float) -> float:
    """Depth at which the roughest chip bears that force. 900 N/mm² and 0.15 mm: 260 / 135 = 1.93 mm.

    >>> round(deepest_mm(900.0), 2)
    1.93
    """
    return FORCE_N / (coefficient_n_per_mm2 * ROUGHEST_MM)


def cut_program(chance: Chance, teeth: int, coefficient_n_per_mm2: float) -> tuple[Block, ...]:
    """About 10 s of cutting: four pairs of slots at two speeds, feeds from fine to rough, some of them half as wide."""
    blocks: list[Block] = []
    place = [0.0, 0.0]
    deep = round(float(chance.uniform(0.75, 1.0)) * deepest_mm(coefficient_n_per_mm2), 2)
    depths = chance.permutation([deep, round(0.35 * deep, 2), deep, round(0.6 * deep, 2)])
    advances = chance.permutation([0.03, 0.06, 0.1, ROUGHEST_MM]) * chance.uniform(0.85, 1.0, size=4)
    speeds = chance.permutation([_even(chance, 2400.0, 3600.0), _even(chance, 4200.0, 6000.0)])
    for number, (depth, advance) in enumerate(zip(depths, advances, strict=True)):
        rpm = float(speeds[number // 2])
        if number % 2 == 0:
            blocks.append(Dwell(0.4, rpm))
        feed = float(np.round(advance * teeth * rpm))
        arc = SLOT if chance.random() < 0.5 else (CLIMB if chance.random() < 0.5 else UP)
        for axis in (0, 1):
            place[axis] += round(min(feed / 60.0 * float(chance.uniform(0.6, 1.0)), 160.0), 4)
            to = (place[0], None, None) if axis == 0 else (None, place[1], None)
            blocks += [Line(to, feed, float(depth), arc), Dwell(0.2)]
    return (*blocks, Dwell(0.2))


def nc_text(blocks: Sequence[Block]) -> str:
    """The part program, a line to a block.

    >>> print(nc_text([Dwell(0.3), Line((12.5, None, None), 1200.0), Circle((-5.0, 0.0), False, 900.0)]), end="")
    %
    N1 M5 G4 P300
    N2 G1 X12.5000 F1200
    N3 G3 I-5.0000 J0.0000 F900
    M30
    %
    """
    lines = []
    for number, block in enumerate(blocks, start=1):
        if isinstance(block, Dwell):
            spindle = "" if block.spindle_rpm is None else f"S{block.spindle_rpm:.0f} M3 "
            spindle = "M5 " if number == 1 and not spindle else spindle
            lines.append(f"N{number} {spindle}G4 P{1000.0 * block.seconds:.0f}")
        elif isinstance(block, Line):
            words = [f"{letter}{to:.4f}" for letter, to in zip("XYZ", block.to, strict=True) if to is not None]
            lines.append(f"N{number} G1 {' '.join(words)} F{block.feed_mm_min:.0f}")
        else:
            turn = "G2" if block.clockwise else "G3"
            lines.append(f"N{number} {turn} I{block.centre[0]:.4f} J{block.centre[1]:.4f} F{block.feed_mm_min:.0f}")
    return "\n".join(["%", *lines, "M30", "%"]) + "\n"
