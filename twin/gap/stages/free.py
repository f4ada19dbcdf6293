"""The numbers that a hypothesis leaves free: the constants of the machine, and the parameters of the effects added to it.

A fit works on θ, which is about 1 where a parameter has the size that machines show, and 0 where it says nothing:

    factor   value = size · exp(θ)            constants of the machine, and what has no null (a time constant, an order)
    linear   value = null + size · θ          most parameters of effects, and angles
    inverse  value = size / θ                 what is infinite where there is no effect (a stiffness, a limit)
"""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect, Parameter

Floats = NDArray[np.float64]


class Form(Enum):
    """The form in which θ becomes a value."""

    FACTOR = "factor"
    LINEAR = "linear"
    INVERSE = "inverse"


VAGUE = 30.0
"""Standard deviation of the prior of an effect's parameter, in sizes that machines show: it keeps a fit in bounds, no more."""
FAR = 0.1
"""That of a parameter with far bounds, in parts of them: a sensor in another unit is a thousand sizes away."""
SHAPELESS = 1.5
"""That of the logarithm of what has no null."""


@dataclass(frozen=True, slots=True)
class Free:
    """One free number. name: of a constant, or `effect__parameter`; sigma: of its prior around 0; low, high: bounds of θ."""

    name: str
    form: Form
    size: float
    null: float
    sigma: float
    low: float
    high: float
    unit: str = ""

    def value(self, theta: Floats) -> Floats:
        """The value at θ, of any shape.

        >>> Free("presliding__stiffness_n_per_mm", Form.INVERSE, 2e4, float("inf"), 30.0, 0.0, 40.0).value(np.array([0.0, 2.0]))
        array([   inf, 10000.])
        """
        if self.form is Form.FACTOR:
            return np.asarray(self.size * np.exp(theta))
        if self.form is Form.LINEAR:
            return np.asarray(self.null + self.size * theta)
        with np.errstate(divide="ignore"):
            return np.asarray(np.where(theta > 0.0, self.size / np.where(theta > 0.0, theta, 1.0), np.inf))

    def theta_of(self, value: float) -> float:
        """θ at a value."""
        if self.form is Form.FACTOR:
            return math.log(value / self.size)
        if self.form is Form.LINEAR:
            return (value - self.null) / self.size
        return self.size / value

    @property
    def is_shape(self) -> bool:
        """Return whether it says nothing while the others of its effect are null."""
        return self.form is Form.FACTOR

    @property
    def is_angle(self) -> bool:
        """Return whether it is an angle."""
        return self.unit == "rad"


def constant(name: str, sigma: float, limit_sigmas: float = 3.0) -> Free:
    """A factor on a constant of the machine, known to `sigma`: it may not go far from what the machine states."""
    return Free(name, Form.FACTOR, 1.0, 1.0, sigma, -limit_sigmas * sigma, limit_sigmas * sigma)


def effect_parameters(effect: Effect) -> tuple[Free, ...]:
    """The free numbers of an effect, in the order of its parameters."""
    return tuple(_parameter(effect, p) for p in effect.parameters)


def _parameter(effect: Effect, p: Parameter) -> Free:
    name = f"{effect.name}__{p.name}"
    if p.null is None and p.unit != "rad":
        low, high = (math.log(max(bound, 1e-12) / p.typical) for bound in (p.low, p.high))
        return Free(name, Form.FACTOR, p.typical, p.typical, SHAPELESS, low, high, p.unit)
    if p.null is None:
        return Free(name, Form.LINEAR, 1.0, 0.0, VAGUE, p.low, p.high, p.unit)
    if math.isinf(p.null):
        return Free(name, Form.INVERSE, p.typical, p.null, VAGUE, 0.0, p.typical / p.low, p.unit)
    size = abs(p.typical - p.null) or 0.1 * (p.high - p.low)
    low, high = (p.low - p.null) / size, (p.high - p.null) / size
    return Free(name, Form.LINEAR, size, p.null, max(VAGUE, FAR * max(-low, high)), low, high, p.unit)
