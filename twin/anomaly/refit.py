"""PyOD's detectors other than its IForest: trained again when they are loaded, as an object in a file would have to be unpickled.

What is kept is name, parameters, seed and the training rows, at most `rows_max` of them. Some rows are kept with their scores:
where a detector does not give these again (another version of PyOD, chance that has no seed), it is refused.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.errors import ModelError
from twin.anomaly.manifest import Refit

Floats = NDArray[np.float64]
PROBES = 64
TOLERANCE = 1e-9
EXTRA = "pip install 'cnctwin[anomaly]'"


@dataclass(frozen=True, slots=True)
class Kind:
    """A detector of PyOD.

    module: below pyod.models; rows_max: more would make loading or scoring too slow
    is_row_by_row: what is scored in one call changes each other's scores, so rows are scored one by one, as in the stream
    """

    module: str
    rows_max: int = 20_000
    is_row_by_row: bool = False


KINDS: Mapping[str, Kind] = {
    "ABOD": Kind("abod", 2_000),
    "CBLOF": Kind("cblof"),
    "COPOD": Kind("copod", 2_000, is_row_by_row=True),
    "ECOD": Kind("ecod", 2_000, is_row_by_row=True),
    "GMM": Kind("gmm"),
    "HBOS": Kind("hbos"),
    "INNE": Kind("inne"),
    "KDE": Kind("kde", 2_000),
    "KNN": Kind("knn", 5_000),
    "LODA": Kind("loda"),
    "LOF": Kind("lof", 5_000),
    "MCD": Kind("mcd", 5_000),
    "OCSVM": Kind("ocsvm", 5_000),
    "PCA": Kind("pca"),
}


@dataclass(frozen=True, slots=True, eq=False)
class RefitScorer:
    """A detector that was trained here: `decision_function` less its `threshold_`.

    rows: what it was trained on; probes: rows whose scores are kept
    """

    detector: Any
    about: Refit
    rows: Floats
    probes: Floats

    def score_one(self, values: Sequence[float]) -> float:
        """The score of one row. Raises ModelError where a value is not finite."""
        try:
            row = np.array([values], dtype=np.float64)
        except (TypeError, ValueError):
            raise ModelError(f"{list(values)} are not {self.rows.shape[1]} numbers") from None
        return float(self.scores(row)[0])

    def scores(self, rows: Floats) -> Floats:
        """The scores (n,) of rows (n, features). Raises ModelError where a value is not finite."""
        rows = np.asarray(rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != self.rows.shape[1] or not np.isfinite(rows).all():
            raise ModelError(f"{self.about.name} scores rows of {self.rows.shape[1]} finite numbers: leave others out")
        if not len(rows):
            return np.zeros(0)
        parts = [rows[i : i + 1] for i in range(len(rows))] if KINDS[self.about.name].is_row_by_row else [rows]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = [np.asarray(self.detector.decision_function(part), dtype=np.float64) for part in parts]
        return np.concatenate(found) - self.about.center

    def arrays(self) -> dict[str, Floats]:
        """Return the arrays that `again` takes."""
        return {"training_rows": self.rows, "probe_rows": self.probes, "probe_scores": self.scores(self.probes)}


def fitted(name: str, parameters: Mapping[str, Any], seed: int, rows: Floats) -> RefitScorer:
    """A detector of PyOD trained on rows (n, features), thinned out evenly where they are too many for it.

    Raises ModelError where there is no such detector or parameter, it cannot be trained, or would score otherwise when loaded.
    """
    if name not in KINDS:
        raise ModelError(f"there is no detector {name!r}; there are isolation_forest, IForest, {', '.join(KINDS)}")
    chosen = thinned(rows, KINDS[name].rows_max)
    detector = _trained(name, parameters, seed, chosen)
    about = Refit(name=name, parameters=dict(parameters), seed=seed, center=float(detector.threshold_))
    scorer = RefitScorer(detector, about, chosen, thinned(rows, PROBES))
    arrays = scorer.arrays()
    one_by_one = np.array([scorer.score_one(row) for row in arrays["probe_rows"][:8]])
    if not np.allclose(one_by_one, arrays["probe_scores"][:8], rtol=TOLERANCE, atol=TOLERANCE):
        raise ModelError(f"{name} scores a row otherwise alone than among others: it cannot score a stream")
    again(about, arrays)
    return scorer


def again(about: Refit, arrays: Mapping[str, NDArray[Any]]) -> RefitScorer:
    """The detector trained again on the rows in its file. Raises ModelError where it does not score the kept rows as it did."""
    missing = {"training_rows", "probe_rows", "probe_scores"} - set(arrays)
    if missing or about.name not in KINDS:
        raise ModelError(f"no detector {about.name!r} can be trained from {', '.join(arrays) or 'no arrays'}")
    detector = _trained(about.name, about.parameters, about.seed, np.asarray(arrays["training_rows"], dtype=np.float64))
    scorer = RefitScorer(detector, about, arrays["training_rows"], arrays["probe_rows"])
    off = np.abs(scorer.scores(arrays["probe_rows"]) - arrays["probe_scores"])
    if not (off <= TOLERANCE * (1.0 + np.abs(arrays["probe_scores"]))).all():
        raise ModelError(
            f"{about.name} of PyOD {versions()['pyod']}, trained again, scores the kept rows otherwise, by {off.max():.2g}: "
            "use the versions in the manifest, or train again"
        )
    return scorer


def thinned(rows: Floats, most: int) -> Floats:
    """At most so many rows, evenly over all of them."""
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(np.int64)]


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a model depends on, as far as they are installed."""
    found = {}
    for name in ("numpy", "scikit-learn", "pyod", "numba"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


def library(name: str) -> Any:
    """A module that comes with the extra. Raises ModelError where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(name)
    except ImportError as error:
        raise ModelError(f"{error.name or name} is not installed, which trains anomaly models: {EXTRA}") from None


def _trained(name: str, parameters: Mapping[str, Any], seed: int, rows: Floats) -> Any:
    kind = getattr(library(f"pyod.models.{KINDS[name].module}"), name)
    known = signature(kind.__init__).parameters
    if unknown := set(parameters) - set(known):
        others = ", ".join(own for own in known if own != "self")
        raise ModelError(f"{name} has no parameter {min(unknown)!r}; it has {others}")
    chance = {"random_state": seed} if "random_state" in known else {}
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return kind(**{**chance, **parameters}).fit(rows)
    except (ValueError, TypeError, ArithmeticError, np.linalg.LinAlgError) as error:
        raise ModelError(f"{name} cannot be trained on {len(rows)} rows: {str(error).splitlines()[0]}") from None
