"""Trains a residual model, and judges it on time that was held out.

    recorded time:  [ train ........................ ] gap [ held out ......... ]
    inside train:   [ fit ................ ] gap [ choose the feature set ]

The feature set is chosen inside the training time, with a smaller forest: the published one, unless another's error is lower
there with an interval that leaves no doubt. The forest that is judged is the one that is used: none is trained again on all time.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.forest import flatten_regression
from twin.forest.artefact import digest
from twin.forest.regression import RegressionForest
from twin.residual.errors import ResidualError
from twin.residual.features import SETS, Feature
from twin.residual.held_out import HeldOut
from twin.residual.judging import gain_of, rmse
from twin.residual.model import ResidualModel, Trained
from twin.residual.region import Region
from twin.residual.region_fit import region_of
from twin.residual.split import Split, blocks_of, split_by_time
from twin.residual.table import REGIMES, Recorded, Table, offered, table_of

Floats = NDArray[np.float64]
Say = Callable[[str], None]
CHOOSING_TREES = 60
IMPORTANCE_ROWS_MAX = 5000
RIDGE = 1.0
CHOSEN = "published"


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """Settings of a training run.

    row_s: seconds between two rows of training; held_share: the last part of the rows, held out
    feature_set: one of SETS, '' = the published one or a surely better one
    """

    trees: int = 300
    depth_max: int = 14
    leaf_min: int = 5
    row_s: float = 30.0
    held_share: float = 0.3
    feature_set: str = ""
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A model, which `model.held_out.why_refused` may say is none; the table and the split that it was judged by.

    choosing: RMSE of each feature set on the time that it was chosen on, K
    """

    model: ResidualModel
    table: Table
    split: Split
    choosing: Mapping[str, float]


def trained(recorded: Recorded, settings: TrainingSettings, about: Trained, say: Say = lambda _: None) -> Outcome:
    """The model of a recording, judged. Raises ResidualError where there is too little to judge by."""
    wanted = tuple(dict.fromkeys(one for own in SETS.values() for one in own))
    say("features of each moment")
    table = table_of(recorded, offered(recorded, wanted), settings.row_s)
    split = split_by_time(table.t_s, table.residual_k, table.stretch, settings.held_share, about.physics.time_constant_s)
    chosen, choosing = (settings.feature_set, {}) if settings.feature_set else _chosen(table, split, settings, say)
    if chosen not in SETS:
        raise ResidualError(f"feature set {chosen!r}: it is one of {', '.join(SETS)}")
    features = tuple(one for one in SETS[chosen] if one in table.features)
    x, y = table.of(features), table.residual_k
    say(f"forest of {settings.trees} trees on {len(split.train)} rows")
    forest = fitted(x[split.train], y[split.train], settings)
    say("region of training")
    region = region_of(x[split.train], blocks_of(table.t_s[split.train], split.gap_s))
    say("judging on held-out time")
    held = judged(forest, region, features, table, split, settings.seed)
    told = about.model_copy(
        update={
            "from_s": float(table.t_s[split.train[0]]),
            "to_s": float(table.t_s[split.train[-1]]),
            "hours": len(split.train) * settings.row_s / 3600.0,
            "cutting_hours": recorded.cutting_hours,
            "rows": len(split.train),
            "feature_set": chosen,
            "data_sha256": digest(x.tobytes() + y.tobytes()),
            "versions": versions(),
        }
    )
    model = ResidualModel(features, forest, region, told, held, float(y[split.train].mean()), settings.seed)
    return Outcome(model, table, split, choosing)


def fitted(x: Floats, y: Floats, settings: TrainingSettings) -> RegressionForest:
    """A random forest of rows (n, features), as arrays. Raises ResidualError where scikit-learn is not installed."""
    try:
        ensemble = import_module("sklearn.ensemble")
    except ImportError:
        raise ResidualError("scikit-learn is not installed, which trains forests: pip install 'cnctwin[anomaly]'") from None
    model: Any = ensemble.RandomForestRegressor(
        n_estimators=settings.trees,
        max_depth=settings.depth_max,
        min_samples_leaf=settings.leaf_min,
        random_state=settings.seed,
        n_jobs=-1 if len(x) * settings.trees > 500_000 else 1,
    )
    return flatten_regression(model.fit(x, y))


