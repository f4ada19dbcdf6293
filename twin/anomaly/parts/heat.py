"""The temperature that speed and load explain, and the slow drift that weather explains.

    h_i ← h_i + (10 s / τ_i) · (driver_i − h_i)          drivers: speed, load; τ: 10 min, 40 min, 2 h
    x = value − Σ b_i h_i − base                         base ← base + (10 s / 3 h) · x, a twentieth of it while suspicious

The coefficients come from training, by least squares on values from which the same slow drift was taken. A machine that is
already warm when it is first seen has stored heat that nobody knows: for `SETTLE_S` its temperature tells nothing, and the base
is the mean.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from twin.anomaly.parts.quantity import LOAD, SPEED

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

TAUS_S = (600.0, 2400.0, 7200.0)
DRIVERS = (SPEED, LOAD)
BASE_S, RESIDUAL_BASE_S = 10_800.0, 86_400.0
SETTLE_S = 7200.0
RIDGE = 1e-3
HELD = 0.05
HELD_S = 9000.0
"""So long at most a base is held: what stays for longer is weather, or has been an alarm for hours."""
EVERY_S = 10.0
"""Heat is slow: it is followed so often."""
STEPS = round(SETTLE_S / EVERY_S)
SCALES = {SPEED: 1e-3, LOAD: 1e-2}


class Heat(NamedTuple):
    """driven: the drivers as each time constant has smoothed them; base: of each temperature, None before it was told
    steps: since the machine was first seen, up to those of `SETTLE_S`
    """

    driven: tuple[float, ...] = (0.0,) * (len(TAUS_S) * len(DRIVERS))
    base: tuple[float | None, ...] = ()
    steps: int = 0

    @property
    def is_settled(self) -> bool:
        """Return True where the heat of before the machine was first seen matters no more."""
        return self.steps >= STEPS


def driven_after(driven: Sequence[float], drivers: Sequence[float], shares: Sequence[float]) -> tuple[float, ...]:
    """Return the smoothed drivers after a tick; each driver runs through all time constants.

    >>> driven_after((0.0,) * 6, (4.0, 0.5), (0.1, 0.02, 0.01))
    (0.4, 0.05, 0.08, 0.01, 0.04, 0.005)
    """
    speed, load = drivers
    a, b, c = shares
    h0, h1, h2, h3, h4, h5 = driven
    return (
        h0 + a * (speed - h0),
        h1 + a * (load - h1),
        h2 + b * (speed - h2),
        h3 + b * (load - h3),
        h4 + c * (speed - h4),
        h5 + c * (load - h5),
    )


def explained(coefficients: Sequence[float], driven: Sequence[float]) -> float:
    """Return the part of a temperature that speed and load explain."""
    return sum([b * h for b, h in zip(coefficients, driven, strict=True)])


def warmed(
    before: Heat,
    places: tuple[int, int],
    coefficients: Sequence[Sequence[float]],
    values: Sequence[float | None],
    shares: tuple[tuple[float, ...], tuple[float, ...]],
    *,
    is_held: bool,
) -> Heat:
    """Return the heat after a tick; places: of speed and load, −1 = none; shares: of a tick in each time constant, in each base.

    A base follows its temperature slowly, and next to not at all while the score is suspicious.
    """
    speed, load = (values[at] if at >= 0 else None for at in places)
    driven = driven_after(before.driven, ((speed or 0.0) * SCALES[SPEED], (load or 0.0) * SCALES[LOAD]), shares[0])
    base: list[float | None] = []
    first = 0.0 if before.is_settled else 1.0 / (before.steps + 1)
    slower = HELD if is_held and before.is_settled else 1.0
    for known, own, value, usual in zip(before.base, coefficients, values, shares[1], strict=True):
        if value is None or not own:
            base.append(known)
        elif known is None:
            base.append(value - explained(own, driven))
        else:
            base.append(known + slower * max(usual, first) * (value - explained(own, driven) - known))
    return Heat(driven, tuple(base), min(before.steps + 1, STEPS))


def base_s(signal: str) -> float:
    """Return the time in which the base of a temperature follows it.

    >>> base_s("spindle_temp_c"), base_s("twin/spindle_temp_residual_k")
    (10800.0, 86400.0)
    """
    return RESIDUAL_BASE_S if signal.endswith("_residual_k") else BASE_S


def fit_heat(
    speed: "NDArray[np.float64]",
    load: "NDArray[np.float64]",
    temperature: "NDArray[np.float64]",
    tick_s: float,
    follows_s: float = BASE_S,
) -> tuple[float, ...]:
    """Return the coefficients of the smoothed drivers for a recorded temperature, in its unit; gaps are held.

    follows_s: the time in which its base follows.

    Where it was hardly ever told, all are 0.
    """
    import numpy as np  # noqa: PLC0415  the stream needs none
    from scipy.signal import lfilter  # noqa: PLC0415

    count = len(TAUS_S) * len(DRIVERS)
    known = ~np.isnan(temperature)
    if known.sum() * tick_s < BASE_S:
        return (0.0,) * count

    def filled(values: "NDArray[np.float64]") -> "NDArray[np.float64]":
        place = np.maximum.accumulate(np.where(np.isnan(values), -1, np.arange(len(values))))
        return np.asarray(np.where(place >= 0, values[np.maximum(place, 0)], 0.0), dtype=np.float64)

    def smooth(values: "NDArray[np.float64]", tau_s: float, start: float) -> "NDArray[np.float64]":
        share = tick_s / tau_s
        return np.asarray(lfilter([share], [1.0, share - 1.0], values, zi=[(1.0 - share) * start])[0], dtype=np.float64)

    drivers = (filled(speed) * SCALES[SPEED], filled(load) * SCALES[LOAD])
    columns = [smooth(driver, tau_s, 0.0) for tau_s in TAUS_S for driver in drivers]
    wanted = filled(temperature)
    first = float(wanted[np.argmax(known)])
    every = slice(0, None, max(1, round(30.0 / tick_s)))
    shifted = np.stack([(column - smooth(column, follows_s, 0.0))[every] for column in columns], axis=1)
    target = (wanted - smooth(wanted, follows_s, first))[every]
    scale = np.maximum(shifted.std(axis=0), 1e-9)
    within = shifted / scale
    gram = within.T @ within / len(within) + RIDGE * np.eye(count)
    found = np.linalg.solve(gram, within.T @ target / len(within)) / scale
    return tuple(found.tolist())
