"""The part programs of a machine: operations with a tool each, as long and as hard as in job shops."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class Work(IntEnum):
    """What a machine does in a stretch of time."""

    STANDING = 0
    LOADING = 1
    WARM_UP = 2
    RAPID = 3
    CUTTING = 4
    TOOL_CHANGE = 5
    STOP = 6
    """A spindle stop with the same tool: measuring, chips, a look at the part. Like a tool change, but nothing tells of it."""


@dataclass(frozen=True, slots=True)
class Operation:
    """One tool's work on a part; load, feed and vibration are those of a sharp tool in the usual material.

    passes_s: how long one pass takes; between two the tool is in the air for a moment
    """

    duration_s: float
    spindle_rpm: float
    load_pct: float
    feed_mm_min: float
    vibration_g: float
    passes_s: float


SORTS = {
    # share, rpm, load %, feed mm/min, vibration g, duration s: ranges from which an operation is drawn
    "roughing": (0.35, (1800, 4500), (40, 85), (900, 3000), (0.25, 0.55), (40, 150)),
    "finishing": (0.35, (6000, 11000), (8, 25), (1200, 4000), (0.10, 0.30), (30, 120)),
    "drilling": (0.20, (1200, 5000), (20, 50), (200, 800), (0.12, 0.25), (15, 60)),
    "engraving": (0.10, (9000, 12000), (4, 8), (400, 1000), (0.15, 0.35), (20, 60)),
}


def draw_program(rng: np.random.Generator) -> tuple[Operation, ...]:
    """A program of 4 to 8 operations, 3 to 12 minutes long."""
    shares = [sort[0] for sort in SORTS.values()]
    chosen = rng.choice(len(SORTS), size=int(rng.integers(4, 9)), p=shares)
    return tuple(_operation(rng, list(SORTS.values())[sort]) for sort in sorted(chosen))


def _operation(rng: np.random.Generator, sort: tuple[float, *tuple[tuple[float, float], ...]]) -> Operation:
    rpm, load, feed, vibration, duration = (float(np.exp(rng.uniform(*np.log(bounds)))) for bounds in sort[1:])
    return Operation(round(duration), round(rpm, -2), load, feed, vibration, float(rng.uniform(5.0, 20.0)))
