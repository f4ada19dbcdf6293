"""The spindle's heat through the working day, and what its sensor shows once a second.

The temperature goes on from part to part and through the pauses between them. What effects of the machine keep besides (heat in
the column, a reading that lags) goes on with it.
"""

import math
from collections.abc import Iterable, Iterator
from random import Random

from cnctwin.standins.simulated_machine.moment import Moment
from twin.live.heat import HeatInput, LiveHeat
from twin.live.sensor import LiveSensor
from twin.machine import MachineFile

START_TEMPERATURE_C = 30.0
"""The machine has been at work before, and was switched off over lunch."""
SHOWN_S = 1.0
TEMPERATURE, LOAD = "spindle_temp_c", "spindle_load_pct"


def with_temperatures(moments: Iterable[Moment], machine: MachineFile) -> Iterator[Moment]:
    """Yield the moments of a day with the temperatures of spindle and air, the first ones at its begin and then each second."""
    heat, meter, noise_k = LiveHeat.of(machine), LiveSensor.of(machine, LOAD), machine.noise.get(TEMPERATURE, 0.0)
    told = HeatInput(0.0, 0.0, ambient_temp_c(0.0))
    state, before_s, next_s = heat.started(START_TEMPERATURE_C, told), 0.0, 0.0
    for moment in moments:
        if moment.at_s > before_s:
            state = heat.step(state, told, moment.at_s - before_s)
        told, before_s = _heating(told, moment, meter), moment.at_s
        if moment.at_s < next_s:
            yield moment
            continue
        second = math.floor(moment.at_s / SHOWN_S)
        shown_c = heat.reading(state, told) + Random(second).gauss(0.0, noise_k)  # noqa: S311 — no secret
        next_s = (second + 1) * SHOWN_S
        yield moment._replace(values={**moment.values, "Stemp": f"{shown_c:.2f}", "room_temp": f"{told.ambient_c:.1f}"})


def _heating(before: HeatInput, moment: Moment, meter: LiveSensor | None) -> HeatInput:
    """Return what heats and cools the spindle from a moment on. What the meter reads wrong heats nothing."""
    shown = moment.values
    load_pct = before.spindle_load_pct
    if "Sload" in shown:
        load_pct = float(shown["Sload"])
        load_pct = load_pct if meter is None else meter.value_at(load_pct) or 0.0
    rpm = float(shown.get("Srpm", before.spindle_rpm))
    coolant_on = shown.get("coolant", "ON" if before.coolant_on else "OFF") == "ON"
    return HeatInput(load_pct, rpm, ambient_temp_c(moment.at_s), float(coolant_on))


def ambient_temp_c(at_s: float) -> float:
    """The air of the shop: half a degree up and down in an hour.

    >>> ambient_temp_c(0.0), ambient_temp_c(900.0)
    (21.5, 22.0)
    """
    return round(21.5 + 0.5 * math.sin(at_s * math.pi / 1800.0), 1)
