"""The golden week of a model that compares parts: what the machine told at each tick, so that it can be followed again.

Scores are frozen as they are alone, without peers and alarms; what was left beside the peers is frozen beside them
(`twin/anomaly/golden.py`).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.replay import EXPECTED, Recorded, replayed

Floats = NDArray[np.float64]
Told = Mapping[str, NDArray[Any]]
BY_TICK = ("program", "tool", "line", "feed_override_pct", "spindle_override_pct", "gated")
TICK, PROGRAMS, EXPECTS = "tick", "programs", "expects"
NAMES = (*BY_TICK, TICK, PROGRAMS, EXPECTS)
_NUMBERS = frozenset({"feed_override_pct", "spindle_override_pct"})


def told_columns(recorded: Recorded, rows_max: int) -> tuple[Floats, Told]:
    """Return the rows (n, signals) at the last ticks that the machine told of, and the other columns (n,) of these."""
    at = _known(recorded)[-rows_max:]
    columns: dict[str, NDArray[Any]] = {name: getattr(recorded, name)[at] for name in BY_TICK}
    columns[TICK] = recorded.first_tick + at
    columns[PROGRAMS] = np.array(recorded.programs, dtype=np.str_)
    expected = np.full((len(at), len(EXPECTED)), np.nan) if recorded.expected is None else recorded.expected[at]
    columns[EXPECTS] = expected.astype(np.float64)
    return recorded.values[at], columns


def recorded_again(signals: tuple[str, ...], tick_s: float, rows: Floats, told: Told) -> Recorded:
    """Return the recording of such columns."""
    first = int(told[TICK][0]) if len(rows) else 0
    at = told[TICK].astype(np.int64) - first
    count = int(at[-1]) + 1 if len(rows) else 0
    values, expected = np.full((count, len(signals)), np.nan), np.full((count, len(EXPECTED)), np.nan)
    values[at], expected[at] = rows, told[EXPECTS]
    is_known = np.zeros(count, dtype=np.bool_)
    is_known[at] = True
    columns: dict[str, NDArray[Any]] = {}
    for name in BY_TICK:
        nothing: float | bool | int = np.nan if name in _NUMBERS else False if name == "gated" else -1
        columns[name] = np.full(count, nothing, dtype=told[name].dtype)
        columns[name][at] = told[name]
    return Recorded(
        machine="",
        tick_s=tick_s,
        signals=signals,
        values=values,
        programs=tuple(told[PROGRAMS].tolist()),
        **columns,
        expected=expected if np.isfinite(expected).any() else None,
        is_known=is_known,
        first_tick=first,
    )


def scores_alone(model: PartsModel, recorded: Recorded) -> Floats:
    """Scores (n,) at the ticks that the machine told of, without peers; NaN = not known."""
    return np.asarray(replayed([model], [recorded]).own_scores[_known(recorded), 0], dtype=np.float64)


def _known(recorded: Recorded) -> NDArray[np.intp]:
    return np.arange(len(recorded.values)) if recorded.is_known is None else np.flatnonzero(recorded.is_known)
