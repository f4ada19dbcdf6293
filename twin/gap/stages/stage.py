"""A stage of the machine as a hypothesis sees it: what was observed there, and what a candidate machine would show.

Stages are diagnosed in the order of the sites, each with everything before it explained or taken from the recording: the cut with
the spindle's load, each axis, the spindle's heat. What is wrong in one then isn't blamed on the next.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect, Guesses
from twin.gap.descent import STEP
from twin.gap.diagnosis import Effected
from twin.gap.stages.free import Free, effect_parameters
from twin.gap.stages.free_term import FreeTerm

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Regimes = NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """The recording of one run that a stage is compared with, its signals one after another.

    measured: (n,), NaN where there is no sample; floor: (n,) what repeated runs differ by; sigma: (n,) of what is compared, less
    than the floor where repeated runs were averaged; signal: (n,) index into `signals`; block: (n,) number of the time block
    regime: (n,) number of the regime (`twin.gap.labels`)
    slope_step: step of θ for slopes; a longer one where what is shown has small jumps
    """

    name: str
    signals: tuple[str, ...]
    measured: Floats
    floor: Floats
    sigma: Floats
    signal: NDArray[np.int8]
    block: Ints
    regime: Regimes
    fitted: bool
    slope_step: float = STEP


class Stage(Protocol):
    """One stage of one case."""

    @property
    def name(self) -> str:
        """Name in reports."""

    @property
    def observed(self) -> tuple[Observed, ...]:
        """The recordings to compare with, run by run."""

    @property
    def averaged(self) -> int:
        """Samples that a fit may take together: what is slow shows as well in their mean, and costs less."""

    @property
    def healthy_rms(self) -> float:
        """The most that a healthy machine's twin leaves of a signal, in floors."""

    @property
    def constants(self) -> tuple[Free, ...]:
        """The machine's constants that the stage depends on, as far as they are uncertain."""

    @property
    def candidates(self) -> tuple[Effected, ...]:
        """The effects that what is observed here can show."""

    def predict(self, model: "Model", theta: Floats, run: int) -> Floats:
        """Return the signals of the machine at each row of θ, (lanes, p), in run number `run`, (lanes, n)."""

    def first_guesses(self, candidate: Effected) -> Guesses:
        """Sets of values to start an effect's parameters from, where the recordings suggest them."""


@runtime_checkable
class Stepped(Protocol):
    """A stage whose recordings may come in steps that are coarser than their noise (`twin.gap.stages.rounded`)."""

    def step_of(self, run: int) -> float:
        """Return the step of the recording of run number `run`; 0 where it hides nothing."""

    def unrounded(self, model: "Model", theta: Floats, run: int) -> Floats:
        """Return what `predict` returns, as it is between the steps."""


@dataclass(frozen=True, slots=True)
class Model:
    """A hypothesis: the machine with some effects and learned terms in it, its constants free within their uncertainty."""

    constants: tuple[Free, ...]
    effects: tuple[Effected, ...]
    terms: tuple[FreeTerm, ...] = ()

    @property
    def free(self) -> tuple[Free, ...]:
        """All free numbers: the constants, then the parameters of each effect, then the values of each learned term."""
        own = tuple(p for e in self.effects for p in effect_parameters(effect_named(e.effect)))
        return self.constants + own + tuple(p for term in self.terms for p in term.free)

    def places(self) -> tuple[tuple[Effected, slice], ...]:
        """Return the places of each effect's parameters in θ."""
        at, places = len(self.constants), []
        for effected in self.effects:
            count = len(effect_named(effected.effect).parameters)
            places.append((effected, slice(at, at + count)))
            at += count
        return tuple(places)

    def size_places(self, effected: Effected) -> list[int]:
        """Return the places in θ of an effect's sizes: without them it is nothing, whatever its shapes and angles."""
        place, free = dict(self.places())[effected], self.free
        return [i for i in range(place.start, place.stop) if not (free[i].is_shape or free[i].is_angle)]

    def term_places(self) -> tuple[tuple[FreeTerm, slice], ...]:
        """Return the places of each learned term's values in θ."""
        at, places = len(self.free) - sum(term.knots.count for term in self.terms), []
        for term in self.terms:
            places.append((term, slice(at, at + term.knots.count)))
            at += term.knots.count
        return tuple(places)

    def null_theta(self) -> Floats:
        """θ at which no effect is there."""
        return np.zeros(len(self.free))

    def values(self, theta: Floats) -> dict[Effected, dict[str, Floats]]:
        """The parameters of each effect at each row of θ, name → (lanes,)."""
        free = self.free
        found: dict[Effected, dict[str, Floats]] = {}
        for effected, place in self.places():
            names = [p.name for p in effect_named(effected.effect).parameters]
            found[effected] = {
                name: np.atleast_1d(free[i].value(theta[..., i]))
                for name, i in zip(names, range(place.start, place.stop), strict=True)
            }
        return found

    def effect_constants(
        self, theta: Floats, effects: Iterable[Effect], standing: Mapping[str, Mapping[str, float]]
    ) -> dict[str, Floats]:
        """The constants that the effects of a stage bring at each row of θ, `effect__parameter` → (lanes,).

        Null where neither the machine has the effect already (standing: effect → parameters) nor this model.
        """
        given = {
            f"{effect.name}__{name}": np.full(len(theta), standing.get(effect.name, {}).get(name, null))
            for effect in effects
            for name, null in effect.null_values().items()
        }
        for effected, values in self.values(theta).items():
            own = {f"{effected.effect}__{name}": value for name, value in values.items()}
            given |= {name: value for name, value in own.items() if name in given}
        return given

    def factors(self, theta: Floats) -> dict[str, Floats]:
        """The factor on each constant at each row of θ."""
        return {p.name: np.atleast_1d(p.value(theta[..., i])) for i, p in enumerate(self.constants)}

    def with_effect(self, effected: Effected) -> "Model":
        """The same with one effect more."""
        return replace(self, effects=(*self.effects, effected))

    def without(self, effected: Effected) -> "Model":
        """The same with one effect less."""
        return replace(self, effects=tuple(e for e in self.effects if e != effected))

    def with_term(self, term: FreeTerm) -> "Model":
        """The same with one learned term more."""
        return replace(self, terms=(*self.terms, term))


def observed_of(
    name: str, parts: Sequence[tuple[str, Floats, Floats, Floats, Ints, Regimes]], fitted: bool, slope_step: float = STEP
) -> Observed:
    """From (signal, measured, floor, sigma, block, regime) of each signal."""
    return Observed(
        name,
        tuple(p[0] for p in parts),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([p[2] for p in parts]),
        np.concatenate([p[3] for p in parts]),
        np.concatenate([np.full(len(p[1]), i, dtype=np.int8) for i, p in enumerate(parts)]),
        np.concatenate([p[4] for p in parts]),
        np.concatenate([p[5] for p in parts]),
        fitted,
        slope_step,
    )
