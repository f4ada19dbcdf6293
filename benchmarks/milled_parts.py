"""Rows of machines that mill one part over and over, and a model that has learned it, to measure what a score costs."""

from functools import cache
from random import Random
from typing import Any

import numpy as np

from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.replay import Recorded, fit
from twin.anomaly.parts_scorer import PartsScorer

SIGNALS = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
TOOLS, LINES, LINE_S, CHANGE_S = 4, 6, 8, 12
PART_S = TOOLS * (CHANGE_S + LINES * LINE_S)
LEARNED = 20
PROGRAM = "O1"


def rows_of(seed: int, parts: int) -> list[dict[str, Any]]:
    """Return what the control tells of so many parts, a row a second."""
    chance, rows = Random(seed), []
    for second in range(parts * PART_S):
        tool, within = divmod(second % PART_S, PART_S // TOOLS)
        is_change, line = within < CHANGE_S, max(0, within - CHANGE_S) // LINE_S
        load_pct = 3.0 + (12.0 + 5.0 * ((tool + line) % 5)) * (1.0 + chance.gauss(0.0, 0.04))
        rows.append(
            {
                "spindle_load_pct": 0.0 if is_change else round(load_pct, 1),
                "spindle_rpm": 0.0 if is_change else 3000.0 + 1000.0 * tool + chance.gauss(0.0, 3.0),
                "feed_mm_min": 0.0 if is_change else 800.0 + chance.gauss(0.0, 3.0),
                "spindle_temp_c": 32.0 + chance.gauss(0.0, 0.1),
                "vibration_rms_g": abs((0.02 if is_change else 0.1) + chance.gauss(0.0, 0.01)),
                "program": PROGRAM,
                "tool_number": tool + 1,
                "nc_line": 1000 * tool + 10 * line,
                "feed_override_pct": 100.0,
                "spindle_override_pct": 100.0,
                "tool_change_active": is_change,
            }
        )
    return rows


def recorded(seed: int, parts: int) -> Recorded:
    """Return these rows as a recording, a tick each."""
    rows = rows_of(seed, parts)
    full = np.full(len(rows), 100.0)
    return Recorded(
        machine="m",
        tick_s=1.0,
        signals=SIGNALS,
        values=np.array([[row[name] for name in SIGNALS] for row in rows]),
        programs=(PROGRAM,),
        program=np.zeros(len(rows), dtype=np.int64),
        tool=np.array([row["tool_number"] for row in rows]),
        line=np.array([row["nc_line"] for row in rows]),
        feed_override_pct=full,
        spindle_override_pct=full,
        gated=np.array([row["tool_change_active"] for row in rows]),
    )


@cache
def model_of_parts() -> AnomalyModel:
    """Return the model of a machine that has made these parts."""
    (model,) = fit([recorded(1, LEARNED)])
    return AnomalyModel(SIGNALS, PartsScorer(model))
