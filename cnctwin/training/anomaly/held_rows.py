"""A machine's signals at each tick: as last reported before it, as the stream's clock has it
(processors/running/lane.py).

A tick is at each multiple of tick_s, after the first message, up to the last; a silence longer than gap_s_max has the ticks of
its first gap_s_max.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from twin.runlog import RunLog

Floats = NDArray[np.float64]
Milliseconds = NDArray[np.int64]


def milliseconds(t_s: Floats) -> Milliseconds:
    """Times of samples as messages carry them."""
    return np.rint(t_s * 1000.0).astype(np.int64)


def ticks_ms(at_ms: Milliseconds, tick_ms: int, gap_ms: int) -> Milliseconds:
    """Ticks that the messages at these times bring.

    >>> ticks_ms(np.array([200, 1000, 9500]), 1000, 5000).tolist()
    [1000, 2000, 3000, 4000, 5000, 6000]
    """
    ends = np.minimum(at_ms[1:], at_ms[:-1] + gap_ms)
    first, last = at_ms[:-1] // tick_ms + 1, ends // tick_ms
    counts = np.maximum(last - first + 1, 0)
    starts = np.repeat(first - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    return np.asarray((starts + np.arange(counts.sum())) * tick_ms)


def held_rows(run: RunLog, names: Sequence[str], tick_ms: int, gap_ms: int) -> tuple[Milliseconds, Floats]:
    """Ticks (T,) and values (T, len(names)) as last reported before each; NaN where nothing was yet."""
    at_ms = milliseconds(run.t_s)
    ticks = ticks_ms(at_ms, tick_ms, gap_ms)
    before = np.searchsorted(at_ms, ticks) - 1  # a message at the tick itself comes after it
    place = np.arange(len(at_ms))
    rows = np.full((len(ticks), len(names)), np.nan)
    for column, name in enumerate(names):
        values = run.columns.get(name)
        if values is None:
            continue
        told = np.maximum.accumulate(np.where(np.isfinite(values), place, -1))[before]
        rows[:, column] = np.where(told >= 0, values[np.maximum(told, 0)], np.nan)
    return ticks, rows


def held_text(run: RunLog, name: str, ticks: Milliseconds) -> tuple[list[str | None], NDArray[np.int64]]:
    """The texts of a column, the last of them None, and (T,) which of them was last reported before each tick."""
    values = run.text.get(name)
    if values is None:
        return [None], np.zeros(len(ticks), dtype=np.int64)
    told = np.array([value is not None and value != "" for value in values], dtype=np.bool_)
    words: list[str | None] = list(dict.fromkeys(str(value) for value in values[told]))
    code = {word: number for number, word in enumerate(words)}
    codes = np.array([code[str(value)] if known else -1 for value, known in zip(values, told, strict=True)], dtype=np.int64)
    last = np.maximum.accumulate(np.where(told, np.arange(len(values)), -1))
    last = last[np.searchsorted(milliseconds(run.t_s), ticks) - 1]
    return [*words, None], np.where(last >= 0, codes[np.maximum(last, 0)], len(words))
