"""Spindle temperature over a run: exact steps from sample to sample, however irregular, inputs held in between.

A sample that an input does not have is the last one that it had, so signals of several rates fit together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.effects.effect import Effect
from twin.errors import TwinError
from twin.heat.network import FED, HEAT, INPUTS, thermal_constants, thermal_quantities
from twin.kernels.assembly import KERNEL, Scalars, kernel_function, kernel_text
from twin.kernels.weave import weave

__all__ = ["Warming", "held", "spindle_temperature_c", "thermal_constants", "thermal_quantities"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Warming:
    """The signals that the temperature depends on, each (samples,); NaN = no sample, the last one holds.

    t_s: increasing; spindle_load_pct and spindle_rpm; ambient_c: the surroundings; coolant_on: 0 or 1, None = it never is
    """

    t_s: ArrayLike
    spindle_load_pct: ArrayLike
    spindle_rpm: ArrayLike
    ambient_c: ArrayLike
    coolant_on: ArrayLike | None = None


def spindle_temperature_c(
    constants: Mapping[str, ArrayLike],
    warming: Warming,
    start_c: ArrayLike,
    *,
    effects: Sequence[str] = (),
    added_w: ArrayLike | None = None,
    beside_c: ArrayLike | None = None,
    reference_run: bool = False,
) -> Array:
    """Temperature at each sample, (lanes, samples), °C, from `start_c` at the first one.

    constants: name → a number or (lanes,), of the machine (`thermal_constants`) and of the effects (`effect__parameter`)
    start_c: a number, or (lanes,)
    effects: names of those that are in the kernel; added_w: heat on top, (samples,) or (lanes, samples), or None
    beside_c: temperature at the start of whatever else an effect warms, a number or (lanes,); None = as the spindle
    reference_run: in plain Python, slowly, from the same text

    100 W into 5,000 J/K behind 0.2 K/W for one time constant of 1,000 s, in two steps:

    >>> from twin.machine import Thermal
    >>> thermal = Thermal(alpha_w_per_pct_rpm2=0.0, beta_w_per_rpm=0.02, resistance_k_per_w=0.2, capacity_j_per_k=5000.0)
    >>> warming = Warming([0.0, 100.0, 1000.0], 0.0, 5000.0, 20.0)
    >>> spindle_temperature_c(thermal_constants(thermal), warming, 20.0).round(3).tolist()
    [[20.0, 21.903, 32.642]]

    Raises TwinError where times do not increase, an input has no sample at all or does not fit; EffectError where a constant is
    missing or an effect does not act on the spindle's heat.
    """
    text, names = _kernel(HEAT.effects(effects), added_w is not None)
    given = HEAT.taken(constants, names)
    times, inputs = _held_inputs(warming)
    columns = [
        np.asarray(column, dtype=np.float64).reshape(-1)
        for column in (start_c, start_c if beside_c is None else beside_c, *given)
    ]
    try:
        start, beside, *rest = np.broadcast_arrays(*columns)
    except ValueError:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in zip(("start_c", "beside_c", *names), columns, strict=True))
        raise TwinError(f"{sizes} do not fit each other; each has one value, or one for each lane") from None
    rows = np.array(rest).T.reshape(len(start), len(names))
    out = np.empty((len(start), len(times)))
    warm = kernel_function(text, "warm", reference_run=reference_run)
    added = [] if added_w is None else [np.broadcast_to(np.asarray(added_w, dtype=np.float64), out.shape)]
    for lane in range(len(start)):
        own = [np.ascontiguousarray(series[lane]) for series in added]
        warm(np.ascontiguousarray(rows[lane]), float(start[lane]), float(beside[lane]), times, *inputs, *own, out[lane])
    return out


def held(values: ArrayLike, samples: int, name: str) -> Array:
    """The last known value at each sample; before the first one, that one.

    >>> held([float("nan"), 1.0, float("nan"), 2.0], 4, "coolant_on").tolist()
    [1.0, 1.0, 1.0, 2.0]

    Raises TwinError where there is no value, or another number of samples.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (samples,)):
        raise TwinError(f"{name} has the shape {array.shape}; it has to be one value, or one for each of {samples} samples")
    array = np.broadcast_to(array, (samples,))
    known = np.isfinite(array)
    if known.all():
        return np.ascontiguousarray(array)
    if not known.any():
        raise TwinError(f"{name} has no sample in the whole run")
    last = np.maximum.accumulate(np.where(known, np.arange(samples), int(np.argmax(known))))
    return np.asarray(array[last])


def _held_inputs(warming: Warming) -> tuple[Array, list[Array]]:
    times = np.ascontiguousarray(warming.t_s, dtype=np.float64)
    if times.ndim != 1 or not np.all(np.diff(times) > 0.0):
        where = f"; it does not after sample {int(np.argmin(np.diff(times) > 0.0))}" if times.ndim == 1 else ""
        raise TwinError(f"t_s has to increase from sample to sample{where}")
    coolant: ArrayLike = 0.0 if warming.coolant_on is None else warming.coolant_on
    given = (warming.spindle_load_pct, warming.spindle_rpm, warming.ambient_c, coolant)
    return times, [held(values, len(times), name) for name, values in zip(INPUTS, given, strict=True)]


@cache
def _kernel(effects: tuple[Effect, ...], added: bool = False) -> tuple[str, tuple[str, ...]]:
    """The text that defines `warm`, and the constants that it takes, in order. added: with a heat on top"""
    woven = weave(HEAT.physics, effects, (), ("heat_w",) if added else ())
    fed = (*INPUTS, *(["added__heat_w"] if added else []))
    scalars = Scalars.of(woven, effects, (*FED, *fed))
    arguments = ", ".join(f"{name}_in" for name in fed)
    start = [*scalars.before_loop(), "temperature_c = beside_c", *scalars.states_at_start(), "temperature_c = start_c"]
    tick = ["shown_c[sample] = temperature_c", "if sample + 1 < len(t_s):"]
    body = ["time_s = t_s[sample]", "duration_s = t_s[sample + 1] - time_s"]
    body += [f"{name} = {name}_in[sample]" for name in fed] + scalars.in_loop()
    body += [*woven.body.splitlines(), "temperature_c = temperature_next_c"]
    lines = [
        KERNEL,
        f"def warm(constants, start_c, beside_c, t_s, {arguments}, shown_c):",
        *(f"    {line}" for line in start),
        "    for sample in range(len(t_s)):",
        *(f"        {line}" for line in tick),
        *(f"            {line}" for line in body),
    ]
    return kernel_text("from math import exp, sqrt", woven.functions, ["\n".join(lines)]), scalars.constants
