"""The spindle drive as its load meter shows it, one sample at a time, and the power of the cut that a shown load stands for.

    shown = sensor(meter(P_cut, rpm))          P_cut = the power at which meter and sensor show what they do

The meter is the simulator's text (twin/spindle/meter.py) with every effect of the machine on it. Its inverse is taken in closed
form where nothing bends it, else by bracketing. A meter with a memory shows the load only while that is above what it remembers:
`is_held` tells when it is not.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Self

from twin.effects.added import added_effects
from twin.effects.catalogue import effect_named
from twin.errors import MachineError
from twin.kernels.stepper import Parameters, Stage, Stepper, sentences
from twin.live.sensor import LiveSensor
from twin.live.terms import LiveTerms
from twin.machine import MachineFile
from twin.spindle.meter import FED, SPINDLE, spindle_constants, spindle_quantities

SIGNAL = "spindle_load_pct"
_METER = Stage(SPINDLE, FED, (SIGNAL,))
_POWER = "electrical_power_kw"
_KNOWN = ("load_pct", "spindle_rpm")
_OF_THE_CUT = {"cutting_power_kw", _POWER, SIGNAL}
"""Quantities that depend on the power of the cut: what changes one of them, or takes one, may bend the meter."""
HELD_PCT, HELD_PART = 0.5, 0.02
"""A shown load this near to what a peak has fallen to may be that: half of the last digit of a meter in whole percent."""
ROOT_RELATIVE, TURNS_MAX = 1e-12, 100
POWER_KW_MAX = 1e6


@dataclass(frozen=True, eq=False)
class LiveSpindle:
    """The drive of a machine's spindle. in_words: a sentence on each effect at work, and on each term that is left out"""

    bare: Stepper
    stepper: Stepper
    terms: LiveTerms
    sensor: LiveSensor | None
    is_straight: bool
    in_words: tuple[str, ...]

    @classmethod
    def of(cls, machine: MachineFile) -> Self:
        """Return the drive of a machine. Raises MachineError where it states none, EffectError where an effect does not fit."""
        if machine.spindle is None:
            raise MachineError(f"{machine.machine.name} has no [spindle]; add rated_power_kw, efficiency and idle_power_kw")
        effects = added_effects(machine, spindle_quantities())
        terms = LiveTerms.of_quantity(machine.learned, _POWER, _KNOWN)
        sensor = LiveSensor.of(machine, SIGNAL)
        constants = spindle_constants(machine.spindle)
        bare = _METER.stepper(constants, effects)
        stepper = _METER.stepper(constants, effects, _POWER) if terms else bare
        said = (*sentences(effects), *(() if sensor is None else sensor.in_words), *terms.in_words, *terms.left_out)
        return cls(bare, stepper, terms, sensor, not terms and not _bends(effects), said)

    @property
    def holds(self) -> bool:
        """Return True where the meter remembers what it showed."""
        return bool(self.bare.states)

    def idle_load_pct(self, rpm: float) -> float:
        """Return the load that is shown while the spindle turns at this speed and cuts nothing."""
        return self.load_pct(0.0, rpm)

    def load_pct(self, cutting_power_kw: float, rpm: float) -> float:
        """Return the load that is shown for a power of the cut that has stood for a while."""
        shown_pct = self._meter(cutting_power_kw, rpm)
        return shown_pct if self.sensor is None else self.sensor.first(shown_pct).reading

    def cutting_power_kw(self, load_pct: float, rpm: float) -> float | None:
        """Return the power of the cut that shows this load, kW, 0 at a load of air; None where what is shown says nothing.

        2.45 kW of 11 kW are 1.87 kW of cut at an efficiency of 0.85, after 0.25 kW of idle power:

        >>> from twin.machine import machine_from_toml
        >>> text = '[machine]\\nname = "vmc"\\n[spindle]\\nrated_power_kw = 11.0\\nefficiency = 0.85\\nidle_power_kw = 0.25'
        >>> round(LiveSpindle.of(machine_from_toml(text)).cutting_power_kw(100.0 * 2.45 / 11.0, 3000.0), 9)
        1.87
        """
        metered_pct = self._metered_pct(load_pct)
        if metered_pct is None:
            return None
        if self.is_straight:
            idle_pct, pct_per_kw = self._line or self._line_at(rpm)
            power_kw = (metered_pct - idle_pct) / pct_per_kw
            return power_kw if power_kw > 0.0 else 0.0
        return _root(lambda kw: self._meter(kw, rpm), metered_pct)

    def is_held(self, load_pct: float, rpm: float, before_pct: float, since_s: float) -> bool:
        """Return True where a load is no more than what a peak of `before_pct`, shown `since_s` ago, has fallen to.

        The load is somewhere below it then; only the meter knows.
        """
        shown_pct, peak_pct = self._metered_pct(load_pct), self._metered_pct(before_pct)
        if not self.holds or shown_pct is None or peak_pct is None:
            return False
        peak_kw = _root(lambda kw: self._meter(kw, rpm), peak_pct)
        if peak_kw is None:
            return False
        _, *remembered = self._shown(peak_kw, rpm, 0.0, self.bare.start({}))
        held_pct = self._shown(0.0, rpm, since_s, tuple(remembered))[0]
        near = HELD_PCT + HELD_PART * abs(held_pct)
        return held_pct > self._meter(0.0, rpm) + near and shown_pct <= held_pct + near

    @cached_property
    def _line(self) -> tuple[float, float] | None:
        """Load of air and load by kW of cut, where they are the same at all speeds."""
        return None if "spindle_rpm" in self.bare.reads else self._line_at(0.0)

    def _line_at(self, rpm: float) -> tuple[float, float]:
        idle_pct = self._meter(0.0, rpm)
        return idle_pct, self._meter(1.0, rpm) - idle_pct

    def _metered_pct(self, load_pct: float) -> float | None:
        return load_pct if self.sensor is None else self.sensor.value_at(load_pct)

    def _meter(self, power_kw: float, rpm: float) -> float:
        """Return what the meter shows without any memory."""
        return self._shown(power_kw, rpm, 0.0, self.bare.start({}))[0]

    def _shown(self, power_kw: float, rpm: float, period_s: float, states: tuple[float, ...]) -> tuple[float, ...]:
        """Return what the meter shows, and its states; as in the simulator, learned terms are over the load without them."""
        shown = self.bare.step(power_kw, rpm, period_s, *states)
        if not self.terms:
            return shown
        return self.stepper.step(power_kw, rpm, period_s, self.terms.at({"load_pct": shown[0], "spindle_rpm": rpm}), *states)


