"""The golden week: rows that were frozen with their scores and alerts, as the standing check of a model and of its successors.

A row a tick, as the machine was then: its features, whether it was gated, and the peers' score that it was judged beside (the
largest peer's raw score, or for the residual the centre of the peers' z). So alerts can be counted again, with this model or
another, without the peers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.errors import ModelError
from twin.anomaly.golden_parts import EXPECTS, NAMES, PROGRAMS, Told

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
WEEK_S = 604_800.0
TOLD = "told_"


@dataclass(frozen=True, slots=True, eq=False)
class GoldenWeek:
    """features: names of the columns; rows: (n, features), NaN where a feature was not known; scores: (n,), NaN there;
    gated: (n,), not judged; peers: (n,) what it was judged beside, NaN where there was none; alerts: of the model then
    Of a model with a preparation, rows are prepared ones, and peers what was left beside them: the adjusted score. So it is
    of one that compares parts; `told` has what else the machine told then (twin/anomaly/golden_parts.py), and gated ticks are
    those at which nothing was judged.
    """

    features: tuple[str, ...]
    rows: Floats
    scores: Floats
    gated: Flags
    peers: Floats
    alerts: int
    tick_s: float
    told: Told | None = None

    @property
    def weeks(self) -> float:
        """Machine-weeks of judged ticks."""
        return float((~self.gated & np.isfinite(self.scores)).sum()) * self.tick_s / WEEK_S

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `golden_of_arrays` takes."""
        told = np.array([self.alerts, self.tick_s])
        columns = {f"{TOLD}{name}": column for name, column in (self.told or {}).items()}
        return {
            "rows": self.rows,
            "scores": self.scores,
            "gated": self.gated,
            "peers": self.peers,
            "alerts_tick_s": told,
            **columns,
        }


def golden_of_arrays(arrays: Mapping[str, NDArray[Any]], features: Sequence[str]) -> GoldenWeek:
    """The golden week in a file. Raises ModelError where its arrays do not fit together."""
    try:
        alerts, tick_s = arrays["alerts_tick_s"].tolist()
        parts = {name: arrays[name] for name in ("rows", "scores", "gated", "peers")}
        fits = {len(part) for part in parts.values()} == {len(parts["rows"])} and parts["rows"].shape[1] == len(features)
        columns = {name: arrays[f"{TOLD}{name}"] for name in NAMES} if any(name.startswith(TOLD) for name in arrays) else None
        if columns is not None:
            fits = fits and {len(column) for name, column in columns.items() if name != PROGRAMS} <= {len(parts["rows"])}
            fits = fits and columns[EXPECTS].ndim == 2 and columns[PROGRAMS].dtype.kind == "U"
    except (KeyError, ValueError, IndexError, TypeError):
        fits, columns = False, None
    if not fits:
        raise ModelError("the golden week does not fit the manifest: copy the model again")
    return GoldenWeek(tuple(features), **parts, alerts=int(alerts), tick_s=float(tick_s), told=columns)
