"""The place of the gap: every signal in every regime, beside the repeatability.

A cell is one signal in one regime over all runs that are looked at. With ρ = (twin − recording) / floor, its share of the gap is

    share = max(0, Σ ρ² − n) / the same summed over the cells of its group

that is, of the energy beyond what repeats; positions share one gap, torques another, forces a third. Of a group without any
energy beyond what repeats, the plain energy Σ ρ² is shared. Whether a cell is more than what repeats is `twin.gap.significance`,
with an axis at rest counted once for each time that it comes to rest; false discoveries are controlled over all cells together.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Cell, Trace
from twin.gap.significance import Means, discoveries, means_of
from twin.gap.wording import figure, group_of, percent, regime_words, signal_words, times_floor
from twin.regimes import Regime

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class _Signal:
    """A signal over all its runs: its regimes that have samples, their means in floors and in its own unit."""

    name: str
    unit: str
    regimes: tuple[str, ...]
    means: Means
    mean: Floats
    rms: Floats

    def excess(self) -> Floats:
        """Energy beyond what repeats, (regimes,), in floors²."""
        return np.asarray(np.maximum(0.0, (self.means.rms**2 - 1.0) * self.means.count))


def where(traces: Sequence[Trace], *, after: bool = False) -> tuple[Cell, ...]:
    """The cells of the gap: those that were discovered first, largest share first.

    traces: of the runs to look at, as a rule those that were not fitted; after: look at the twin with the causes added
    """
    signals = [_signal(name, traces_of, after) for name, traces_of in by_signal(traces)]
    signals = [signal for signal in signals if signal.regimes]
    if not signals:
        return ()
    p = np.concatenate([signal.means.p() for signal in signals])
    stands = iter(discoveries(p).tolist())
    cells = []
    for signal in signals:
        group = [other for other in signals if group_of(other.name) == group_of(signal.name)]
        energy = np.concatenate([other.excess() for other in group]).sum()
        plain = np.concatenate([other.means.rms**2 * other.means.count for other in group]).sum()
        of = signal.excess() / energy if energy > 0.0 else signal.means.rms**2 * signal.means.count / max(float(plain), 1e-300)
        significance = signal.means.p()
        for number, regime in enumerate(signal.regimes):
            cells.append(_cell(signal, number, regime, float(of[number]), float(significance[number]), next(stands)))
    return tuple(sorted(cells, key=lambda cell: (not cell.discovered, -cell.share)))


def by_signal(traces: Iterable[Trace]) -> tuple[tuple[str, tuple[Trace, ...]], ...]:
    """Traces by their signals, each over all its runs."""
    found: dict[str, list[Trace]] = {}
    for trace in traces:
        found.setdefault(trace.signal, []).append(trace)
    return tuple((name, tuple(of)) for name, of in found.items())


def gap_of(trace: Trace, after: bool) -> Floats:
    """Twin minus recording, (n,), in the unit of the signal; NaN where there is no sample, or no floor to measure it by."""
    gap = (trace.after if after else trace.before) - trace.measured
    return np.where(np.isfinite(trace.floor) & (trace.floor > 0.0), gap, np.nan)


def _signal(name: str, traces: tuple[Trace, ...], after: bool) -> _Signal:
    """Means of a signal by regime."""
    gap = np.concatenate([gap_of(trace, after) for trace in traces])
    floor = np.concatenate([trace.floor for trace in traces])
    in_floors = gap / np.where(floor > 0.0, floor, np.nan)
    known = np.isfinite(in_floors)
    every = tuple(dict.fromkeys(n for trace in traces for n in trace.regimes))
    code = np.concatenate([np.array([every.index(n) for n in trace.regimes])[trace.regime] for trace in traces])
    there = [(n, known & (code == i)) for i, n in enumerate(every)]
    names = tuple(n for n, cell in there if cell.any())
    cells = np.array([cell for _, cell in there if cell.any()], dtype=bool).reshape(-1, len(gap))
    count = np.maximum(cells.sum(axis=1), 1)
    plain = np.where(known, gap, 0.0)
    means = means_of(in_floors, cells, np.array([_pieces(n, cell) for n, cell in zip(names, cells, strict=True)]))
    return _Signal(name, traces[0].unit, names, means, cells @ plain / count, np.sqrt(cells @ plain**2 / count))


def _pieces(regime: str, cell: NDArray[np.bool_]) -> float:
    """Return what the samples of a regime are worth at most: where an axis comes to rest is one chance for each time that it
    does."""
    return float(np.sum(np.diff(cell.astype(np.int8), prepend=0) == 1)) if regime == Regime.REST.title else np.inf


def _cell(signal: _Signal, number: int, regime: str, share: float, p: float, discovered: bool) -> Cell:
    effect, rms = abs(float(signal.means.mean[number])), float(signal.means.rms[number])
    where_to = f"{signal_words(signal.name)} {regime_words(regime)}"
    mean, size = float(signal.mean[number]), float(signal.rms[number])
    if not discovered:
        sentence = f"{where_to}: within the repeatability (rms {figure(size, signal.unit)})"
    elif effect >= 0.5 * rms:
        says = f"mean {figure(mean, signal.unit)} (twin minus recording), {times_floor(effect)}"
        sentence = f"{percent(share)} of the gap in {group_of(signal.name)} is in {where_to}: {says}"
    else:
        says = f"rms {figure(size, signal.unit)} about a mean of {figure(mean, signal.unit)}, {times_floor(rms)}"
        sentence = f"{percent(share)} of the gap in {group_of(signal.name)} is in {where_to}: {says}"
    return Cell(signal.name, regime, share, effect, rms, p, discovered, sentence)
