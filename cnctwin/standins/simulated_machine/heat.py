"""The spindle's heat through the working day, and what its sensor shows once a second.

The temperature goes on from part to part and through the pauses between them. What effects of the machine keep besides (heat in
the column, a reading that lags) goes on with it.
"""

import math
from collections.abc import Iterable, Iterator
from random import Random

from cnctwin.standins.simulated_machine.moment import Moment
from twin.machine import MachineFile
from twin.thermal import ThermalNetwork, heat_input_w, rise_after

START_TEMPERATURE_C = 23.0
SHOWN_S = 1.0
NOISE = "spindle_temp_c"


def with_temperatures(moments: Iterable[Moment], machine: MachineFile) -> Iterator[Moment]:
    """Yield the moments of a day with the temperatures of spindle and air, the first ones at its begin and then each second."""
    spindle = SpindleHeat(machine, START_TEMPERATURE_C)
    inputs = {"Srpm": 0.0, "Sload": 0.0}
    coolant_on, before_s, next_s, number = False, 0.0, 0.0, 0
    for moment in moments:
        air_c = ambient_temp_c(before_s)
        spindle.go_on(inputs["Sload"], inputs["Srpm"], air_c, coolant_on, moment.at_s - before_s)
        before_s = moment.at_s
        inputs |= {key: float(moment.values[key]) for key in inputs if key in moment.values}
        coolant_on = moment.values.get("coolant", "ON" if coolant_on else "OFF") == "ON"
        if moment.at_s < next_s:
            yield moment
            continue
        number, next_s = number + 1, math.floor(moment.at_s / SHOWN_S) * SHOWN_S + SHOWN_S
        shown = {"Stemp": f"{spindle.shown_c(number):.1f}", "room_temp": f"{air_c:.1f}"}
        yield moment._replace(values={**moment.values, **shown})


class SpindleHeat:
    """The heat in the spindle of a machine."""

    def __init__(self, machine: MachineFile, start_c: float) -> None:
        thermal = machine.thermal
        assert thermal is not None
        self._network = ThermalNetwork(
            thermal.alpha_w_per_pct_rpm2, thermal.beta_w_per_rpm, thermal.resistance_k_per_w, thermal.capacity_j_per_k
        )
        self._noise_k = machine.noise.get(NOISE, 0.0)
        self._temperature_c = start_c

    def go_on(self, load_pct: float, rpm: float, ambient_c: float, coolant_on: bool, seconds: float) -> None:
        """Go on by so many seconds in which load, speed, air and coolant stay as they are."""
        heat_w = heat_input_w(self._network, rpm, load_pct)
        self._temperature_c = ambient_c + rise_after(self._network, self._temperature_c - ambient_c, heat_w, seconds)

    def shown_c(self, number: int) -> float:
        """Return reading `number` of the day, with the noise of the sensor."""
        return self._temperature_c + Random(number).gauss(0.0, self._noise_k)  # noqa: S311 — no secret


def ambient_temp_c(at_s: float) -> float:
    """The air of the shop: half a degree up and down in an hour.

    >>> ambient_temp_c(0.0), ambient_temp_c(900.0)
    (21.5, 22.0)
    """
    return round(21.5 + 0.5 * math.sin(at_s * math.pi / 1800.0), 1)
