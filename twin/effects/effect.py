"""An effect: a physical term that the simulator can be given, declared once.

An effect changes quantities. For each it holds a function of numbers, written in the part of Python that numba compiles, whose
first argument is the quantity and whose further arguments are taken by name: a parameter of the effect, a state of the effect, or
any quantity that the physics has at that place (`velocity_mm_s`, `direction`, `time_s`, `screw_lead_mm`, …). It returns the
changed value, or the value and the new states where the effect has states.

    def friction_n(friction_n: float, direction: float, asymmetry: float) -> float:
        return friction_n * (1.0 + asymmetry * direction)

At its null value a change hands its quantity through bit for bit, so machines with and without an effect can share a batch.

Whatever diagnosis, experiments and optimiser have to know of one effect and not of another is a field here, so that none of them
knows an effect by its name.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from twin.errors import EffectError
from twin.sites import Site

Change = Callable[..., float | tuple[float, ...]]
Guesses = tuple[dict[str, float], ...]


def called(function: Callable[..., Any], known: Mapping[str, Any], *first: Any) -> Any:
    """Call a function of an effect: `first`, then the arguments that it names, from `known`.

    >>> called(lambda force_n, share: force_n * share, {"share": 0.5, "time_s": 3.0}, 400.0)
    200.0
    """
    names = function.__code__.co_varnames[: function.__code__.co_argcount]
    return function(*first, *(known[name] for name in names[len(first) :]))


class On(StrEnum):
    """The part of a machine that an effect is put on."""

    AXIS = "axis"
    SIGNAL = "signal"
    MACHINE = ""


class Excitation(StrEnum):
    """Something that a recording must contain for an effect to show, and that many recordings lack."""

    COOLANT_SWITCHED = "coolant switched"
    TOOL_CHANGES = "tool changes"
    SHORT_BLOCKS = "short blocks"


class BuildsUp(StrEnum):
    """The minutes that an effect takes to build up: of standing still, or of motion."""

    WAITING = "waiting"
    MOTION = "motion"


@dataclass(frozen=True, slots=True)
class Recorded:
    """Hints that the recordings give to an effect's first guesses.

    period_s: of the samples; peak_of: column without its axis letter → its largest magnitude, 0 where it is not recorded
    over_modelled: size of the signal that the effect is on, as recorded over as modelled; NaN where that is not known
    """

    period_s: float
    peak_of: Callable[[str], float] = lambda _: 0.0
    over_modelled: Callable[[], float] = lambda: math.nan


def no_guesses(_: Recorded) -> Guesses:
    """Leave the start of a fit to the screening."""
    return ()


OF_SIGNAL = "unit of the signal"
"""The unit of a parameter that is in that of the signal on which its effect acts."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    unit: "" where it is a pure number
    null: the value at which the effect is not there; None = it has no say while the others are null (a phase, a time constant)
    low, high: bounds of what a machine can have; the null value may be one of them
    typical: a size that a machine tool shows, to start a search from
    known_max: the largest size that machines are known to have; of a larger one, another effect that shows the same is likelier
    """

    name: str
    unit: str
    null: float | None
    low: float
    high: float
    typical: float
    meaning: str
    known_max: float = math.inf

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise EffectError(f"{self.name}: typical {self.typical} is outside {self.low} … {self.high}")


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """One effect of the catalogue.

    name: as in formats, section 7; the name of its file
    says: the same in plain words, a short sentence; `{on}` stands for the axis or the signal that it is put on
    site: where it acts; on: what it is put on
    changes: quantity → the function that changes it
    states: name → its value at the start, a number or the name of a quantity
    shows_in: columns of the run log that show it, `{a}` for the axis letter, `{s}` for the signal that it is put on
    needs: quantities beyond the nominal ones that the machine must state (`screw_lead_mm`)
    equation, reference: what it computes, and where that comes from

    Read by the search for causes:

    far_from_linear: a threshold or saturation, whose signature at one size says little; it is fitted whatever its signature says
    shows_only_fast: within a few milliseconds or while an axis accelerates, so that a slow recording cannot show it
    usual_on: axes where it is usual, elsewhere something else is likelier; empty = all
    excited_by: what a recording has to contain for it to show
    first_guesses: sets of values to start the fit from, where the recordings suggest them
    same_on: signal → an input of the twin on which it does the same, where that input is assumed and not recorded

    Read by the stages, which compare a recording stretch by stretch:

    late_s: lag, s, by which it makes the reference (site reference) or the feedback (site clock) late, of parameters and `time_s`
    at_rest: start of a stretch → function of parameters: `load_n`, which the drive holds at rest; `bristle_mm`, by which the
        contact is bent, of `held_n`, the force that friction holds
    carried: states that outlast a rest
    undo: the value at which a sensor with it reads its first argument at rest
    settles_s: time, s, of parameters, after which it shows what it is: in a stretch that is over before, it is only a trend

    Read by experiments and optimiser:

    likely_in: regime of an axis (`twin.gap.labels`, constant speed of either sign; `table` where only the table shows it) → its
        place among the effects that an unnamed gap there most often is; two may share one
    builds_up: the minutes that it takes, worth the time of an experiment for such effects only
    lowers, multiplies: constant of the machine → the parameter that caps it, or multiplies it
    """

    name: str
    says: str = field(kw_only=True)
    site: Site
    on: On
    parameters: tuple[Parameter, ...]
    changes: Mapping[str, Change]
    shows_in: tuple[str, ...]
    equation: str
    reference: str
    states: Mapping[str, float | str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    far_from_linear: bool = False
    shows_only_fast: bool = False
    usual_on: tuple[str, ...] = ()
    excited_by: Excitation | None = None
    first_guesses: Callable[[Recorded], Guesses] = no_guesses
    same_on: Mapping[str, str] = field(default_factory=dict)
    late_s: Callable[..., Any] | None = None
    at_rest: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    carried: tuple[str, ...] = ()
    undo: Callable[..., Any] | None = None
    settles_s: Callable[..., Any] | None = None
    likely_in: Mapping[str, int] = field(default_factory=dict)
    builds_up: BuildsUp | None = None
    lowers: Mapping[str, str] = field(default_factory=dict)
    multiplies: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_of_measurement(self) -> bool:
        """True of a sensor or a clock: the machine itself is as it was."""
        return self.on is On.SIGNAL or self.site is Site.CLOCK

    def is_usual_on(self, on: str) -> bool:
        """Return True where a machine usually has it on `on`."""
        return not self.usual_on or on in self.usual_on

    def is_known_of(self, values: Mapping[str, float]) -> bool:
        """Return True where machines are known to have parameters of these sizes."""
        return all(abs(values[p.name]) <= p.known_max for p in self.parameters)

    def is_null(self, values: Mapping[str, float]) -> bool:
        """Return True where these parameters make it nothing."""
        return all(p.null is None or values.get(p.name, p.null) == p.null for p in self.parameters)

    def null_values(self) -> dict[str, float]:
        """Parameters at which it is not there; those without a null value at their typical one."""
        return {p.name: p.typical if p.null is None else p.null for p in self.parameters}

    def typical_values(self) -> dict[str, float]:
        """Parameters of the size that a machine tool shows."""
        return {p.name: p.typical for p in self.parameters}

    def checked(self, values: Mapping[str, float]) -> dict[str, float]:
        """All parameters, those not given at their typical value where they have no null value, else at null.

        Raises EffectError naming a parameter that this effect does not have, or a value that is no finite number within its
        bounds (infinity is a value where it is the null one).
        """
        known = {p.name: p for p in self.parameters}
        for name in values:
            if name not in known:
                raise EffectError(f"{self.name} has no parameter {name!r}; it has {', '.join(known)}")
        result = self.null_values() | dict(values)
        for name, value in result.items():
            p = known[name]
            if value != p.null and not (math.isfinite(value) and p.low <= value <= p.high):
                raise EffectError(f"{self.name}: {name} is {value:g} {p.unit}; it has to be from {p.low:g} to {p.high:g}")
        return result
