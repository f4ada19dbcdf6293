"""Recordings of small cells."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.runlog import RunLog, run_log

Floats = NDArray[np.float64]
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")
SPREAD, CENTRE = np.array([10.0, 1000.0, 300.0, 5.0, 0.1]), np.array([40.0, 6000.0, 1000.0, 40.0, 0.2])
CHANGE_EVERY_S, CHANGE_S = 400.0, 7.3


def correlated(count: int, seed: int, phi: float = 0.9) -> Floats:
    """(count, 5) of noise that remembers, as machines do."""
    generator = np.random.default_rng(seed)
    noise = generator.normal(size=(count, 5)) * np.sqrt(1.0 - phi * phi)
    for i in range(1, count):
        noise[i] += phi * noise[i - 1]
    return noise


def machine_log(
    seconds: float, seed: int, *, period_s: float = 0.5, sparse: bool = False, burst_s: Any = (), source: str = "run"
) -> RunLog:
    """A machine with a tool change every 400 s, in which its load falls; with `sparse`, each signal is told now and then only."""
    generator = np.random.default_rng(seed + 1000)
    t_s = np.arange(0.0, seconds, period_s) + 0.013
    if sparse:
        t_s = np.sort(t_s + generator.uniform(0.0, 0.9 * period_s, len(t_s))).round(3)
    values = CENTRE + SPREAD * correlated(len(t_s), seed)
    active = (t_s % CHANGE_EVERY_S) > CHANGE_EVERY_S - CHANGE_S
    values[active, 0] -= 60.0
    values[active, 1] = 0.0
    for start_s in burst_s:
        values[(t_s >= start_s) & (t_s < start_s + 30.0)] += 12.0 * SPREAD
    columns: dict[str, Any] = {
        "t_s": t_s,
        **dict(zip(FEATURES, values.T, strict=True)),
        "tool_change_active": active.astype(float),
    }
    if sparse:
        for name in FEATURES:
            columns[name] = np.where(generator.random(len(t_s)) < 0.4, columns[name], np.nan)
        told = np.diff(columns["tool_change_active"], prepend=-1.0) != 0.0
        columns["tool_change_active"] = np.where(told, columns["tool_change_active"], np.nan)
    return run_log(columns, source)
