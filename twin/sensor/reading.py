"""A sensor's readings of a series (twin/sensor/sensing.py), in the same woven text for all signals; missing samples stay away."""

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.kernels import elementary
from twin.kernels.assembly import KERNEL, Scalars, kernel_function, kernel_text
from twin.kernels.weave import function_text, weave
from twin.sensor.sensing import FED, SENSOR, earlier

Floats = NDArray[np.float64]


def readings(
    values: Floats,
    since_s: Floats,
    effects: Mapping[str, Mapping[str, float]],
    temperature_rise_k: Floats | None = None,
    reference_run: bool = False,
) -> Floats:
    """Return the sensor's readings of `values`, (n,), NaN where there is no sample.

    since_s: (n,) s since the sample before, 0 for the first; infinite where what came before is forgotten
    effects: name → parameters, as put on this signal
    temperature_rise_k: (n,) of the machine since the start; needed by what grows with it

    Raises EffectError where an effect is none of a sensor, or a rise is needed and not known.
    """
    if not effects:
        return values
    acting = SENSOR.effects(effects)
    if temperature_rise_k is None and (warm := [effect.name for effect in acting if "temperature_rise_k" in effect.needs]):
        raise EffectError(f"{warm[0]} needs a spindle temperature, which this run does not have")
    text, names = _kernel(acting)
    given = {f"{one.name}__{key}": value for one in acting for key, value in one.checked(effects[one.name]).items()}
    rise = np.zeros(len(values)) if temperature_rise_k is None else temperature_rise_k
    out = np.empty(len(values))
    series = [np.ascontiguousarray(one, dtype=np.float64) for one in (values, since_s, rise)]
    read = kernel_function(text, "read", reference_run=reference_run)
    read(np.array(SENSOR.taken(given, names), dtype=np.float64), *series, out)
    return out


@cache
def _kernel(effects: tuple[Effect, ...]) -> tuple[str, tuple[str, ...]]:
    """The text that defines `read`, and the constants that it takes, in order."""
    woven = weave(SENSOR.physics, effects)
    scalars = Scalars.of(woven, effects, FED)
    body = [*scalars.in_loop(), *woven.body.splitlines(), "out[sample] = reading"]
    lines = [
        KERNEL,
        "def read(constants, values, since, rise, out):",
        "    first = True",
        *(f"    {line}" for line in [*scalars.before_loop(), *scalars.states_at_start()]),
        "    for sample in range(len(values)):",
        "        if values[sample] != values[sample]:",
        "            out[sample] = values[sample]",
        "            continue",
        "        is_first = 1.0 if first else 0.0",
        "        first = False",
        "        since_s = since[sample]",
        "        temperature_rise_k = rise[sample]",
        *(f"        {line}" for line in body),
    ]
    functions = [function_text(f) for f in (elementary.exp_of_minus, elementary.sine_of_turns, earlier)] + [*woven.functions]
    return kernel_text("from math import exp, sqrt", functions, ["\n".join(lines)]), scalars.constants
