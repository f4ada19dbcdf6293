"""Spindle load over a run: the mean power of the cut over the last 0.1 s, through the meter.

The window ends with the tick itself and holds as many ticks as there have been, so a run that starts in the cut starts with what
it draws. The mean is a sum over the present block and one over what is left of the block before (van Herk's scheme), so it does
not drift, and it is 0 again after a cut.
"""

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from twin.effects.effect import Effect
from twin.errors import TwinError
from twin.kernels.assembly import KERNEL, Scalars, kernel_function, kernel_text
from twin.kernels.weave import weave
from twin.spindle.meter import FED, SPINDLE, spindle_constants, spindle_quantities

__all__ = ["Array", "spindle_constants", "spindle_load_pct", "spindle_quantities"]

Array = NDArray[np.float64]
WINDOW_S = 0.1


def spindle_load_pct(
    constants: Mapping[str, ArrayLike],
    cutting_power_w: ArrayLike,
    spindle_rpm: ArrayLike,
    *,
    period_s: float = 0.001,
    effects: Sequence[str] = (),
    added_kw: ArrayLike | None = None,
    reference_run: bool = False,
) -> Array:
    """Return the meter's reading at each tick, (lanes, ticks), % of rated power.

    constants: name → a number or (lanes,), of the spindle (`spindle_constants`) and of the effects (`effect__parameter`)
    cutting_power_w: mean over each tick, and spindle_rpm: each (ticks,) or (lanes, ticks)
    effects: names of those that are in the kernel; added_kw: electrical power on top, (ticks,) or (lanes, ticks), or None
    reference_run: in plain Python, slowly, from the same text

    1,870 W of cut at an efficiency of 0.85, and 0.25 kW, are 2.45 kW of 11 kW:

    >>> from twin.machine import SpindleDrive
    >>> constants = spindle_constants(SpindleDrive(rated_power_kw=11.0, efficiency=0.85, idle_power_kw=0.25))
    >>> spindle_load_pct(constants, [1870.0, 1870.0], 3000.0).round(4).tolist()
    [[22.2727, 22.2727]]

    Raises TwinError where shapes do not fit, EffectError where a constant is missing or an effect does not act on the spindle.
    """
    text, names = _kernel(SPINDLE.effects(effects), added_kw is not None)
    power_w, rpm, rows = _fitted(cutting_power_w, spindle_rpm, constants, names)
    window = max(round(WINDOW_S / period_s), 1)
    out = np.empty(power_w.shape)
    load = kernel_function(text, "load", reference_run=reference_run)
    later = np.zeros(window + 1)
    added = [] if added_kw is None else [np.broadcast_to(np.asarray(added_kw, dtype=np.float64), power_w.shape)]
    for lane in range(len(power_w)):
        own = [np.ascontiguousarray(series[lane]) for series in added]
        load(rows[lane], power_w[lane], rpm[lane], window, period_s, later, *own, out[lane])
    return out


def _fitted(
    cutting_power_w: ArrayLike, spindle_rpm: ArrayLike, constants: Mapping[str, ArrayLike], names: tuple[str, ...]
) -> tuple[Array, Array, Array]:
    """Power and speed as (lanes, ticks), constants as (lanes, names)."""
    columns = [np.asarray(column, dtype=np.float64).reshape(-1, 1) for column in SPINDLE.taken(constants, names)]
    power_w = np.atleast_2d(np.asarray(cutting_power_w, dtype=np.float64))
    rpm = np.asarray(spindle_rpm, dtype=np.float64)
    try:
        lanes = np.broadcast_shapes((len(power_w), 1), *[column.shape for column in columns])[0]
        power_w = np.broadcast_to(power_w, (lanes, power_w.shape[1]))
        rpm = np.broadcast_to(rpm, power_w.shape)
    except ValueError:
        raise TwinError(
            f"cutting power {power_w.shape}, spindle speed {rpm.shape} and constants do not fit each other; "
            "each is (ticks,) or (lanes, ticks)"
        ) from None
    rows = np.hstack([np.broadcast_to(column, (lanes, 1)) for column in columns])
    return np.ascontiguousarray(power_w), np.ascontiguousarray(rpm), np.ascontiguousarray(rows)


@cache
def _kernel(effects: tuple[Effect, ...], added: bool = False) -> tuple[str, tuple[str, ...]]:
    """The text that defines `load`, and the constants that it takes, in order. added: with a power on top"""
    woven = weave(SPINDLE.physics, effects, (), ("electrical_power_kw",) if added else ())
    scalars = Scalars.of(woven, effects, (*FED, "added__electrical_power_kw"))
    assert all(isinstance(value, float) for value in scalars.states.values()), "the meter has no state to start from"
    top = ["added__electrical_power_kw = added_kw[tick]"] if added else []
    body = [*scalars.in_loop(), *top, *woven.body.splitlines()]
    fed = "added_kw, " if added else ""
    lines = [
        KERNEL,
        f"def load(constants, cutting_power_w, spindle_rpm_in, window, period_s, later_w, {fed}shown_pct):",
        *(f"    {line}" for line in [*scalars.before_loop(), *scalars.states_at_start()]),
        *(f"    {line}" for line in _WINDOW),
        *(f"        {line}" for line in [*body, "shown_pct[tick] = spindle_load_pct"]),
    ]
    return kernel_text("from math import exp, sqrt", woven.functions, ["\n".join(lines)]), scalars.constants


_WINDOW = [
    "for place in range(window + 1):",
    "    later_w[place] = 0.0",
    "so_far_w = 0.0",
    "for tick in range(len(cutting_power_w)):",
    "    place = tick % window",
    "    if place == 0 and tick > 0:",
    "        so_far_w = 0.0",
    "        for back in range(1, window):",
    "            later_w[window - back] = later_w[window - back + 1] + cutting_power_w[tick - back]",
    "    so_far_w += cutting_power_w[tick]",
    "    ticks = tick + 1 if tick < window else window",
    "    cutting_power_kw = 0.001 * (so_far_w + later_w[place + 1]) / ticks",
    "    spindle_rpm = spindle_rpm_in[tick]",
]
