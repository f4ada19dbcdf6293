"""A sensor: what it reads of what is. Nominally the same, at once.

A series is read sample by sample, in the same woven text for all signals; samples that are not there stay away.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from twin.effects.catalogue import effect_named
from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.kernels import elementary
from twin.kernels.generated import compiled, in_python
from twin.kernels.weave import Woven, function_text, quantities, weave
from twin.sites import Site, at

Floats = NDArray[np.float64]


class Reading(NamedTuple):
    """What the sensor reads."""

    reading: float


def sense(value: float) -> Reading:
    """One sample.

    >>> sense(21.5).reading
    21.5
    """
    reading = at(Site.SENSOR, value)
    return Reading(reading)


def sensor_quantities() -> dict[str, str]:
    """What effects can change of a sensor, with their sites."""
    return quantities((sense,))


def readings(
    values: Floats,
    since_s: Floats,
    effects: Mapping[str, Mapping[str, float]],
    temperature_rise_k: Floats | None = None,
    reference_run: bool = False,
) -> Floats:
    """What the sensor reads of `values`, (n,), NaN where there is no sample.

    since_s: (n,) s since the sample before, 0 for the first; effects: name → parameters, as put on this signal
    temperature_rise_k: (n,) of the machine since the start; needed by what grows with it

    Raises EffectError where an effect is none of a sensor, or a rise is needed and not known.
    """
    if not effects:
        return values
    acting = tuple(effect_named(name) for name in effects)
    for effect in acting:
        if not set(effect.changes) & set(sensor_quantities()):
            raise EffectError(f"{effect.name} does not act on a sensor; it acts at the {effect.site} site")
        if "temperature_rise_k" in effect.needs and temperature_rise_k is None:
            raise EffectError(f"{effect.name} needs a spindle temperature, which this run has not got")
    text, names = _kernel(acting)
    given: dict[str, float] = {}
    for effect in acting:
        given |= {f"{effect.name}__{key}": value for key, value in effect.checked(effects[effect.name]).items()}
        given |= {f"{effect.name}__{key}": float(value) for key, value in effect.states.items() if not isinstance(value, str)}
    rise = np.zeros(len(values)) if temperature_rise_k is None else temperature_rise_k
    out = np.empty(len(values))
    function: Any = in_python(text)["read"] if reference_run else compiled(text).read
    function(
        np.ascontiguousarray(values, dtype=np.float64),
        np.ascontiguousarray(since_s, dtype=np.float64),
        np.ascontiguousarray(rise, dtype=np.float64),
        np.array([given[name] for name in names]),
        out,
    )
    return out


@cache
def _kernel(effects: Sequence[Effect]) -> tuple[str, tuple[str, ...]]:
    woven = weave((sense,), effects)
    own = tuple(f"{e.name}__{n}" for e in effects for n in [p.name for p in e.parameters] + list(e.states))
    return _text(woven, own), own


def _text(woven: Woven, own: Sequence[str]) -> str:
    functions = [function_text(elementary.exp_of_minus), function_text(elementary.sine_of_turns), *woven.functions]
    lines = [
        "@njit(cache=True, nogil=True, error_model='numpy')",
        "def read(values, since, rise, given, out):",
        "    first = True",
    ]
    lines += [f"    {name} = given[{row}]" for row, name in enumerate(own)]
    lines += [
        "    for sample in range(len(values)):",
        "        value = values[sample]",
        "        if value != value:",
        "            out[sample] = value",
        "            continue",
        "        is_first = 1.0 if first else 0.0",
        "        first = False",
        "        since_s = since[sample]",
        "        temperature_rise_k = rise[sample]",
        *(f"        {line}" for line in woven.body.splitlines()),
        "        out[sample] = reading",
    ]
    return "\n\n\n".join([*(f"@njit(error_model='numpy')\n{text}" for text in functions), "\n".join(lines) + "\n"])
