#!/usr/bin/env python3
"""Stability lobes: how fast, and how near the zero-order limit is to where the vibration itself begins to grow.

    .venv/bin/python benchmarks/chatter.py

The vibration is integrated step by step by tests/twin/process/milling_vibration.py, which shares no code with the lobes: a tool
with a mode of 500 Hz, 2 % in x and one of 610 Hz, 3 % in y, at 26 tooth frequencies from 150 to 1400 Hz. Of each cut: the
lowest and the highest part of the limit at which it begins to grow, apart for tooth frequencies below and above 1.6 times the
lowest mode. 1 would be exact; less than 1 promises too much.
"""

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.twin.process.milling_vibration import Rotor, growth
from twin.machine import Mode
from twin.process.stability import ChatterCut, depth_limit_mm, stable_speeds

X = Mode(direction="x", frequency_hz=500.0, damping_ratio=0.02, stiffness_n_per_mm=8000.0)
Y = Mode(direction="y", frequency_hz=610.0, damping_ratio=0.03, stiffness_n_per_mm=9000.0)
SLOT = ChatterCut(4, 900.0, 0.4, 0.0, math.pi)
PARTS = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.4, 1.7, 2.0])
TOOTH_HZ = np.linspace(150.0, 1400.0, 26)
HIGH_HZ = 800.0


def begins_to_grow(cut: ChatterCut) -> list[float]:
    """The part of the limit, by tooth frequency; inf where none of them grows."""
    rotors = []
    for hz in TOOTH_HZ:
        rpm = 60.0 * hz / cut.teeth
        limit = float(depth_limit_mm([X, Y], cut, rpm)[0])
        angles = (cut.entry_angle_rad, cut.exit_angle_rad)
        rotors += [Rotor(cut.teeth, 900.0, 0.4, *angles, rpm, part * limit) for part in PARTS]
    with np.errstate(over="ignore", invalid="ignore"):
        grown = growth((8000.0, 9000.0), (500.0, 610.0), (0.02, 0.03), rotors, 100).reshape(len(TOOTH_HZ), -1)
    grows = ~(grown <= 1.0)  # one that overflowed has grown
    return [float(PARTS[row.argmax()]) if row.any() else math.inf for row in grows]


def cuts() -> dict[str, ChatterCut]:
    """Slots, and shoulders of two widths."""
    named = {f"slot, {teeth} teeth": replace(SLOT, teeth=teeth) for teeth in (4, 3, 2)}
    for width in (0.5, 0.1):
        arc = math.acos(1.0 - 2.0 * width)
        for teeth in (4, 2):
            named[f"up-milling, {width:.0%} of the diameter, {teeth} teeth"] = replace(SLOT, teeth=teeth, exit_angle_rad=arc)
            down = replace(SLOT, teeth=teeth, entry_angle_rad=math.pi - arc)
            named[f"down-milling, {width:.0%} of the diameter, {teeth} teeth"] = down
    return named


def timed_ms(count: int, of: Callable[[], object]) -> float:
    """Median of its processor time over calls, after one to warm up."""
    of()
    taken = []
    for _ in range(count):
        begun = time.process_time()
        of()
        taken.append(time.process_time() - begun)
    return 1e3 * statistics.median(taken)


def main() -> None:
    speeds = np.linspace(1000.0, 20000.0, 400)
    cut = replace(SLOT, entry_angle_rad=0.3, heading_rad=0.7)
    print(f"depth_limit_mm, 400 speeds, 2 modes:  {timed_ms(50, lambda: depth_limit_mm([X, Y], cut, speeds)):.1f} ms")
    print(f"stable_speeds, 1000 to 20000, 2 modes: {timed_ms(50, lambda: stable_speeds([X, Y], cut, 0.6, 1e3, 2e4)):.1f} ms\n")
    print("| cut | up to 1.6 f | above |\n|---|---|---|")
    for name, one in cuts().items():
        parts = begins_to_grow(one)
        low = [part for part, hz in zip(parts, TOOTH_HZ, strict=True) if hz <= HIGH_HZ]
        high = parts[len(low) :]
        print(f"| {name} | {min(low):g} … {max(low):g} | {min(high):g} … {max(high):g} |")


if __name__ == "__main__":
    main()
