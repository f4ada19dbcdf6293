"""An effect: a physical term that the simulator can be given, declared once.

An effect changes quantities. For each it holds a function of numbers, written in the part of Python that numba compiles, whose
first argument is the quantity and whose further arguments are taken by name: a parameter of the effect, a state of the effect, or
any quantity that the physics has at that place (`velocity_mm_s`, `direction`, `time_s`, `screw_lead_mm`, …). It returns the
changed value, or the value and the new states where the effect has states.

    def friction_n(friction_n: float, direction: float, asymmetry: float) -> float:
        return friction_n * (1.0 + asymmetry * direction)

At its null value a change hands its quantity through bit for bit, so effects that a machine has not got can share a batch with
ones that it has.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from twin.errors import EffectError
from twin.sites import Site

Change = Callable[..., float | tuple[float, ...]]


class On(StrEnum):
    """What an effect is put on."""

    AXIS = "axis"
    SIGNAL = "signal"
    MACHINE = ""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    unit: "" where it is a pure number
    null: the value at which the effect is not there; None = it has no say while the others are null (a phase, a time constant)
    low, high: bounds of what a machine can have; the null value may be one of them
    typical: a size that a machine tool shows, to start a search from
    """

    name: str
    unit: str
    null: float | None
    low: float
    high: float
    typical: float
    meaning: str

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise EffectError(f"{self.name}: typical {self.typical} is outside {self.low} … {self.high}")


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """One effect of the catalogue.

    name: as in formats, section 7; the name of its file
    site: where it acts; on: what it is put on
    changes: quantity → the function that changes it
    states: name → its value at the start, a number or the name of a quantity
    shows_in: columns of the run log that show it, `{a}` for the axis letter, `{s}` for the signal that it is put on
    needs: quantities beyond the nominal ones that the machine must state (`screw_lead_mm`)
    equation, reference: what it computes, and where that comes from
    """

    name: str
    site: Site
    on: On
    parameters: tuple[Parameter, ...]
    changes: Mapping[str, Change]
    shows_in: tuple[str, ...]
    equation: str
    reference: str
    states: Mapping[str, float | str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()

    def is_null(self, values: Mapping[str, float]) -> bool:
        """Whether these parameters make it nothing."""
        return all(p.null is None or values.get(p.name, p.null) == p.null for p in self.parameters)

    def null_values(self) -> dict[str, float]:
        """Parameters at which it is not there; those without a null value at their typical one."""
        return {p.name: p.typical if p.null is None else p.null for p in self.parameters}

    def typical_values(self) -> dict[str, float]:
        """Parameters of the size that a machine tool shows."""
        return {p.name: p.typical for p in self.parameters}

    def checked(self, values: Mapping[str, float]) -> dict[str, float]:
        """All parameters, those not given at their typical value where they have no null value, else at null.

        Raises EffectError naming a parameter that this effect has not got, or a value that is no finite number within its
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
