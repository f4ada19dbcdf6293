"""The tool-change gate: when a score is not to be judged, because the spindle stops, the changer turns and the spindle runs up.

    gated(t) = active at t, or t < (last falling edge) + tail, or t ≥ (next rising edge) − look back

The tail runs from the falling edge: from the rising one, a change that takes longer than the tail would be let through before its
end. Controls whose label comes late (a Hurco stops its spindle a median 9.8 s before it tells) need the look-back; live, it is a
delay.
"""

import math

import numpy as np
from numpy.typing import NDArray


def gate(active: NDArray[np.generic], tick_s: float, tail_s: float, look_back_s: float = 0.0) -> NDArray[np.bool_]:
    """Return the gated ticks of `active` (T,) or (T, N), one row a tick; bool, or float with NaN for not known.

    What is not known is as it was last said (values are reported when they change); before anything was said, there is no change.
    A tail of two ticks and a look-back of one, of a change in ticks 2 and 3:

    >>> gate(np.array([False, False, True, True, False, False, False]), 1.0, 2.0, 1.0).astype(int).tolist()
    [0, 1, 1, 1, 1, 1, 0]

    Raises ValueError where the tick is not above 0, or tail or look-back are below it.
    """
    if not tick_s > 0.0 or tail_s < 0.0 or look_back_s < 0.0:
        raise ValueError(f"tick {tick_s!r} s has to be above 0, tail {tail_s!r} s and look-back {look_back_s!r} s not below it")
    said = held(active)
    count = len(said)
    place = np.arange(count).reshape(-1, *[1] * (said.ndim - 1))
    last = np.maximum.accumulate(np.where(said, place, -2 * count - 1 - _ticks(tail_s, tick_s)), axis=0)
    ahead = np.where(said, place, 2 * count + 1 + _ticks(look_back_s, tick_s))
    coming = np.minimum.accumulate(ahead[::-1], axis=0)[::-1]
    return np.asarray((place - last <= _ticks(tail_s, tick_s)) | (coming - place <= _ticks(look_back_s, tick_s)), dtype=np.bool_)


def held(active: NDArray[np.generic]) -> NDArray[np.bool_]:
    """`active` with what is not known (NaN) as it was last said.

    >>> held(np.array([np.nan, 1.0, np.nan, 0.0, np.nan])).tolist()
    [False, True, True, False, False]
    """
    if active.dtype == np.bool_:
        return np.asarray(active, dtype=np.bool_)
    values = np.asarray(active, dtype=np.float64)
    place = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    told = np.maximum.accumulate(np.where(np.isnan(values), -1, place), axis=0)
    kept = np.take_along_axis(values, np.maximum(told, 0), axis=0)
    return np.asarray((told >= 0) & (kept > 0.0), dtype=np.bool_)


def _ticks(duration_s: float, tick_s: float) -> int:
    """Ticks that touch the duration; rounding of the quotient makes none more."""
    return math.ceil(duration_s / tick_s - 1e-9)