def _chosen(table: Table, split: Split, settings: TrainingSettings, say: Say) -> tuple[str, dict[str, float]]:
    """The feature set, and the RMSE of each, on the last part of the training time."""
    part = split.train
    t_s = table.t_s[part]
    cut_s = float(t_s[int((1.0 - settings.held_share) * len(t_s))])
    fit, test = part[t_s < cut_s - split.gap_s], part[t_s >= cut_s]
    if len(fit) < 100 or len(test) < 10:
        return CHOSEN, {}
    smaller = replace(settings, trees=min(settings.trees, CHOOSING_TREES))
    errors: dict[str, Floats] = {}
    for name, own in SETS.items():
        features = tuple(one for one in own if one in table.features)
        say(f"feature set {name}")
        x = table.of(features)
        errors[name] = table.residual_k[test] - fitted(x[fit], table.residual_k[fit], smaller).predict(x[test])
    block = blocks_of(table.t_s[test], split.gap_s)
    found = {name: rmse(error) for name, error in errors.items()}
    better = [name for name in SETS if name != CHOSEN and gain_of(errors[CHOSEN], errors[name], block).low > 0.0]
    return min(better, key=lambda name: found[name], default=CHOSEN), found


def judged(
    forest: RegressionForest, region: Region, features: tuple[Feature, ...], table: Table, split: Split, seed: int
) -> HeldOut:
    """Judge the forest on the held-out rows that are in its region."""
    x, y, train, test = table.of(features), table.residual_k, split.train, split.test
    inside = region.has(x[test])
    rows = test[inside]
    block, physics = split.block[inside], y[rows]
    if not len(rows):
        rows, block, physics = test[:0], split.block[:0], y[test[:0]]
    corrected = physics - forest.predict(x[rows]) if len(rows) else physics
    constant = physics - y[train].mean()
    linear = physics - ridge(x[train], y[train], x[rows])
    row_h = float(np.median(np.diff(table.t_s))) / 3600.0
    regime = table.regime[rows]
    nothing = not len(rows)
    return HeldOut(
        hours=len(test) * row_h,
        gap_s=split.gap_s,
        blocks=split.blocks,
        in_region=float(inside.mean()),
        physics_rmse_k=0.0 if nothing else rmse(physics),
        corrected_rmse_k=0.0 if nothing else rmse(corrected),
        constant_rmse_k=0.0 if nothing else rmse(constant),
        linear_rmse_k=0.0 if nothing else rmse(linear),
        gain=gain_of(physics, corrected, block, seed),
        over_constant=gain_of(constant, corrected, block, seed),
        by_regime={
            name: (rmse(physics[own]), rmse(corrected[own]), float(own.mean()))
            for number, name in enumerate(REGIMES)
            if (own := regime == number).any()
        },
        importance={} if nothing else importance(forest, features, x[rows], physics, seed),
    )


def importance(forest: RegressionForest, features: tuple[Feature, ...], x: Floats, y: Floats, seed: int) -> dict[str, float]:
    """Return the growth of the RMSE, K, where a feature of the rows (n, f) is shuffled among them."""
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(x))[:IMPORTANCE_ROWS_MAX]
    x, y = x[chosen], y[chosen]
    whole = rmse(y - forest.predict(x))
    found = {}
    for column, one in enumerate(features):
        shuffled = x.copy()
        shuffled[:, column] = rng.permutation(shuffled[:, column])
        found[str(one)] = round(rmse(y - forest.predict(shuffled)) - whole, 4)
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def ridge(x: Floats, y: Floats, rows: Floats) -> Floats:
    """Return what a line through the same features predicts for `rows`, with a little shrinking."""
    centre, spread = x.mean(axis=0), x.std(axis=0)
    spread = np.where(spread > 0.0, spread, 1.0)
    z = (x - centre) / spread
    weights = np.linalg.solve(z.T @ z + RIDGE * np.eye(z.shape[1]), z.T @ (y - y.mean()))
    return np.asarray(y.mean() + (rows - centre) / spread @ weights)


def versions() -> dict[str, str]:
    """Return the versions of what trained it."""
    names = ("numpy", "scikit-learn")
    return {"python": ".".join(map(str, sys.version_info[:3])), **{name: version(name) for name in names}}
