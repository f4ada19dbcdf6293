"""Features as they are judged: beside what is usual in the operation that is running, and smoothed.

    y_f = clip((x_f − center_f(regime)) / spread_f(regime), ±10)        regime: program, tool, override; or the spindle stands
    s_f ← s_f + (1 − exp(−tick / smoothing_s)) · (y_f − s_f)            only at ticks that tell of f

Without the regime, what is rare and normal (a warm-up, the proving of a first part) is more unusual than most faults. A signal
whose scatter within a regime is about that over all regimes (a temperature, which follows the day) keeps one centre and spread
for all. Load, speed and feed tell nothing while the spindle stands; temperature and vibration do. Nothing is told while gated,
nor in a regime without a baseline: a program or a tool that was not in the training data is not judged, and that is said.

One form for the stream, without numpy, one for arrays (T, F); `fit_preparation` learns the baselines.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, NamedTuple

from pydantic import Field

from twin.anomaly.calibration import Finite, Positive, Record

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SPEED = "spindle_rpm"
TURNS_RPM_MIN = 50.0
TELL_STANDING = frozenset({"spindle_temp_c", "vibration_rms_g", "vibration_velocity_mm_s"})
CONTEXT = ("program", "tool_number", "feed_override_pct")
STANDING = "standing"
STANDS = "the spindle stands"
CLIP = 10.0
SPREAD_FLOOR = 0.1
"""Least spread within a regime, as a share of that over all: what a control rounds has none."""
EXPLAINS_NOTHING = 0.6
BASELINE_S_MIN = 120.0
REGIMES_MAX = 2000
NAMES_KEPT = 4096
NEVER = -(10**12)


class Regime(Record):
    """The usual values of a regime, by signal: median, and robust standard deviation."""

    center: tuple[Finite, ...]
    spread: tuple[Positive, ...]


class Preparation(Record):
    """signals: the features, in the order of the row; context: signals whose values name the regime
    overall: over all regimes in which the spindle turns; regimes: by name
    up, down: tails of what is left beside the peers, above and below 0 (`common_features.py`)
    """

    signals: tuple[str, ...]
    context: tuple[str, ...] = CONTEXT
    smoothing_s: Positive = 30.0
    overall: Regime
    regimes: Annotated[dict[str, Regime], Field(max_length=REGIMES_MAX)]
    up: tuple[Positive, ...]
    down: tuple[Positive, ...]


class Standardised(NamedTuple):
    """values: y of each signal; tells: which of them say something at this tick, were it not gated; unknown: why none does"""

    values: tuple[float, ...]
    tells: tuple[bool, ...]
    unknown: str | None


class Smoothed(NamedTuple):
    """values: s of each signal; ticks: when each was last told of"""

    values: tuple[float, ...]
    ticks: tuple[int, ...]


def unsmoothed(preparation: Preparation) -> Smoothed:
    """Before anything was told."""
    return Smoothed((0.0,) * len(preparation.signals), (NEVER,) * len(preparation.signals))


def regime_name(preparation: Preparation, row: Sequence[float], context: Sequence[object]) -> str:
    """The regime of a row; context: values of the context signals, None where one is not known.

    An override (a signal in per cent) counts in steps of ten.
    """
    if SPEED in preparation.signals and row[preparation.signals.index(SPEED)] < TURNS_RPM_MIN:
        return STANDING
    return _name(preparation.context, tuple(context))


@lru_cache(maxsize=NAMES_KEPT)
def _name(signals: tuple[str, ...], values: tuple[object, ...]) -> str:
    return "|".join(_word(signal, value) for signal, value in zip(signals, values, strict=True))


def _word(name: str, value: object) -> str:
    if value is None:
        return "?"
    if isinstance(value, int | float):
        return f"{10 * round(value / 10)}" if name.endswith("_pct") else f"{value:g}"
    return str(value)


def standardised_row(preparation: Preparation, row: Sequence[float], context: Sequence[object]) -> Standardised:
    """One row beside what is usual in its regime; beside what is usual over all, where that is not known.

    >>> usual = Regime(center=(30.0, 4000.0), spread=(2.0, 10.0))
    >>> turning = Preparation(
    ...     signals=("spindle_load_pct", "spindle_rpm"), overall=usual, regimes={"O1|3|100": usual}, up=(1, 1), down=(1, 1)
    ... )
    >>> standardised_row(turning, (37.0, 4000.0), ("O1", 3, 98.0))
    Standardised(values=(3.5, 0.0), tells=(True, True), unknown=None)
    >>> standardised_row(turning, (37.0, 4000.0), ("O1", 4, 98.0)).unknown
    'no baseline for program O1, tool_number 4, feed_override_pct 100'
    """
    name = regime_name(preparation, row, context)
    regime = preparation.regimes.get(name)
    center, spread = (regime or preparation.overall).center, (regime or preparation.overall).spread
    values = tuple([min(max((x - c) / s, -CLIP), CLIP) for x, c, s in zip(row, center, spread, strict=True)])
    if regime is None:
        words = "a standing spindle" if name == STANDING else _words(preparation, name)
        return Standardised(values, (False,) * len(values), f"no baseline for {words}")
    if name == STANDING:
        return Standardised(values, tuple([signal in TELL_STANDING for signal in preparation.signals]), STANDS)
    return Standardised(values, (True,) * len(values), None)


def _words(preparation: Preparation, name: str) -> str:
    return ", ".join(f"{signal} {word}" for signal, word in zip(preparation.context, name.split("|"), strict=False))


def smoothed_after(
    preparation: Preparation, before: Smoothed, now: Standardised, is_gated: bool, tick: int, tick_s: float
) -> Smoothed:
    """The smoothed features after one more tick; a gated one tells nothing.

    >>> usual = Regime(center=(30.0,), spread=(2.0,))
    >>> one = Preparation(signals=("spindle_load_pct",), overall=usual, regimes={}, up=(1,), down=(1,))
    >>> after = smoothed_after(one, unsmoothed(one), Standardised((4.0,), (True,), None), False, 7, 30.0)
    >>> round(after.values[0], 3), after.ticks
    (2.528, (7,))
    """
    if is_gated or not any(now.tells):
        return before
    share = 1.0 - math.exp(-tick_s / preparation.smoothing_s)
    if all(now.tells):
        values = tuple([s + share * (y - s) for s, y in zip(before.values, now.values, strict=True)])
        return Smoothed(values, (tick,) * len(values))
    rows = zip(before.values, before.ticks, now.values, now.tells, strict=True)
    pairs = [(s + share * (y - s), tick) if tells else (s, last) for s, last, y, tells in rows]
    return Smoothed(tuple([pair[0] for pair in pairs]), tuple([pair[1] for pair in pairs]))


def standardised_rows(
    preparation: Preparation, rows: "NDArray[np.float64]", codes: "NDArray[np.integer]", names: Sequence[str]
) -> tuple["NDArray[np.float64]", "NDArray[np.bool_]", "NDArray[np.bool_]"]:
    """y (T, F), which of them tell (T, F), whether the row is judged (T,): of rows (T, F) whose regimes are names[codes]."""
    import numpy as np  # noqa: PLC0415  the stream needs none

    found = [preparation.regimes.get(name) for name in names]
    usual = [one or preparation.overall for one in found]
    center, spread = np.array([one.center for one in usual]), np.array([one.spread for one in usual])
    values = np.clip((rows - center[codes]) / spread[codes], -CLIP, CLIP)
    is_known = np.array([one is not None for one in found])[codes]
    stands = np.array([name == STANDING for name in names])[codes]
    tells_standing = np.array([signal in TELL_STANDING for signal in preparation.signals])
    tells = is_known[:, None] & (~stands[:, None] | tells_standing[None, :])
    return values, tells, is_known & ~stands


def smoothed_rows(
    preparation: Preparation, values: "NDArray[np.float64]", tells: "NDArray[np.bool_]", tick_s: float
) -> tuple["NDArray[np.float64]", "NDArray[np.int64]"]:
    """s (T, F) and the tick at which each was last told of (T, F); tells: false also where gated."""
    import numpy as np  # noqa: PLC0415
    from scipy.signal import lfilter  # noqa: PLC0415

    keeps = math.exp(-tick_s / preparation.smoothing_s)
    smooth, last = np.zeros(values.shape), np.full(values.shape, NEVER, dtype=np.int64)
    ticks = np.arange(len(values))
    for signal in range(values.shape[1]):
        told = np.flatnonzero(tells[:, signal])
        if not len(told):
            continue
        folded = lfilter([1.0 - keeps], [1.0, -keeps], values[told, signal])
        place = np.searchsorted(told, ticks, side="right") - 1
        smooth[:, signal] = np.where(place >= 0, folded[np.maximum(place, 0)], 0.0)
        last[:, signal] = np.where(place >= 0, told[np.maximum(place, 0)], NEVER)
    return smooth, last


def fit_preparation(
    rows: "NDArray[np.float64]",
    codes: "NDArray[np.integer]",
    names: Sequence[str],
    signals: Sequence[str],
    tick_s: float,
    context: Sequence[str] = CONTEXT,
) -> Preparation:
    """Baselines of rows (T, F) that are known and not gated, whose regimes are names[codes]; the tails are to be fitted yet.

    Raises ValueError where the spindle never turns in them.
    """
    import numpy as np  # noqa: PLC0415

    stands = np.array([name == STANDING for name in names])[codes]
    if stands.all():
        raise ValueError(f"the spindle turns in none of {len(rows)} rows: there is nothing to learn from")
    middle, overall = _robust(rows[~stands])
    overall = np.maximum(overall, 1e-9)
    order = np.argsort(codes, kind="stable")
    starts = np.searchsorted(codes[order], np.arange(len(names) + 1))
    enough = {code: order[starts[code] : starts[code + 1]] for code in range(len(names))}
    kept = {code: _robust(rows[of]) for code, of in enough.items() if len(of) * tick_s >= BASELINE_S_MIN}
    kept = dict(sorted(kept.items(), key=lambda item: -len(enough[item[0]]))[:REGIMES_MAX])
    within = [spread for code, (_, spread) in kept.items() if names[code] != STANDING]
    explains = np.median(within, axis=0) / overall <= EXPLAINS_NOTHING if within else np.zeros(len(overall), dtype=np.bool_)
    regimes = {}
    for code, (own_center, own_spread) in kept.items():
        own = explains | (names[code] == STANDING)
        center, spread = np.where(own, own_center, middle), np.where(own, np.maximum(own_spread, SPREAD_FLOOR * overall), overall)
        regimes[names[code]] = Regime(center=tuple(center.tolist()), spread=tuple(spread.tolist()))
    ones = (1.0,) * len(signals)
    usual = Regime(center=tuple(middle.tolist()), spread=tuple(overall.tolist()))
    return Preparation(signals=tuple(signals), context=tuple(context), overall=usual, regimes=regimes, up=ones, down=ones)


def _robust(rows: "NDArray[np.float64]") -> tuple["NDArray[np.float64]", "NDArray[np.float64]"]:
    import numpy as np  # noqa: PLC0415

    low, middle, high = np.percentile(rows, [25.0, 50.0, 75.0], axis=0)
    return middle, (high - low) / 1.349
