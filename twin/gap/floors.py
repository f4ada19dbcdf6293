"""The floor under every gap: the difference of runs of a machine when nothing has changed.

Repeatability comes from repeated runs of a program (rms of their difference over √2, by signal and regime), or from the laps of a
run that goes through the same motion again and again; it is never less than the noise of the sensor. Two runs with a few stops in
them can agree by luck, so the spread that the twin expects of its own courses (`twin.servo.disturbance`) counts as well.

Laps are not known to be alike: somebody may have pushed the axis in one of them. Blocks of a tenth of a second in which two laps
differ by more than EVENT times what they differ by elsewhere in the regime are events, which count as gap and not as floor:

    s² = mean of the blocks' mean squares m that are at most EVENT² s²,   from the lower quartile of m over that of χ²(1) on

An axis that was pushed while it stood, or just before, stands elsewhere until it has moved again: so long the event lasts.
n samples that differ with a correlation time τ give the floor with a relative standard error of 1 / √(2 n / τ).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from twin.case import Run
from twin.gap.dynamometer.turn_run import SPREAD
from twin.gap.labels import measured_signals, regimes_of
from twin.gap.significance import correlation_time
from twin.machine import MachineFile
from twin.regimes import Regime
from twin.runlog import AXIS_COLUMN, RunLog
from twin.simulator.recorded import noise_of, resolution

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Key = tuple[str, str]
LAP_SAMPLES_MIN = 200
EVENT = 4.0
"""Laps of a real axis differ in their worst block by less than three times what they differ by elsewhere."""
WAKE = 1.5
"""The same of the blocks beside an event."""
BLOCK_S = 0.1
LASTING = (Regime.REST.title, Regime.REVERSAL.title)
LOWER, LOWER_CHI2 = 0.25, 0.1015
"""Lower quartile, and that of χ² with one degree of freedom: a block in which the difference hardly changes has one."""
AIR_K = 0.15
"""The difference of the air at a spindle from that at its thermometer, in recordings of plain production: a temperature that a
control shows in steps coarser than its noise. A warm-up that is measured for its own sake has a thermometer where it matters."""
RARE = 0.75
"""Part of a regime up to which samples are left out as events or their wake."""


@dataclass(frozen=True, slots=True)
class Floors:
    """Floors by (signal, regime).

    repeated: rms, from repeated runs or laps; expected: rms, from the twin's own courses
    opened: rms, of axes that their open loops decide; these stand in place of the others
    error: relative standard error of `repeated`; notes: sentences on the origin of the floors and their certainty
    """

    machine: MachineFile
    repeated: Mapping[Key, float]
    expected: Mapping[Key, float] = field(default_factory=dict)
    error: Mapping[Key, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    opened: Mapping[Key, float] = field(default_factory=dict)

    @property
    def opened_axes(self) -> frozenset[str]:
        """Letters of the axes that their open loops decide."""
        return frozenset(signal.partition("_")[0] for signal, _ in self.opened)

    def of(self, log: RunLog, signal: str) -> Floats:
        """The floor of each sample of a signal, (n,)."""
        if log.has(f"{signal}{SPREAD}"):  # mean turns bring their own
            return log[f"{signal}{SPREAD}"]
        noise = noise_of(self.machine, log, signal)
        if signal.endswith("_temp_c") and resolution(log[signal]) > noise:
            noise = float(np.hypot(noise, AIR_K))
        floor = np.full(len(log), noise)
        for regime, here in regimes_of(log, signal, self.machine):
            key = (signal, regime)
            known = [v for v in (self.repeated.get(key), self.expected.get(key)) if v is not None]
            floor[here] = self.opened.get(key, max([noise, *known]))
        return floor


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Two recordings of one motion: `one` from sample `lag` on beside `other`; lag is 0 where they are two runs."""

    name: str
    one: RunLog
    other: RunLog
    lag: int

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that both have."""
        return tuple(s for s in measured_signals(self.one) if self.other.has(s))

    def difference(self, signal: str) -> Floats:
        """The difference of a signal over √2, (n − lag,)."""
        return np.asarray((self.one[signal][self.lag :] - self.other[signal][: len(self.other) - self.lag]) / np.sqrt(2.0))

    def regimes(self, signal: str, machine: MachineFile) -> list[tuple[str, Bools]]:
        """The regimes of a signal with the samples of its difference, (n − lag,), that are there."""
        there = np.isfinite(self.difference(signal))
        return [(name, there & here[self.lag :]) for name, here in regimes_of(self.one, signal, machine)]


def repeatability(runs: Iterable[Run], repeats: Iterable[tuple[Run, Run]], machine: MachineFile) -> Floors:
    """The floors that the runs themselves show.

    Runs that were read at other times, as of a control that reports changes only, do not tell by their samples what repeats.
    """
    pairs = [_Pair(one.name, one.log, other.log, 0) for one, other in repeats if _are_in_step(one.log, other.log)]
    if pairs:
        return _floors(pairs, [{} for _ in pairs], {}, machine, ())
    laps = [_Pair(run.name, run.log, run.log, lag) for run in runs if (lag := lap_of(run.log))]
    usual = _usual(laps, machine)
    events = [_events(pair, usual, machine) for pair in laps]
    notes = [_origin(laps), *(e.sentence for e in events if e.samples)]
    # the laps before and after one with an event still tell what repeats there
    over = [replace(p, lag=2 * p.lag) for p, e in zip(laps, events, strict=True) if e.samples and 3 * p.lag <= len(p.one)]
    outs = [e.samples for e in [*events, *(_events(pair, usual, machine) for pair in over)]]
    return _floors([*laps, *over], outs, usual, machine, notes)


def _are_in_step(one: RunLog, other: RunLog) -> bool:
    """Return True where two runs have as many samples, at the same times after their start."""
    if len(one) != len(other) or len(one) < 2:
        return False
    apart_s = np.abs((one.t_s - one.t_s[0]) - (other.t_s - other.t_s[0]))
    return bool(apart_s.max() <= 0.5 * np.median(np.diff(one.t_s)))


def _floors(
    pairs: Sequence[_Pair],
    events: Sequence[Mapping[str, Bools]],
    usual: Mapping[Key, float],
    machine: MachineFile,
    notes: Sequence[str],
) -> Floors:
    """The floors of pairs of recordings.

    events: of each pair, what moves together → samples, (n − lag,), that do not count
    usual: rms by (signal, regime) without events, for regimes that events reach into nearly everywhere
    """
    parts: dict[Key, list[tuple[Floats, Bools, Bools]]] = {}
    for pair, event in zip(pairs, events, strict=True):
        for signal in pair.signals:
            difference, out = pair.difference(signal), event.get(_moved_with(signal))
            for regime, here in pair.regimes(signal, machine):
                if here.any():
                    kept = here if out is None else here & ~out
                    parts.setdefault((signal, regime), []).append((difference, here, kept))
    repeated, error = {}, {}
    for key, found in parts.items():
        rare = sum(kept.sum() for _, _, kept in found) > (1.0 - RARE) * sum(here.sum() for _, here, _ in found)
        counted = [(difference, kept if rare else here) for difference, here, kept in found]
        values = [difference[there] for difference, there in counted if there.any()]
        repeated[key] = float(np.sqrt(np.mean(np.concatenate(values) ** 2))) if rare else usual[key]
        worth = sum(there.sum() / correlation_time(np.where(there, d, 0.0)) for d, there in counted if there.any())
        error[key] = float(1.0 / np.sqrt(2.0 * max(float(worth), 1.0)))
    return Floors(machine, repeated, {}, error, (*notes, *_certainty(error)))


def _usual(pairs: Sequence[_Pair], machine: MachineFile) -> dict[Key, float]:
    """Return the usual difference of laps, rms by (signal, regime), without their events; at least the noise of the sensor."""
    found: dict[Key, list[tuple[Floats, Floats]]] = {}
    noise: dict[str, float] = {}
    for pair in pairs:
        for signal in pair.signals:
            noise[signal] = max(noise.get(signal, 0.0), noise_of(machine, pair.one, signal))
            for regime, here in pair.regimes(signal, machine):
                if here.any():
                    _, mean, count = _blocks(pair, signal, here)
                    found.setdefault((signal, regime), []).append((mean, count))
    usual = {}
    for (signal, regime), parts in found.items():
        mean, count = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
        usual[signal, regime] = max(without_events(mean, count), noise[signal])
    return usual


def without_events(mean: Floats, count: Floats) -> float:
    """The rms of blocks of these mean squares and counts, (blocks,), without those that stand out.

    >>> round(without_events(np.array([1.0, 1.2, 0.8, 1.0, 400.0]), np.full(5, 100.0)), 6)
    1.0
    """
    order = np.argsort(mean)
    least = float(mean[order][np.searchsorted(np.cumsum(count[order]), LOWER * count.sum())])
    square = least / LOWER_CHI2
    for _ in range(len(mean)):
        kept = mean <= EVENT**2 * square
        again = max(float(np.average(mean[kept], weights=count[kept])), least)
        if again == square:
            break
        square = again
    return float(np.sqrt(square))


def _blocks(pair: _Pair, signal: str, here: Bools) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Number, mean square and samples of each block of a pair within `here`, (blocks,)."""
    number, block = np.unique(_block_of(pair)[here], return_inverse=True)
    count = np.bincount(block).astype(np.float64)
    return number, np.bincount(block, pair.difference(signal)[here] ** 2) / count, count


