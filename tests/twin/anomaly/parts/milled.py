"""A machine that mills the same part over and over, told tick by tick: two tools, five lines each, some noise."""

from collections.abc import Iterator
from random import Random
from typing import Any

import numpy as np

from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.replay import Recorded, fit

SIGNALS = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "vibration_rms_g")
LOADS_PCT = {1: (20.0, 30.0, 25.0, 40.0, 22.0), 2: (12.0, 15.0, 30.0, 18.0, 12.0)}
RPM = {1: 4000.0, 2: 6000.0}
FEED_MM_MIN = 900.0
LINE_S, CHANGE_S = 8, 6
Row = dict[str, Any]


def part(chance: Random, program: str = "O1", load: float = 1.0) -> Iterator[Row]:
    """Yield what the control tells of one part, a row a second; load: of the cut, 1 = as usual."""
    for tool, loads_pct in LOADS_PCT.items():
        for _ in range(CHANGE_S):
            still = {"spindle_load_pct": 0.0, "spindle_rpm": 0.0, "feed_mm_min": 0.0, "vibration_rms_g": 0.02}
            yield {**still, "program": program, "tool_number": tool, "nc_line": 100 * tool, "tool_change_active": True}
        for number, load_pct in enumerate(loads_pct):
            for _ in range(LINE_S):
                yield {
                    "spindle_load_pct": max(0.0, 3.0 + load * load_pct * (1.0 + chance.gauss(0.0, 0.03))),
                    "spindle_rpm": RPM[tool] + chance.gauss(0.0, 3.0),
                    "feed_mm_min": FEED_MM_MIN + chance.gauss(0.0, 2.0),
                    "vibration_rms_g": 0.1 + 0.002 * load_pct * load + abs(chance.gauss(0.0, 0.005)),
                    "program": program,
                    "tool_number": tool,
                    "nc_line": 100 * tool + 10 * (number + 1),
                    "tool_change_active": False,
                }


def parts(seed: int, count: int, loads: dict[int, float] | None = None, program: str = "O1") -> list[Row]:
    """Return the rows of so many parts; loads: of single ones, by number."""
    chance = Random(seed)
    return [row for number in range(count) for row in part(chance, program, (loads or {}).get(number, 1.0))]


def recorded(rows: list[Row], machine: str = "a", first_tick: int = 0) -> Recorded:
    """Return the rows as a recording, a tick each; gated while the tool is changed and two ticks after."""
    names = tuple(dict.fromkeys(row["program"] for row in rows))
    changing = np.array([row["tool_change_active"] for row in rows])
    gated = changing.copy()
    for late in (1, 2):
        gated[late:] |= changing[:-late]
    full = np.full(len(rows), 100.0)
    return Recorded(
        machine=machine,
        tick_s=1.0,
        signals=SIGNALS,
        values=np.array([[row[name] for name in SIGNALS] for row in rows]),
        programs=names,
        program=np.array([names.index(row["program"]) for row in rows]),
        tool=np.array([row["tool_number"] for row in rows]),
        line=np.array([row["nc_line"] for row in rows]),
        feed_override_pct=full,
        spindle_override_pct=full,
        gated=gated,
        first_tick=first_tick,
    )


def fitted(count: int = 14, machines: int = 2) -> tuple[PartsModel, ...]:
    """Return the models of so many machines, learned from so many parts of each."""
    return fit([recorded(parts(100 + number, count), machine=f"m{number}") for number in range(machines)])