def mean_tangential_n(cutting_power_kw: float, tool_diameter_mm: float, rpm: float) -> float:
    """Return the mean tangential force of all teeth: F = P_cut / (π D n).

    4 kW on the edge of a 20 mm tool at 3,000 rev/min, which runs at 3.1416 m/s:

    >>> round(mean_tangential_n(4.0, 20.0, 3000.0), 2)
    1273.24
    """
    return 6e7 * cutting_power_kw / (math.pi * tool_diameter_mm * abs(rpm))


def _bends(effects: Parameters) -> bool:
    """Return True where an effect may make the load another function of the power of the cut than a straight line."""
    for name in effects:
        for quantity, change in effect_named(name).changes.items():
            taken = change.__code__.co_varnames[1 : change.__code__.co_argcount]
            if quantity in _OF_THE_CUT or _OF_THE_CUT & set(taken):
                return True
    return False


def _root(shown_pct: Callable[[float], float], target_pct: float) -> float | None:
    """Return the power at which a rising load is the target: 0 where air shows as much, None where no power does."""
    low, off = 0.0, shown_pct(0.0) - target_pct
    if off >= 0.0:
        return 0.0
    high = 1.0
    while (above := shown_pct(high) - target_pct) < 0.0:
        low, off, high = high, above, 2.0 * high
        if high > POWER_KW_MAX:
            return None
    last, last_off, power, off = low, off, high, above
    for _ in range(TURNS_MAX):
        secant = power - off * (power - last) / (off - last_off) if off != last_off else low
        last, last_off = power, off
        power = secant if low < secant < high else 0.5 * (low + high)
        off = shown_pct(power) - target_pct
        low, high = (power, high) if off < 0.0 else (low, power)
        if off == 0.0 or abs(power - last) <= ROOT_RELATIVE * power:
            break
    return power
