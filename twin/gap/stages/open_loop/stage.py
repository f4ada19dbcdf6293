"""An open loop as a stage of the search: screened, fitted and judged like the closed one, on what it alone answers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import catalogue, effect_named
from twin.effects.effect import Guesses, On
from twin.gap.diagnosis import Effected
from twin.gap.stages.axis import BLOCK_S, AxisStage
from twin.gap.stages.axis_run import AxisRunData
from twin.gap.stages.free import Free
from twin.gap.stages.open_loop.loop import ALIKE_S, Loop, places
from twin.gap.stages.smoothed import sample_period_s
from twin.gap.stages.stage import Model, Observed, observed_of
from twin.identification.batch_fit import time_blocks
from twin.learned.words import LearnedSite

Floats = NDArray[np.float64]
AVERAGED_S = 0.004


@dataclass(frozen=True, slots=True, eq=False)
class OpenStage:
    """A part of an axis, driven by what was measured. closed: the axis; floors: regime → floor of what is compared."""

    closed: AxisStage
    loop: Loop
    floors: Mapping[int, float]
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "observed", tuple(self._observed(run) for run in self.closed.runs))

    @staticmethod
    def of(closed: AxisStage, loop: Loop, floors: Mapping[int, float]) -> "OpenStage":
        """Return the stage, without the effects that the machine has already elsewhere."""
        return OpenStage(alone(closed, loop), loop, floors)

    @property
    def letter(self) -> str:
        """Letter of the axis."""
        return self.closed.letter

    @property
    def name(self) -> str:
        """Name in reports, as in `subsystems`."""
        return f"{self.closed.letter} {self.loop.name}"

    @property
    def healthy_rms(self) -> float:
        """The most that a healthy machine's twin leaves of it, in floors."""
        return self.loop.healthy_rms

    @property
    def averaged(self) -> int:
        """Samples within a few milliseconds go together."""
        data = self.closed.runs[0]
        return max(1, round(AVERAGED_S / sample_period_s(data.measured["pos_mm"], data.period_s)))

    @property
    def constants(self) -> tuple[Free, ...]:
        """The uncertain constants of the axis that this part depends on."""
        return self.loop.constants(self.closed.constants)

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """The effects that act here, and sensors that would show here."""
        there = {name for name, _ in self.closed.standing} | self.closed.left_out
        of_axis = {e.effect for e in self.closed.stateable}
        found = []
        for effect in catalogue().values():
            if effect.name in there:
                continue
            if effect.on is On.SIGNAL:
                found += [Effected(effect.name, f"{self.letter}_{column}") for column in self.loop.sensors(effect)]
            elif effect.name in of_axis and self.loop.acts(effect):
                found.append(Effected(effect.name, self.letter))
        return tuple(found)

    @property
    def term_sites(self) -> Mapping[LearnedSite, tuple[str, ...]]:
        """The sites of learned terms that act here."""
        return {site: on for site, on in self.closed.term_sites.items() if site in self.loop.sites}

    def term_sizes(self, site: LearnedSite, on: str) -> float:
        """Return the size of a small term, as on the axis."""
        return self.closed.term_sizes(site, on)

    def term_arguments(self, run: int) -> Mapping[str, Floats]:
        """Return what a term may depend on in a run, over its stretches."""
        return self.closed.term_arguments(run)

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Return the effect's own guesses."""
        return self.closed.first_guesses(candidate) if effect_named(candidate.effect).on is On.AXIS else ()

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """Return what is compared, at each row of θ, (lanes, n)."""
        return self.loop.answer(self.closed, model, theta, self.closed.runs[run])

    def _observed(self, data: AxisRunData) -> Observed:
        where = places(data)
        regime = data.regime[where]
        floor = np.array([self.floors[number] for number in range(len(self.floors))])[regime]
        alike = max(ALIKE_S / data.period_s, 1.0)  # neighbours are one sample in a fit
        sigma = floor * np.sqrt(alike / data.count)
        signal = f"{self.letter}_{self.loop.compared}"
        blocks = time_blocks(data.t_s, BLOCK_S)[where]
        return observed_of(data.name, [(signal, self.loop.recorded(data), floor, sigma, blocks, regime)], data.fitted)


def alone(closed: AxisStage, loop: Loop) -> AxisStage:
    """Return the axis with those of its standing effects that act in this part."""
    standing = tuple((name, values) for name, values in closed.standing if loop.acts(effect_named(name)))
    return replace(closed, standing=standing)
