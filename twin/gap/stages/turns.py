"""The cut as a dynamometer alone recorded it: mean turns of the spindle beside those of the twin's tool (`twin.gap.dynamometer`).

A turn is compared by its orders (a line at so many times the spindle's frequency), in two parts, which speak of different things:
what all teeth do alike, and by what a tooth departs from the mean of all. Equal teeth have nothing of the second, whatever the
material, the chip or a resonance of the table does to the first, so what is left of one part drowns nothing in the other.

    tooth passing   orders 0, N, 2N, 3N          tooth to tooth   all others up to 3N

The phase of the spindle is a nuisance of each even stretch, and so is a shift within a tooth where the angle was recorded.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.case import Run
from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.effects.effect import Guesses, Recorded
from twin.gap.diagnosis import Effected
from twin.gap.dynamometer.cutting import FORCES
from twin.gap.dynamometer.low_pass import LowPass
from twin.gap.dynamometer.mean_turn import Engagement, best_phase, fine_turn, orders_of, turn_of
from twin.gap.dynamometer.turn_floor import turn_floor
from twin.gap.dynamometer.turn_run import TurnRun
from twin.gap.labels import regime_labels
from twin.gap.stages.cut import MATERIAL, acting, factored_tool, tool_path
from twin.gap.stages.free import Free, constant
from twin.gap.stages.observed_through import Sensing, sensor_effects
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.learned.standing import terms_at
from twin.learned.term import Term
from twin.learned.words import LearnedSite
from twin.machine import MachineFile
from twin.process.kernel import process_quantities
from twin.runlog import RunLog

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
TO_TOOTH = " tooth to tooth"
SETTLING_TURNS = 4
"""Turns that a sensor is driven through before the one that is compared."""
SLOPE_STEP = 0.01
"""A force that begins with the chip jumps where runout takes the chip away, and steps from node to node of the turn."""


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """An even stretch. measured: (signals, blocks, points), N"""

    cut: Engagement
    measured: Floats

    def orders(self, highest: int) -> Complexes:
        """Amplitudes of the orders of each block, (signals, blocks, orders)."""
        return orders_of(self.measured, highest)


@dataclass(frozen=True, slots=True, eq=False)
class TurnData:
    """A run as mean turns."""

    name: str
    log: RunLog
    signals: tuple[str, ...]
    stretches: tuple[Stretch, ...]
    highest: int
    knows_phase: bool
    knows_mean: bool
    fitted: bool


def turn_data(runs: tuple[Run, ...]) -> tuple[TurnData, ...]:
    """The runs that are mean turns."""
    return tuple(_data(run) for run in runs if isinstance(run, TurnRun))


def _data(run: TurnRun) -> TurnData:
    log = run.log
    signals = tuple(name for name in FORCES if log.has(name))
    stretches = []
    for number in np.unique(log["stretch"]):
        here = log["stretch"] == number
        feed, rpm, depth, entry, leaving, heading = (
            float(log[name][here][0])
            for name in ("feed_mm_min", "spindle_rpm", "axial_depth_mm", "entry_angle_rad", "exit_angle_rad", "heading_rad")
        )
        measured = np.stack([log[name][here].reshape(-1, run.points) for name in signals])
        stretches.append(Stretch(Engagement(rpm, feed / 60.0, depth, entry, leaving, heading), measured))
    return TurnData(
        run.name, log, signals, tuple(stretches), run.highest, run.knows_phase, run.knows_mean, run.entry.role == "fit"
    )


@dataclass(frozen=True, eq=False)
class TurnStage:
    """The cut of a case, in mean turns. low_pass: in the way of both forces, where one is supposed"""

    machine: MachineFile
    runs: tuple[TurnData, ...]
    left_out: frozenset[str] = frozenset()
    tool: str = ""
    low_pass: LowPass | None = None
    name: str = "cut"
    averaged: int = 1
    healthy_rms: float = 1.5
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.runs))

    @cached_property
    def standing(self) -> dict[str, Mapping[str, float]]:
        """Effects that the machine has already."""
        return added_effects(self.machine, process_quantities())

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Learned terms of the cut that the machine has already."""
        return terms_at(self.machine.learned, (LearnedSite.CUT_FORCE,))

    @property
    def constants(self) -> tuple[Free, ...]:
        """K_t and K_e."""
        stated = self.machine.uncertainty
        free = [constant(tool_path(self.tool, n), stated.get(f"tool.{n}", stated.get("relative", 0.05))) for n in MATERIAL]
        return tuple(p for p in free if p.sigma > 0.0)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """Effects that forces can show."""
        signals = {signal for run in self.runs for signal in run.signals}
        there = self.left_out | set(self.standing)
        here = [e for e in acting(process_quantities()) if e.name not in there and set(e.shows_in) & signals]
        found = [Effected(e.name, self.tool) for e in here]
        return tuple(dict.fromkeys((*found, *sensor_effects(signals, self.left_out))))

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return effect_named(candidate.effect).first_guesses(Recorded(self.machine.machine.servo_period_s))

    @property
    def teeth(self) -> int:
        """Teeth of the tool."""
        assert self.machine.tool is not None
        return self.machine.tool.teeth

    def _parts(self, run: TurnData) -> list[tuple[str, int, NDArray[np.intp]]]:
        """Name, number of the signal and orders of each part of a run that is compared."""
        order = np.arange(run.highest + 1)
        alike = order % self.teeth == 0
        parts = [(signal, n, order[alike]) for n, signal in enumerate(run.signals)]
        return parts + [(signal + TO_TOOTH, n, order[~alike]) for n, signal in enumerate(run.signals) if self.teeth > 1]

    def _observed(self, run: TurnData) -> Observed:
        label = regime_labels(run.log, run.signals[0], self.machine)[1][:1]
        measured = [stretch.orders(run.highest) for stretch in run.stretches]
        floors = [turn_floor(m, s.cut.rpm / 60.0) for m, s in zip(measured, run.stretches, strict=True)]
        counts = [m.shape[1] for m in measured]
        first = np.cumsum([0, *counts])
        parts = []
        for name, n, orders in self._parts(run):
            series = np.concatenate([_plain(m[n][:, orders]).ravel() for m in measured])
            floor, sigma = (
                np.concatenate([np.tile(np.repeat(v[n][orders], 2), count) for v, count in zip(values, counts, strict=True)])
                for values in ([f.floor for f in floors], [f.sigma(c) for f, c in zip(floors, counts, strict=True)])
            )
            block = np.repeat(np.arange(first[-1]), 2 * len(orders))
            # a mean has no imaginary part
            series = np.where(
                np.tile((np.repeat(orders, 2) == 0) & (np.arange(2 * len(orders)) % 2 == 1), first[-1]), np.nan, series
            )
            parts.append((name, series, floor, sigma, block, np.repeat(label, len(series))))
        return observed_of(run.name, parts, run.fitted, SLOPE_STEP)

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """Both parts of the turns at each row of θ, (lanes, n)."""
        data, shown = self.runs[run], self.turns(model, theta, run)
        parts = []
        for _, n, orders in self._parts(data):
            for turn, stretch in zip(shown, data.stretches, strict=True):
                parts.append(np.tile(_plain(turn[n][:, orders]), (1, stretch.measured.shape[1])))
        return np.concatenate(parts, axis=1)

    def shown(self, model: Model, theta: Floats, run: int) -> dict[str, Floats]:
        """Signal → the twin's turns at the first row of θ, in the rows of the run's log."""
        data, turns = self.runs[run], self.turns(model, theta, run)
        return {
            signal: np.concatenate(
                [
                    np.tile(turn_of(t[n][0], s.measured.shape[2]), s.measured.shape[1])
                    for t, s in zip(turns, data.stretches, strict=True)
                ]
            )
            for n, signal in enumerate(data.signals)
        }

    def turns(self, model: Model, theta: Floats, run: int) -> list[Complexes]:
        """The orders of the turn of each stretch, where it lies best over the recorded one; (signals, lanes, orders)."""
        data = self.runs[run]
        values, constants = model.values(theta), self._constants(model, theta)
        sensing = [Sensing.of(values, signal) for signal in data.signals]
        orders = [self._orders(constants, sensing, stretch, data) for stretch in data.stretches]
        phases = self._phases(orders, data)
        return [found * np.exp(-1j * np.arange(data.highest + 1) * p[:, None]) for found, p in zip(orders, phases, strict=True)]

    @cached_property
    def _seen(self) -> dict[str, tuple[list[Complexes], list[Floats]]]:
        """Run → the mean turn of each stretch in floors, and those floors; (signals, orders) each."""
        found = {}
        for run in self.runs:
            blocks = [stretch.orders(run.highest) for stretch in run.stretches]
            noise = [turn_floor(b, s.cut.rpm / 60.0).floor for b, s in zip(blocks, run.stretches, strict=True)]
            found[run.name] = ([b.mean(axis=1) / n for b, n in zip(blocks, noise, strict=True)], noise)
        return found

    def _constants(self, model: Model, theta: Floats) -> dict[str, ArrayLike]:
        assert self.machine.tool is not None
        constants = factored_tool(self.machine.tool, self.tool, model.factors(theta), len(theta))
        return constants | model.effect_constants(theta, acting(process_quantities()), self.standing)

    def _orders(self, constants: dict[str, ArrayLike], sensing: list[Sensing], stretch: Stretch, data: TurnData) -> Complexes:
        """Amplitudes of the orders that the twin's sensors show, (signals, lanes, orders)."""
        effects = tuple(e.name for e in acting(process_quantities()))
        turn = fine_turn(constants, self.teeth, stretch.cut, effects, self.terms)
        shown = []
        for sensor, signal in zip(sensing, data.signals, strict=True):
            force = turn.force[FORCES.index(signal)]
            if sensor.effects:
                # what a sensor shows of no force has been taken out of the recording
                settled = sensor.readings(np.tile(force, (1, SETTLING_TURNS)), turn.step_s)
                force = (settled - sensor.readings(np.zeros_like(settled), turn.step_s))[:, -force.shape[1] :]
            shown.append(force)
        found = type(turn)(np.stack(shown), turn.step_s).orders(data.highest)
        if not data.knows_mean:
            found[..., 0] = 0.0
        return found if self.low_pass is None else self.low_pass.passed(found, stretch.cut.rpm / 60.0)

    def _phases(self, orders: list[Complexes], data: TurnData) -> list[Floats]:
        """The phase of each stretch, (lanes,) each: one for all, within a tooth, where the angle was recorded."""
        seen, noise = self._seen[data.name]
        twins = [found / n[:, None, :] for found, n in zip(orders, noise, strict=True)]
        if not data.knows_phase:
            return [best_phase(one, twin, np.pi) for one, twin in zip(seen, twins, strict=True)]
        shared = best_phase(np.concatenate(seen), np.concatenate(twins), np.pi / self.teeth)
        return [shared] * len(seen)


def _plain(orders: Complexes) -> Floats:
    """Real and imaginary part of each order, (…, orders) → (…, 2 orders)."""
    return np.stack([orders.real, orders.imag], axis=-1).reshape(*orders.shape[:-1], -1)
