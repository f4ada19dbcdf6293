"""Traces as they travel in the page: samples as 16-bit integers in base64, floors and regimes as the places where they change.

A run that is too long is thinned: of each stretch the samples stay at which the recording or a gap is least or greatest, so
that no peak is lost and every point that is drawn was recorded.
"""

import base64
import json
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.reports.gap.trace_choice import changed
from twin.gap.diagnosis import Trace

Floats = NDArray[np.float64]

BYTES_MAX = 900_000
"""The bytes of all samples of a page together."""
STEPS_MAX = 2000
MISSING = 65535


def thinned(trace: Trace, rows_max: int) -> Trace:
    """The trace with no more than about `rows_max` samples."""
    n = len(trace.t_s)
    if n <= rows_max:
        return trace
    size = -(-6 * n // rows_max)
    full = -(-n // size) * size
    kept = [np.array([0, n - 1])]
    for values in (trace.measured, trace.before - trace.measured, trace.after - trace.measured):
        for sign in (1.0, -1.0):
            padded = np.full(full, np.inf)
            padded[:n] = np.where(np.isfinite(values), sign * values, np.inf)
            rows = padded.reshape(-1, size)
            there = np.isfinite(rows).any(axis=1)
            kept.append((np.arange(len(rows)) * size + rows.argmin(axis=1))[there])
    index = np.unique(np.concatenate(kept))
    names = ("t_s", "measured", "before", "after", "floor", "regime")
    return replace(trace, **{name: getattr(trace, name)[index] for name in names})


def rows_max(traces: int, series: int = 3) -> int:
    """Return the most samples for each of so many traces: 16 bit each, in base64, and the time of each if they are thinned."""
    return int(BYTES_MAX / max(traces, 1) / (series * 2 * 4 / 3))


def packed(trace: Trace, scale: float, window_s: tuple[float, float]) -> dict[str, Any]:
    """A trace for the page; gaps are multiplied by `scale` so that they are in the unit that they are shown in."""
    given: dict[str, Any] = {
        "n": len(trace.t_s),
        "scale": scale,
        "window": [round(at, 6) for at in window_s],
        **_times(trace.t_s),
    }
    given["measured"] = _samples(trace.measured)
    given["before"] = _samples(scale * (trace.before - trace.measured))
    if changed(trace):
        given["after"] = _samples(scale * (trace.after - trace.measured))
    given["floor"] = _steps(scale * trace.floor)
    given["regime"] = [[int(i), int(trace.regime[i])] for i in np.flatnonzero(np.diff(trace.regime, prepend=-100))[:STEPS_MAX]]
    given["regimes"] = list(trace.regimes)
    return given


def as_script(packed_traces: list[dict[str, Any]]) -> str:
    """JSON that can stand in a page: no text in it can end the element that it is in."""
    text = json.dumps(packed_traces, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _times(t_s: Floats) -> dict[str, Any]:
    period_s = float(t_s[-1] - t_s[0]) / (len(t_s) - 1)
    if np.abs(t_s - (t_s[0] + period_s * np.arange(len(t_s)))).max() < 0.02 * period_s:
        return {"t0": float(t_s[0]), "dt": period_s}
    return {"t": base64.b64encode(t_s.astype("<f4").tobytes()).decode()}


def _samples(values: Floats) -> dict[str, Any]:
    """Values as 0 … 65534 between the least and the greatest, 65535 where there is none."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    step = (high - low) / (MISSING - 1) or 1.0
    whole = np.where(np.isfinite(values), np.round((np.nan_to_num(values) - low) / step), MISSING)
    return {"low": low, "step": step, "data": base64.b64encode(whole.astype("<u2").tobytes()).decode()}


def _steps(values: Floats) -> list[list[float | None]]:
    """[index, value] wherever the value changes; blocks of their mean square where it changes all the time."""
    changes = np.flatnonzero(np.append(True, np.diff(np.nan_to_num(values, nan=-1.0)) != 0.0))
    if len(changes) > STEPS_MAX:
        blocks = np.array_split(np.arange(len(values)), STEPS_MAX // 4)
        return [[int(b[0]), float(f"{np.sqrt(np.mean(np.nan_to_num(values[b]) ** 2)):.5g}")] for b in blocks if len(b)]
    return [[int(i), float(f"{values[i]:.5g}") if np.isfinite(values[i]) else None] for i in changes]
