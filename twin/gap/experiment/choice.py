"""The next experiment: of short, safe programs, the one that best tells hypotheses apart that the recordings could not.

For two hypotheses i and j and a program, d = (f_i − f_j) / floor, and the columns of J are what one standard deviation of each
constant of the machine, and of each parameter of the two effects, would change in floors. The separation is that of the two
predictive distributions (Mahalanobis; T-optimality with refit, Atkinson and Fedorov 1975, Biometrika 62(1)):

    D_ij = dᵀ (I / w + J Jᵀ)⁻¹ d = w [ dᵀd − w dᵀJ (I + w JᵀJ)⁻¹ Jᵀd ]        w = sample period / correlation time

with a correlation time of what repeats of 50 ms for axes and cut, 60 s for heat; √D is the separation in floors. Of the programs
that separate by 5 floors or more, and by one in the signal that shows most, the one with the largest D a second is chosen. Where
none does with the signals that are recorded, one is looked for that would with a table scale, a dynamometer or a load meter.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import On
from twin.gap.diagnosis import Effected, NextExperiment
from twin.gap.experiment.envelope import Envelope
from twin.gap.experiment.menu import Shows, Snippet, axis_menu, machine_menu
from twin.gap.experiment.run import Columns, Trial, sensitivities, shown, trial_of
from twin.gap.wording import digits
from twin.machine import MachineFile
from twin.runlog import AXIS_COLUMN
from twin.simulator.response import noise_key
from twin.sites import Site

Floats = NDArray[np.float64]
Hypothesis = tuple[Effected, MachineFile]

SEPARATED = 5.0
"""√D from which two hypotheses count as told apart, in floors."""
CLEAR = 3.0 * SEPARATED
"""No further program is looked at once one separates all hypotheses so far."""
LARGEST_MIN = 1.0
STRIDE = 5
CORRELATION_S = {Shows.AXIS: 0.05, Shows.SPINDLE: 0.2, Shows.CUT: 0.05, Shows.HEAT: 60.0}
LONG_S = 60.0
"""Programs longer than this are tried only where no shorter one does."""
SENSORS = {
    "pos_mm": 0.001,
    "table_mm": 0.001,
    "torque_a": 0.03,
    "force_x_n": 5.0,
    "force_y_n": 5.0,
    "spindle_load_pct": 0.5,
    "spindle_temp_c": 0.2,
}
"""Noise of a sensor that is not there yet: as machine.toml states it, else a middling one."""


@dataclass(frozen=True, slots=True)
class Separation:
    """The distance of two hypotheses in a program. largest: of the differences in the signal that shows most, in floors."""

    first: Effected
    second: Effected
    floors: float
    signal: str
    largest: float

    @property
    def tells(self) -> bool:
        """True where it tells them apart."""
        return self.floors >= SEPARATED and self.largest >= LARGEST_MIN


@dataclass(frozen=True, slots=True)
class _Option:
    """A program and what it separates."""

    trial: Trial
    pairs: tuple[Separation, ...]

    @property
    def apart(self) -> tuple[Separation, ...]:
        """The pairs that it tells apart."""
        return tuple(pair for pair in self.pairs if pair.tells)

    @property
    def worth(self) -> tuple[int, float]:
        """Pairs told apart, then D a second of the nearest of them."""
        nearest = min((pair.floors for pair in self.apart), default=max(pair.floors for pair in self.pairs))
        return len(self.apart), nearest**2 / self.trial.seconds


def next_experiment(
    hypotheses: Sequence[Hypothesis],
    measured: frozenset[str],
    envelope: Envelope,
    floors: Mapping[str, float],
    *,
    nuisance: Mapping[str, float] | None = None,
) -> NextExperiment | None:
    """The program that tells these hypotheses apart; without one where nothing in the menu does, and then why.

    hypotheses: an effect, and the machine that has it; measured: columns that are recorded; envelope: what the recorded runs have
    done, which the program does not leave; floors: signal → what repeats; nuisance: path of a constant → its relative standard
    deviation, where it is another than the machine states

    None where there are not two hypotheses.
    """
    if len(hypotheses) < 2:
        return None
    seen = list(_snippets(hypotheses, envelope))
    short = _options(hypotheses, (s for s in seen if not _is_long(s)), measured, envelope, floors, nuisance or {})
    wanted = len(hypotheses) * (len(hypotheses) - 1) // 2
    if all(len(option.apart) < wanted for option in short):
        short += _options(hypotheses, (s for s in seen if _is_long(s)), measured, envelope, floors, nuisance or {})
    best = max(short, key=lambda option: option.worth, default=None)
    if best is not None and best.apart:
        return _answer(best, hypotheses, "")
    more = _options(hypotheses, seen[:6], None, envelope, floors, nuisance or {})
    better = max(more, key=lambda option: option.worth, default=None)
    if better is not None and better.apart:
        return _answer(better, hypotheses, f"; record {better.apart[0].signal} as well, without it these runs cannot tell")
    return NextExperiment(_nothing(hypotheses, best), "", 0.0, 0.0 if best is None else max(p.floors for p in best.pairs))


def _is_long(snippet: Snippet) -> bool:
    """Return True where a program dwells or repeats for minutes."""
    waits = sum(float(block.partition("P")[2]) for block, _ in snippet.blocks if block.startswith("G4 P"))
    return waits > 1000.0 * LONG_S or len(snippet.blocks) > 60


def _snippets(hypotheses: Sequence[Hypothesis], envelope: Envelope) -> Iterator[Snippet]:
    """The part of the menu that the effects have to do with."""
    machine = hypotheses[0][1]
    wanted: set[Shows] = set()
    letters: list[str] = []
    for effected, _ in hypotheses:
        match = AXIS_COLUMN.match(effected.on)
        letter = match[1] if match else effected.on
        if letter in machine.axes:
            letters.append(letter)
        elif effected.on == "" and effect_named(effected.effect).site in (Site.REFERENCE, Site.CLOCK):
            letters += list(machine.axes)[:1]
        else:
            wanted |= _shows(effected)
    building_up = {effect_named(effected.effect).builds_up for effected, _ in hypotheses}
    for letter in dict.fromkeys(letters):
        for snippet in axis_menu(letter, envelope, machine.axes[letter].screw_lead_mm):
            if snippet.only_for is None or snippet.only_for in building_up:
                yield snippet
    for snippet in machine_menu(envelope):
        if snippet.shows in wanted:
            yield snippet


def _shows(effected: Effected) -> set[Shows]:
    """Return the kinds of programs that show an effect that is on no axis."""
    effect = effect_named(effected.effect)
    signals = [effected.on] if effect.on is On.SIGNAL else list(effect.shows_in)
    kinds: set[Shows] = set()
    for signal in signals:
        if signal.endswith("_temp_c"):
            kinds.add(Shows.HEAT)
        elif signal.startswith("spindle_load"):
            kinds |= {Shows.SPINDLE, Shows.CUT}
        else:
            kinds.add(Shows.CUT)
    return kinds


def _options(
    hypotheses: Sequence[Hypothesis],
    snippets: Iterable[Snippet],
    measured: frozenset[str] | None,
    envelope: Envelope,
    floors: Mapping[str, float],
    nuisance: Mapping[str, float],
) -> list[_Option]:
    """Each program with its separations; measured: None = with every signal that a machine can be given."""
    options = []
    for snippet in snippets:
        trial = trial_of(snippet, hypotheses[0][1], envelope)
        columns = [shown(machine, trial) for _, machine in hypotheses]
        signals = [name for name in columns[0] if all(name in c for c in columns) and (measured is None or name in measured)]
        if not signals:
            continue
        scale = {name: floors.get(name) or sensor_floor(hypotheses[0][1], name) for name in signals}
        plain = [_floors_apart(a, b, scale, [], trial) for a, b in combinations(columns, 2)]
        hidden: list[list[Columns]] = [[] for _ in hypotheses]
        if max(apart[0] for apart in plain) >= SEPARATED:
            pairs = zip(hypotheses, columns, strict=True)
            hidden = [sensitivities(e, machine, trial, base, nuisance) for (e, machine), base in pairs]
        found = []
        for i, j in combinations(range(len(hypotheses)), 2):
            apart = _floors_apart(columns[i], columns[j], scale, hidden[i] + hidden[j], trial)
            found.append(Separation(hypotheses[i][0], hypotheses[j][0], *apart))
        options.append(_Option(trial, tuple(found)))
        if min(pair.floors if pair.tells else 0.0 for pair in found) >= CLEAR:
            break
    return options


def _floors_apart(
    one: Columns, other: Columns, scale: Mapping[str, float], hidden: Sequence[Columns], trial: Trial
) -> tuple[float, str, float]:
    """√D of two hypotheses, the signal that shows most, and the largest difference in it, in floors."""
    period_s = float(trial.told.t_s[1] - trial.told.t_s[0])
    weight = min(1.0, STRIDE * period_s / CORRELATION_S[trial.snippet.shows])

    def stacked(of: Mapping[str, Floats]) -> Floats:
        return np.concatenate([of[name][::STRIDE] / floor for name, floor in scale.items()])

    apart = stacked({name: one[name] - other[name] for name in scale})
    apart = np.where(np.isfinite(apart), apart, 0.0)
    energy = weight * float(apart @ apart)
    if hidden:
        could = np.nan_to_num(np.array([stacked(change) for change in hidden]).T)
        inner = np.eye(could.shape[1]) + weight * could.T @ could
        energy -= weight**2 * float(apart @ could @ np.linalg.solve(inner, could.T @ apart))
    by_signal = dict(zip(scale, np.split(apart, len(scale)), strict=True))
    signal = max(by_signal, key=lambda name: float(by_signal[name] @ by_signal[name]))
    return float(np.sqrt(max(energy, 0.0))), signal, float(np.quantile(np.abs(by_signal[signal]), 0.99))


def sensor_floor(machine: MachineFile, signal: str) -> float:
    """Noise of the sensor of a signal: as the machine states it, else a middling one."""
    match = AXIS_COLUMN.match(signal)
    middling = SENSORS.get(match[2] if match else signal, 1.0)
    return machine.noise.get(noise_key(machine, signal)) or middling


def _names(effects: Iterable[Effected]) -> str:
    """Effects in words, `on` once where they share it."""
    listed = list(dict.fromkeys(effects))
    shared = {e.on for e in listed}
    names = [e.effect for e in listed] if len(shared) == 1 else [str(e) for e in listed]
    words = f"{', '.join(names[:-1])} from {names[-1]}" if len(names) > 1 else names[0]
    return f"{words} on {listed[0].on}" if len(shared) == 1 and listed[0].on else words


def _answer(option: _Option, hypotheses: Sequence[Hypothesis], more: str) -> NextExperiment:
    """The experiment in words."""
    nearest = min(option.apart, key=lambda pair: pair.floors)
    untold = [pair for pair in option.pairs if not pair.tells]
    left = f"; it leaves {_names([untold[0].first, untold[0].second])} untold" if untold else ""
    left += " and others" if untold[1:] else ""
    separated = _names(e for pair in option.apart for e in (pair.first, pair.second))
    why = (
        f"separates {separated}: {option.trial.snippet.does}; expected difference {digits(nearest.largest)} × the repeatability "
        f"in {nearest.signal}, {digits(nearest.floors)} over the program with what the constants can hide{left}{more}"
    )
    return NextExperiment(why, option.trial.snippet.program(), round(option.trial.seconds, 1), round(nearest.floors, 2))


def _nothing(hypotheses: Sequence[Hypothesis], best: _Option | None) -> str:
    """Why there is no experiment."""
    names = _names(e for e, _ in hypotheses)
    if best is None:
        return f"nothing in the menu shows {names}: no recorded run has moved, cut or warmed what they act on"
    pair = max(best.pairs, key=lambda p: p.floors)
    return (
        f"no program of the menu separates {names}: the best, {best.trial.snippet.does}, is expected to show "
        f"{digits(pair.largest)} × the repeatability in {pair.signal}, {digits(pair.floors)} over the program with what the "
        f"constants can hide; it takes {digits(SEPARATED)}"
    )