def _block_of(pair: _Pair) -> NDArray[np.intp]:
    t_s = pair.one.t_s[pair.lag :]
    return np.asarray((t_s - pair.one.t_s[0]) / BLOCK_S, dtype=np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class _Events:
    """Events of a pair. samples: axis, or signal that is none of an axis → its samples, (n − lag,), in an event or its wake"""

    samples: Mapping[str, Bools]
    sentence: str


def _events(pair: _Pair, usual: Mapping[Key, float], machine: MachineFile) -> _Events:
    """Find the blocks in which a pair differs by far more than usual."""
    times: dict[str, dict[int, float]] = {}
    largest: dict[str, float] = {}
    for signal in pair.signals:
        over = times.setdefault(_moved_with(signal), {})
        for regime, here in pair.regimes(signal, machine):
            if not here.any():
                continue
            number, mean, _ = _blocks(pair, signal, here)
            for block, ratio in zip(number.tolist(), (np.sqrt(mean) / usual[signal, regime]).tolist(), strict=True):
                over[block] = max(over.get(block, 0.0), ratio)
                if ratio > EVENT:
                    largest[signal] = max(largest.get(signal, 0.0), ratio)
    wakes = {moved: _with_wake(over) for moved, over in times.items()}
    out = {moved: np.isin(_block_of(pair), sorted(wake)) for moved, wake in wakes.items() if wake}
    told = sorted(set().union(*wakes.values()))
    places = 1 + sum(after > before + 1 for before, after in pairwise(told))
    shown = ", ".join(f"{signal} by {ratio:.0f} times" for signal, ratio in largest.items())
    return _Events(
        {moved: _until_moved(samples, pair, moved, machine) for moved, samples in out.items()},
        f"{pair.name}: in {places} {'place' if places == 1 else 'places'} laps differ by far more than elsewhere ({shown}), "
        f"first {told[0] * BLOCK_S if told else 0.0:.1f} s after the start: this counts as gap and not as floor",
    )


def _with_wake(times: Mapping[int, float]) -> set[int]:
    """The blocks of events, and those beside them that have not come to rest. times: block → difference over the usual one"""
    events = {block for block, ratio in times.items() if ratio > EVENT}
    return events | {b for e in events for b in (e - 1, e + 1) if times.get(b, 0.0) > WAKE}


def _until_moved(out: Bools, pair: _Pair, moved: str, machine: MachineFile) -> Bools:
    """The samples of events, (n − lag,), with the rest of each standstill and reversal that they reach into."""
    still = np.zeros(len(out), dtype=bool)
    for regime, here in pair.regimes(next(s for s in pair.signals if _moved_with(s) == moved), machine):
        still |= here & (regime in LASTING)
    index = np.arange(len(out))
    moving = np.maximum.accumulate(np.where(still, -1, index))
    event = np.maximum.accumulate(np.where(out, index, -1))
    return np.asarray(out | (still & (event >= moving) & (event >= 0)))


def _moved_with(signal: str) -> str:
    """Return what else is pushed where a signal is: the axis of it, or the signal itself."""
    match = AXIS_COLUMN.match(signal)
    return match[1] if match else signal


def _origin(pairs: Sequence[_Pair]) -> str:
    """Say where the floors come from, where no run was repeated."""
    if not pairs:
        return (
            "no run was repeated, and none goes through a motion twice: the repeatability is the noise of the sensors alone, so "
            "what the machine does by chance counts as gap"
        )
    laps = ", ".join(f"{len(pair.one) / pair.lag:.1f} of {pair.name}" for pair in pairs)
    return f"no run was repeated: the repeatability is what the laps of a run differ by ({laps})"


def _certainty(error: Mapping[Key, float]) -> tuple[str, ...]:
    """Say how well the floors are known."""
    if not error:
        return ()
    best, worst = min(error.values()), max(error.values())
    (signal, regime), _ = max(error.items(), key=lambda item: item[1])
    return (f"the repeatability is known to {100 * best:.0f} to {100 * worst:.0f} % (least: {signal}, {regime})",)


def lap_of(log: RunLog) -> int:
    """Samples after which the references of all axes repeat, for at least a quarter of the run; 0 where they do not.

    >>> from twin.runlog import run_log
    >>> t_s = np.arange(3000) * 0.001
    >>> lap_of(run_log({"t_s": t_s, "x_ref_mm": np.sin(2 * np.pi * np.arange(3000) / 1000)}))
    1000
    """
    references = [v for name, v in log.columns.items() if (m := AXIS_COLUMN.match(name)) and m[2] == "ref_mm"]
    if not references or len(log) < 2 * LAP_SAMPLES_MIN:
        return 0
    moving = max(references, key=lambda r: float(np.nanstd(r)))
    values = moving - np.nanmean(moving)
    size = float(np.std(values))
    if not np.isfinite(values).all() or size == 0.0:
        return 0
    spectrum = np.fft.rfft(values, 2 * len(values))
    together = np.fft.irfft(spectrum * np.conj(spectrum))[: len(values)]
    energy = np.concatenate([[0.0], np.cumsum(values**2)])
    lags = np.arange(LAP_SAMPLES_MIN, 3 * len(values) // 4)
    apart = energy[len(values) - lags] + energy[-1] - energy[lags] - 2.0 * together[lags]
    near = np.flatnonzero(apart / (len(values) - lags) < 1e-6 * size**2)
    lag = int(lags[near[0]]) if len(near) else 0
    if lag and all(np.sqrt(np.mean((r[lag:] - r[: len(r) - lag]) ** 2)) < 1e-3 * size for r in references):
        return lag
    return 0
