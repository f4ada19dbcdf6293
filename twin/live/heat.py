"""The spindle's heat as it happens: the simulator's text with every effect of the machine on it (twin/heat/network.py).

A step is as long as it is; inputs are held over it, so the answer is that of the simulator at the same samples. What a step is
given is what held since the step before; what a reading is given is what holds now.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

from twin.effects.added import added_effects
from twin.errors import MachineError
from twin.heat.network import HEAT, INPUTS, thermal_constants, thermal_quantities
from twin.kernels.stepper import Stage, Stepper, sentences
from twin.live.sensor import LiveSensor, SensorState
from twin.live.terms import LiveTerms
from twin.machine import MachineFile

SIGNAL = "spindle_temp_c"
_HEATING = Stage(HEAT, ("temperature_c", *INPUTS, "duration_s", "time_s"), ("temperature_next_c",))
_TEMPERATURE = "temperature_c"
_KNOWN = ("spindle_rpm", "load_pct", "coolant_on", _TEMPERATURE, "temperature_rise_k", "time_since_start_s")


class HeatInput(NamedTuple):
    """The signals that heat and cool a spindle. coolant_on: 0 or 1"""

    spindle_load_pct: float
    spindle_rpm: float
    ambient_c: float
    coolant_on: float = 0.0


class HeatState(NamedTuple):
    """The heat of a spindle.

    time_s: since it was started; effects: states of the effects on heat; names: whose they are; sensor: of the temperature
    """

    temperature_c: float
    time_s: float = 0.0
    effects: tuple[float, ...] = ()
    names: tuple[str, ...] = ()
    sensor: SensorState | None = None


@dataclass(frozen=True, eq=False)
class LiveHeat:
    """The heat of a machine's spindle.

    in_words: a sentence on each effect at work, and on each term that is left out
    names: of the states of the effects
    """

    stepper: Stepper
    terms: LiveTerms
    sensor: LiveSensor | None
    reading_terms: LiveTerms
    in_words: tuple[str, ...]
    names: tuple[str, ...]

    @classmethod
    def of(cls, machine: MachineFile) -> Self:
        """Return the heat of a machine. Raises MachineError where it states none, EffectError where an effect does not fit."""
        if machine.thermal is None:
            raise MachineError(f"{machine.machine.name} has no [thermal]; add its four constants")
        effects = added_effects(machine, thermal_quantities())
        terms = LiveTerms.of_quantity(machine.learned, "heat_w", _KNOWN)
        reading_terms = LiveTerms.of_reading(machine.learned, SIGNAL, _KNOWN)
        sensor = LiveSensor.of(machine, SIGNAL)
        stepper = _HEATING.stepper(thermal_constants(machine.thermal), effects, "heat_w" if terms else "")
        said = (*sentences(effects), *(() if sensor is None else sensor.in_words))
        for one in (terms, reading_terms):
            said = (*said, *one.in_words, *one.left_out)
        return cls(stepper, terms, sensor, reading_terms, said, tuple(stepper.states))

    @cached_property
    def needs_ambient(self) -> bool:
        """Return True where the ambient temperature has to be known, not only the rise over it."""
        return self.terms.needs(_TEMPERATURE) or self.reading_terms.needs(_TEMPERATURE)

    @cached_property
    def _is_bare(self) -> bool:
        """Return True where nothing but the temperature has a memory, and nothing learned is added."""
        return not self.names and not self.terms and self.sensor is None

    @cached_property
    def needs_coolant(self) -> bool:
        """Return True where an effect or a term depends on the coolant."""
        own = "coolant_on" in self.stepper.reads
        return own or self.terms.needs("coolant_on") or self.reading_terms.needs("coolant_on")

    def started(self, temperature_c: float, told: HeatInput) -> HeatState:
        """Return the state of a spindle that has this temperature through and through."""
        effects = self.stepper.start({_TEMPERATURE: temperature_c, **told._asdict()})
        return self._sensed(HeatState(temperature_c, 0.0, effects, self.names), None, 0.0)

    def started_at_reading(self, reading_c: float, told: HeatInput) -> HeatState | None:
        """Return the state of a spindle whose settled sensor reads this; None where what it reads says nothing."""
        temperature_c = reading_c
        for _ in range(8):  # once, but for a learned term over the temperature
            sensed_c = reading_c
            if self.reading_terms:
                sensed_c -= self.reading_terms.at(_arguments(temperature_c, 0.0, told))
            found_c = sensed_c if self.sensor is None else self.sensor.value_at(sensed_c)
            if found_c is None:
                return None
            if found_c == temperature_c:
                break
            temperature_c = found_c
        return self.started(temperature_c, told)

    def step(self, state: HeatState, told: HeatInput, duration_s: float) -> HeatState:
        """Return the state after a time over which these inputs held."""
        if self._is_bare:  # most machines; on the hot path, a named tuple's own constructor costs as much as the physics
            (temperature_c,) = self.stepper.step(state[0], *told, duration_s, state[1])
            return tuple.__new__(HeatState, (temperature_c, state[1] + duration_s, (), (), None))
        added = (self.terms.at(_arguments(state.temperature_c, state.time_s, told)),) if self.terms else ()
        temperature_c, *effects = self.stepper.step(state.temperature_c, *told, duration_s, state.time_s, *added, *state.effects)
        after = HeatState(temperature_c, state.time_s + duration_s, tuple(effects), self.names)
        return after if self.sensor is None else self._sensed(after, state.sensor, duration_s)

    def reading(self, state: HeatState, told: HeatInput) -> float:
        """Return the temperature that the machine's sensor shows, °C, with the inputs of now."""
        shown_c = state.temperature_c if state.sensor is None else state.sensor.reading
        if self.reading_terms:
            shown_c += self.reading_terms.at(_arguments(state.temperature_c, state.time_s, told))
        return shown_c

    def continued(self, state: HeatState, told: HeatInput) -> HeatState:
        """Return the state that another description left behind, as this one goes on from it: its heat does not jump.

        A state that this one does not have is forgotten, one that is new starts as declared; a sensor starts settled.
        """
        before = dict(zip(state.names, state.effects, strict=True))
        new = self.stepper.start({_TEMPERATURE: state.temperature_c, **told._asdict()})
        effects = tuple(before.get(name, start) for name, start in zip(self.names, new, strict=True))
        return self._sensed(state._replace(effects=effects, names=self.names, sensor=None), None, 0.0)

    def shifted(self, state: HeatState, by_k: float) -> HeatState:
        """Return the state with all its temperatures shifted: it turned out what the ambient is that they are counted from."""
        effects = tuple(
            value + by_k if start == _TEMPERATURE else value
            for value, start in zip(state.effects, self.stepper.states.values(), strict=True)
        )
        return self._sensed(state._replace(temperature_c=state.temperature_c + by_k, effects=effects), None, 0.0)

    def _sensed(self, state: HeatState, before: SensorState | None, since_s: float) -> HeatState:
        if self.sensor is None:
            return state
        value = state.temperature_c
        sensor = self.sensor.first(value) if before is None else self.sensor.next(before, value, since_s)
        return state._replace(sensor=sensor)


def _arguments(temperature_c: float, time_s: float, told: HeatInput) -> dict[str, float]:
    """Return what a learned term can be over, as `twin.learned.arguments` names it."""
    return {
        "spindle_rpm": told.spindle_rpm,
        "load_pct": told.spindle_load_pct,
        "coolant_on": told.coolant_on,
        _TEMPERATURE: temperature_c,
        "temperature_rise_k": temperature_c - told.ambient_c,
        "time_since_start_s": time_s,
    }
