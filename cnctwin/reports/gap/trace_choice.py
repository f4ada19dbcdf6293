"""The choice of signals that are worth a look, and of the part of the run where the gap is seen best."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cnctwin.reports.gap.signal_name import in_order_of_signals
from twin.gap.diagnosis import Trace

TRACES_MAX = 4
STANDS_OUT = 1.2
SLOW_S = 0.1
"""A signal that is sampled more slowly than this is looked at over the whole run."""
HOLE = 2.5
"""Usual spacings of a signal's samples beyond which one is missing."""

Floats = NDArray[np.float64]


def over_floor(trace: Trace) -> float:
    """Rms of the gap before over the rms of the floor; 0 where there is nothing to compare."""
    return _over_floor(trace, trace.before)


def left_over_floor(trace: Trace) -> float:
    """The same of the gap after."""
    return _over_floor(trace, trace.after)


def _over_floor(trace: Trace, twin: Floats) -> float:
    gap = twin - trace.measured
    there = np.isfinite(gap) & np.isfinite(trace.floor) & (trace.floor > 0.0)
    if not there.any():
        return 0.0
    return float(np.sqrt(np.mean(gap[there] ** 2) / np.mean(trace.floor[there] ** 2)))


def chosen(traces: Sequence[Trace]) -> tuple[Trace, ...]:
    """Up to four, the largest gap first; one a signal, rather of a run that was not fitted.

    The two largest stay if they stand out at all, further ones if they are a tenth of the largest, and the one of which most is
    left stays in any case. Motor and table side of an axis mostly show the same, so only one of them is looked at: the table side
    where it shows a tenth more.
    """
    best: dict[str, Trace] = {}
    for trace in traces:
        if len(trace.t_s) > 1 and (trace.signal not in best or _rank(trace) > _rank(best[trace.signal])):
            best[trace.signal] = trace
    ranked = sorted((best[name] for name in in_order_of_signals(best)), key=_interest, reverse=True)
    kept: list[Trace] = []
    for trace in ranked:
        if all(_place(other.signal) != _place(trace.signal) for other in kept):
            kept.append(trace)
    largest = over_floor(kept[0]) if kept else 0.0
    most_left = max(kept, key=left_over_floor, default=None)
    shown = [
        trace
        for place, trace in enumerate(kept)
        if not place or trace is most_left or over_floor(trace) > max(STANDS_OUT, largest / 10.0 if place > 1 else 0.0)
    ]
    return tuple(shown[:TRACES_MAX])


def at_own_samples(trace: Trace) -> Trace:
    """Return the trace at the samples of its signal, where that is sampled more slowly than its run.

    Of the rows between them, which hold nothing of the signal, the first one stays where more than `HOLE` usual spacings are
    without a sample, and the ends of the run stay: a line is broken at a hole, and nowhere else.
    """
    there = np.flatnonzero(np.isfinite(trace.measured))
    if len(there) < 2 or np.median(np.diff(there)) < 2:
        return trace
    spacing_s = np.diff(trace.t_s[there])
    holes = there[:-1][spacing_s > HOLE * np.median(spacing_s)] + 1
    kept = np.unique(np.concatenate([there, holes, [0, len(trace.t_s) - 1]]))
    names = ("t_s", "measured", "before", "after", "floor", "regime")
    return replace(trace, **{name: getattr(trace, name)[kept] for name in names})


def _rank(trace: Trace) -> tuple[bool, float]:
    return not trace.fitted, over_floor(trace)


def _interest(trace: Trace) -> float:
    return over_floor(trace) / (1.1 if "_table_" in trace.signal else 1.0)


def _place(signal: str) -> str:
    return signal.replace("_table_", "_pos_")


def changed(trace: Trace) -> bool:
    """Return True if the causes make another twin at all."""
    return not np.array_equal(trace.before, trace.after, equal_nan=True)


def window_s(trace: Trace) -> tuple[float, float]:
    """From when to when the gap is seen best: a twelfth of the run in which most of it is.

    What counts is the energy that the causes take away, where there are causes, of a sample no more than the 99th percentile so
    that no single spike decides; a part in which more regimes occur is preferred.
    """
    t_s = trace.t_s
    start, end = float(t_s[0]), float(t_s[-1])
    spacing_s = float(np.median(np.diff(t_s)))
    width_s = max((end - start) / 12.0, 300 * spacing_s)
    if spacing_s >= SLOW_S or width_s > 0.7 * (end - start):
        return start, end
    energy = (trace.before - trace.measured) ** 2
    if changed(trace):
        energy = energy - (trace.after - trace.measured) ** 2
    energy = np.nan_to_num(energy)
    energy = np.minimum(energy, np.percentile(energy, 99))
    total = np.concatenate([[0.0], np.cumsum(energy)])
    starts_s = np.append(np.arange(start, end - width_s, width_s / 8.0), end - width_s)
    first, last = np.searchsorted(t_s, starts_s), np.searchsorted(t_s, starts_s + width_s)
    score = np.maximum(total[last] - total[first], 0.0) * _regimes_in(trace, first, last)
    score = np.where(last - first > 1, score, -1.0)  # a hole in the recording shows nothing
    return float(starts_s[np.argmax(score)]), float(starts_s[np.argmax(score)] + width_s)


def _regimes_in(trace: Trace, first: NDArray[np.int64], last: NDArray[np.int64]) -> Floats:
    """Return how many regimes make up at least a twentieth of each part."""
    counts = np.zeros(len(first))
    for regime in range(len(trace.regimes)):
        seen = np.concatenate([[0], np.cumsum(trace.regime == regime)])
        counts += seen[last] - seen[first] > 0.05 * (last - first)
    return np.maximum(counts, 1.0)
