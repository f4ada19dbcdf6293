"""The sensor of one signal, sample by sample: its bias, scale, lag, delay and whatever else a machine's effects say of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.kernels.stepper import Stage, Stepper, sentences
from twin.machine import MachineFile
from twin.sensor.sensing import FED, SENSOR, earlier, sensor_quantities

SENSING = Stage(SENSOR, FED, ("reading", "age_s"), (earlier,))
TRAIL_MAX = 512
"""Values that are kept for a sensor that reads a late one; more of them are read a little less finely."""
_TINY = 1e-12


class SensorState(NamedTuple):
    """The memory of a sensor. trail: of one that reads late: (s since the value before, value), the newest last"""

    reading: float
    effects: tuple[float, ...] = ()
    trail: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LiveSensor:
    """The sensor of a signal that has effects on it."""

    stepper: Stepper
    is_late: bool
    in_words: tuple[str, ...]

    @classmethod
    def of(cls, machine: MachineFile, signal: str) -> Self | None:
        """Return the sensor of a signal; None where it reads what is. Raises EffectError where an effect does not fit."""
        effects = added_effects(machine, sensor_quantities(), signal)
        if not effects:
            return None
        is_late = any("age_s" in effect_named(name).changes for name in effects)
        return cls(SENSING.stepper({}, effects), is_late, tuple(f"{said} on {signal}" for said in sentences(effects)))

    def first(self, value: float) -> SensorState:
        """Return the state at the first value: the sensor is settled."""
        reading, _, *effects = self.stepper.step((value,), (0.0,), 0, 1.0, 0.0, 0.0, *self.stepper.start(_QUANTITIES))
        return SensorState(reading, tuple(effects), ((0.0, value),) if self.is_late else ())

    def next(self, state: SensorState, value: float, since_s: float) -> SensorState:
        """Return the state at the next value, `since_s` after the one before."""
        if not self.is_late:
            reading, _, *effects = self.stepper.step((value,), (0.0,), 0, 0.0, since_s, 0.0, *state.effects)
            return SensorState(reading, tuple(effects))
        trail = (*state.trail, (since_s, value))
        since, values = zip(*trail, strict=True)
        reading, age_s, *effects = self.stepper.step(values, since, len(trail) - 1, 0.0, since_s, 0.0, *state.effects)
        return SensorState(reading, tuple(effects), _kept(trail, age_s))

    def value_at(self, reading: float) -> float | None:
        """Return the value at which the settled sensor reads this; None where its reading says nothing of the value."""
        value = reading
        for _ in range(3):  # once where the reading is linear in the value, as good as always
            off = reading - self.first(value).reading
            slope = self.first(value + 1.0).reading - self.first(value).reading
            if abs(slope) < _TINY:
                return None
            value += off / slope
        return value


_QUANTITIES: Mapping[str, float] = {}
"""No quantity is there for a sensor's state to start from: each starts from a number."""


def _kept(trail: tuple[tuple[float, float], ...], age_s: float) -> tuple[tuple[float, float], ...]:
    """Return the part of a trail that a value of this age lies in, no finer than it has to be."""
    age_far_s, first = 0.0, len(trail) - 1
    while first > 0 and age_far_s < age_s:
        age_far_s += trail[first][0]
        first -= 1
    trail = trail[first:]
    if len(trail) > 2 and trail[-1][0] + trail[-2][0] < age_s / TRAIL_MAX:
        between_s, _ = trail[-2]
        since_s, value = trail[-1]
        trail = (*trail[:-2], (between_s + since_s, value))
    return trail
