"""A small machine for tests: parts of two operations, noise that repeats from a seed, and changes that are planted."""

from collections.abc import Callable

import numpy as np

from twin.anomaly.parts.replay import Recorded

SIGNALS = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "vibration_rms_g")
STANDS, CHANGES, LINE_S, LINES = 12, 5, 7, 6
OPERATIONS = ((1, 4000.0, 30.0, 1000.0, 0.2), (2, 6000.0, 18.0, 1500.0, 0.12))
"""Tool, speed, load of the cut, feed, vibration."""
PART_TICKS = STANDS + len(OPERATIONS) * (CHANGES + LINE_S * LINES)
Row = dict[str, float]
Change = Callable[[int, Row], Row]


def recorded(parts: int, seed: int, change: Change | None = None, program: str = "O1", first_tick: int = 0) -> Recorded:
    """Return so many parts; change: of the row of a cut, by part."""
    rng = np.random.default_rng(seed)
    rows: list[tuple[Row, int, int, bool]] = []
    for part in range(parts):
        material = float(np.exp(rng.normal(0.0, 0.02)))
        rows += [({"load": 0.0, "rpm": 0.0, "feed": 0.0, "vibration": 0.01}, 2, 190, False)] * STANDS
        for place, (tool, rpm, load, feed, vibration) in enumerate(OPERATIONS):
            rows += [({"load": 0.0, "rpm": 0.0, "feed": 0.0, "vibration": 0.01}, tool, 100 * place + 10, True)] * CHANGES
            for line in range(LINES):
                for second in range(LINE_S):
                    is_air = second == LINE_S - 1
                    noisy = material * float(np.exp(rng.normal(0.0, 0.05)))
                    row = {
                        "load": 3.0 + (0.0 if is_air else load * noisy * (1.0 + 0.1 * line)),
                        "rpm": rpm * float(1.0 + 0.001 * rng.normal()),
                        "feed": feed * float(1.0 + 0.005 * rng.normal()),
                        "vibration": (0.03 if is_air else vibration) * float(np.exp(rng.normal(0.0, 0.1))),
                    }
                    rows.append((row if change is None else change(part, row), tool, 100 * place + 10 + 10 * line, False))
    values = np.array([[round(row["load"]), row["rpm"], row["feed"], row["vibration"]] for row, *_ in rows])
    count = len(rows)
    return Recorded(
        "mill",
        1.0,
        SIGNALS,
        values,
        (program,),
        np.zeros(count, dtype=np.int64),
        np.array([tool for _, tool, _, _ in rows]),
        np.array([line for _, _, line, _ in rows]),
        np.full(count, 100.0),
        np.full(count, 100.0),
        np.array([gated for *_, gated in rows]),
        first_tick=first_tick,
    )


def in_part(number: int, **factors: float) -> Change:
    """Return a change of one part: each signal times its factor."""

    def change(part: int, row: Row) -> Row:
        return {name: value * factors.get(name, 1.0) for name, value in row.items()} if part == number else row

    return change
