"""Training: rows of known features become a model that scores a stream.

Isolation forests, of scikit-learn or PyOD, trained here or handed in, are flattened and scored by our kernel; other detectors of
PyOD are trained again when they are loaded (twin/anomaly/refit.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.errors import ModelError
from twin.anomaly.manifest import Trained
from twin.anomaly.model import AnomalyModel
from twin.anomaly.refit import KINDS, fitted, library, thinned, versions
from twin.forest.errors import ForestError
from twin.forest.flattening import flatten_isolation

Floats = NDArray[np.float64]
ISOLATION_FOREST, IFOREST = "isolation_forest", "IForest"
NAMES = (ISOLATION_FOREST, IFOREST, *KINDS)
ROWS_MIN = 64
FOREST_ROWS_MAX = 1_000_000
FOREST_DEFAULTS: Mapping[str, Any] = {"n_estimators": 200, "contamination": 0.01}


@dataclass(frozen=True, slots=True)
class Detector:
    """The kind of detector that is trained.

    name: `isolation_forest` (scikit-learn's), or a detector of PyOD; parameters: as the library names them; a forest without
    any has 200 trees, and its 0 is what 1 % of the training rows exceed; seed: of all chance
    """

    name: str = ISOLATION_FOREST
    parameters: Mapping[str, bool | int | float | str | None] = field(default_factory=dict)
    seed: int = 0


def trained_model(detector: Detector, rows: Floats, features: Sequence[str], about: Trained | None = None) -> AnomalyModel:
    """A model of rows (n, features), n at least 64; rows with a value that is not known are left out.

    Raises ModelError where the detector does not exist, or cannot be trained on these rows.
    """
    rows = np.asarray(rows, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(features):
        raise ModelError(f"rows of shape {rows.shape} for the {len(features)} features {', '.join(features)}")
    known = rows[np.isfinite(rows).all(axis=1)]
    if len(known) < ROWS_MIN:
        unknown = [name for name, column in zip(features, rows.T, strict=True) if not np.isfinite(column).any()]
        reason = f"{', '.join(unknown)} is never known" if unknown else f"at least {ROWS_MIN} are needed"
        raise ModelError(f"{len(known)} of {len(rows)} rows have all features: {reason}")
    names = {name.lower(): name for name in NAMES}
    name = names.get(detector.name.lower())
    if name is None:
        raise ModelError(f"there is no detector {detector.name!r}; there are {', '.join(NAMES)}")
    about = (about or Trained()).model_copy(update={"rows": len(known), "versions": versions()})
    if name in KINDS:
        return AnomalyModel(tuple(features), fitted(name, detector.parameters, detector.seed, known), about)
    kind = library("sklearn.ensemble").IsolationForest if name == ISOLATION_FOREST else library("pyod.models.iforest").IForest
    try:
        forest = kind(**{**FOREST_DEFAULTS, "random_state": detector.seed, **detector.parameters})
        return flattened(forest.fit(thinned(known, FOREST_ROWS_MAX)), features, about)
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name} cannot be trained: {str(error).splitlines()[0]}") from None


def flattened(model: Any, features: Sequence[str], about: Trained | None = None) -> AnomalyModel:
    """A fitted IsolationForest, IForest of PyOD, or Pipeline of a StandardScaler and one of them, as a model.

    Raises ModelError where it is something else, or was fitted on other features than these.
    """
    library("sklearn.ensemble")
    try:
        scorer = flatten_isolation(model)
    except ForestError as error:
        raise ModelError(str(error)) from None
    names = getattr(model, "feature_names_in_", None)
    if scorer.forest.features != len(features) or (names is not None and list(names) != list(features)):
        own = ", ".join(names) if names is not None else f"{scorer.forest.features} features"
        raise ModelError(
            f"the forest was fitted on {own}, not on {', '.join(features)}: give the names in the order of its columns"
        )
    return AnomalyModel(tuple(features), scorer, (about or Trained()).model_copy(update={"versions": versions()}))
