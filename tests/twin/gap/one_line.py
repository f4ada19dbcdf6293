"""The smallest stage there is: a straight line, with a bend where an effect is put in, seen with noise in two runs."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from twin.gap.diagnosis import Effected
from twin.gap.stages.free import Free, constant
from twin.gap.stages.stage import Model, Observed, observed_of

Floats = NDArray[np.float64]
BIAS, SCALE = Effected("sensor_bias", "z_pos_mm"), Effected("sensor_scale", "z_pos_mm")
SAMPLES, NOISE = 400, 0.1


@dataclass(frozen=True, eq=False)
class OneLine:
    """y = k t, k known to 5 %, read with a bias or a scale. slope, bias: of the real one."""

    slope: float = 1.0
    bias: float = 0.0
    candidates: tuple[Effected, ...] = (BIAS, SCALE)
    name: str = "one line"
    averaged: int = 1
    healthy_rms: float = 1.3
    constants: tuple[Free, ...] = (constant("slope", 0.05),)
    observed: tuple[Observed, ...] = field(init=False)

    def __post_init__(self) -> None:
        seen = []
        for number, fitted in enumerate((True, False)):
            noise = NOISE * np.random.default_rng(number).standard_normal(SAMPLES)
            measured = self.slope * self.at(number) + self.bias + noise
            floor, block = np.full(SAMPLES, NOISE), np.arange(SAMPLES) // 20
            part = ("z_pos_mm", measured, floor, floor, block, np.zeros(SAMPLES, dtype=np.int8))
            seen.append(observed_of(f"run {number}", [part], fitted))
        object.__setattr__(self, "observed", tuple(seen))

    def at(self, run: int) -> Floats:
        """Return where the line is looked at: elsewhere in the run that judges."""
        return np.linspace(0.0, 8.0, SAMPLES) if run == 0 else np.linspace(-4.0, 6.0, SAMPLES)

    def first_guesses(self, candidate: Effected) -> tuple[dict[str, float], ...]:
        """None."""
        del candidate
        return ()

    def predict(self, model: Model, theta: Floats, run: int) -> Floats:
        """The line at each row of θ, (lanes, n)."""
        shown = np.multiply.outer(model.factors(theta).get("slope", np.ones(len(theta))), self.at(run))
        values = model.values(theta)
        scale = values[SCALE]["scale"] if SCALE in values else np.ones(len(theta))
        bias = values[BIAS]["bias"] if BIAS in values else np.zeros(len(theta))
        return np.asarray(shown * scale[:, None] + bias[:, None])
