"""The answer: `diagnosis.json` (formats, section 6), typed, and back again.

`closure` is 1 − (after² − floor²) / (before² − floor²), clipped to 0 … 1: the share of the reducible gap that is gone.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.machine import MachineFile

Floats = NDArray[np.float64]


class Verdict(StrEnum):
    """The verdict: how much of the gap the named causes are.

    healthy: there is none beyond what repeated runs differ by; explained: what is left is no more than that; partly_explained:
    most of it is gone, and a remainder has no name; unknown: there is a gap, and nothing in the catalogue is its cause
    """

    HEALTHY = "healthy"
    EXPLAINED = "explained"
    PARTLY = "partly_explained"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Effected:
    """An effect of the catalogue and what it is put on."""

    effect: str
    on: str = ""

    def __str__(self) -> str:
        return f"{self.effect} on {self.on}" if self.on else self.effect


@dataclass(frozen=True, slots=True)
class Cell:
    """A part of the gap: one signal in one regime (or one stretch of position, time, phase, section).

    share: of the energy of the gap of all signals of its kind, 0 to 1; effect_size: mean over the floor; rms: over the floor
    significance: p of the mean or of the energy being no more than what repeats, autocorrelation respected; discovered: whether
    it stands after the control of false discoveries
    """

    signal: str
    regime: str
    share: float
    effect_size: float
    rms: float
    significance: float
    discovered: bool
    sentence: str


@dataclass(frozen=True, slots=True)
class Pattern:
    """A pattern: a signal's gap goes with something, `over` position, lead phase, spindle phase, time, section, or a contrast.

    share: of the signal's gap energy that its means over the bins make up (of a contrast: that the difference makes up)
    effect_size: largest departure of a bin from the signal's mean, over the floor; significance, discovered: as of a Cell
    at, mean: the bins' middles and means of twin minus recording, in `at_unit` and the unit of the signal; empty for a contrast
    """

    signal: str
    over: str
    share: float
    effect_size: float
    significance: float
    discovered: bool
    sentence: str
    at_unit: str = ""
    at: tuple[float, ...] = ()
    mean: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Interval:
    """A figure with its 90 % interval."""

    value: float
    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Cause:
    """An effect that was found. closure: its share of the reducible gap, so that the shares of all causes add up."""

    effect: str
    on: str
    probability: float
    parameters: Mapping[str, Interval]
    indistinguishable_from: tuple[Effected, ...]
    closure: float


@dataclass(frozen=True, slots=True)
class SignalGap:
    """Root mean square of twin minus recording, in the unit of the signal, on runs that were not fitted."""

    before: float
    after: float
    floor: float
    unit: str


@dataclass(frozen=True, slots=True)
class GapNumbers:
    """The gap of all signals: rms over the floor.

    as_stated: of the machine as its file states it; before: with its constants refitted within their stated uncertainty, which is
    no cause; after: with the causes added; closure with its 90 % interval
    """

    as_stated: float
    before: float
    after: float
    floor: float
    closure: float
    closure_low: float
    closure_high: float
    by_signal: Mapping[str, SignalGap]


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect that was tried. closure: what it closes alone; p_value: of closing so much on a healthy machine."""

    effect: str
    on: str
    closure: float
    p_value: float


@dataclass(frozen=True, slots=True)
class NotObservable:
    """An effect that no recorded signal can show, or not at this rate, and why."""

    effect: str
    why: str


@dataclass(frozen=True, slots=True)
class NextExperiment:
    """A short program that would tell what these runs cannot. separation: of the hypotheses, in floors (0 = not worked out)."""

    why: str
    program: str
    seconds: float = 0.0
    separation: float = 0.0


@dataclass(frozen=True, slots=True)
class Subsystem:
    """A part of the machine compared alone, driven by what was measured at its input.

    subsystem: `x controller`, `x mechanics`, `x table`, `cut`, `spindle load`, `heat`, `program`, `clock`
    driven_by: the columns that drive it; compared: the column it answers with; before, after: rms over the floor
    causes: the names found there
    """

    subsystem: str
    driven_by: tuple[str, ...]
    compared: str
    before: float
    after: float
    verdict: Verdict
    causes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MovedConstant:
    """A constant of the machine that takes up a part of the gap.

    name: its path in machine.toml; deviations: stated standard deviations from stated to found; closure: of the gap as stated
    """

    name: str
    stated: float
    found: float
    deviations: float
    closure: float


@dataclass(frozen=True, slots=True)
class LooksLike:
    """A catalogue effect that is near a learned term, and why it is not its name."""

    effect: str
    on: str
    why_not: str


@dataclass(frozen=True, slots=True)
class Learned:
    """A term that was found and is in no catalogue: a description, not a cause (formats, section 6).

    closure: of the gap that is left without it, on runs that were not fitted, with its 90 % interval
    table: argument columns, then `value`, `low`, `high`, all of one length, a knot a row (`twin.learned.term`)
    """

    site: str
    on: str
    unit: str
    depends_on: tuple[str, ...]
    repeats: bool
    closure: float
    closure_low: float
    closure_high: float
    table: Mapping[str, tuple[float | str, ...]]
    looks_like: tuple[LooksLike, ...]
    sentence: str


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The answer. sentence: the verdict in one; notes: what else was found on the way, a sentence each."""

    verdict: Verdict
    sentence: str
    where: tuple[Cell, ...]
    where_after: tuple[Cell, ...]
    patterns: tuple[Pattern, ...]
    causes: tuple[Cause, ...]
    gap: GapNumbers
    candidates: tuple[Candidate, ...]
    not_observable: tuple[NotObservable, ...]
    not_identifiable: tuple[str, ...]
    next_experiment: NextExperiment | None
    notes: tuple[str, ...]
    seconds: float
    subsystems: tuple[Subsystem, ...] = ()
    constants: tuple[MovedConstant, ...] = ()
    learned: tuple[Learned, ...] = ()

    def to_json(self) -> str:
        """As `diagnosis.json`; a figure that there is none of is null."""
        return json.dumps(_plain(asdict(self)), indent=2, allow_nan=False) + "\n"


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """A signal of a run beside its twins, for looking at; (n,), NaN where there is no sample.

    before, after: the twin without and with the causes; floor: what repeated runs differ by; regime: (n,) index into `regimes`
    """

    run: str
    signal: str
    unit: str
    t_s: Floats
    measured: Floats
    before: Floats
    after: Floats
    floor: Floats
    regime: NDArray[np.int8]
    regimes: tuple[str, ...]
    fitted: bool


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosed:
    """The results of a diagnosis: the answer, the twin with constants refitted and causes added, and what to look at."""

    diagnosis: Diagnosis
    twin: MachineFile
    traces: tuple[Trace, ...] = field(default=())


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value


def closure_of(before: float, after: float, floor: float) -> float:
    """1 − (after² − floor²) / (before² − floor²), clipped to 0 … 1; 0 where there is nothing to close.

    >>> closure_of(5.0, 3.0, 1.0)
    0.6666666666666667
    >>> closure_of(1.0, 1.0, 1.0)
    0.0
    """
    reducible = before**2 - floor**2
    if reducible <= 0.0:
        return 0.0
    return float(min(1.0, max(0.0, 1.0 - (after**2 - floor**2) / reducible)))
