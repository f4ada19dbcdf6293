"""A fitted forest of scikit-learn becomes arrays. They are held against the original, to the last bit, before they are used."""

import warnings
from collections.abc import Iterable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.forest.errors import ForestError
from twin.forest.forest import Forest, forest_of_arrays
from twin.forest.isolation import IsolationScorer
from twin.forest.kernels import Floats
from twin.forest.regression import RegressionForest

PROBES = 500


def flatten_isolation(model: Any) -> IsolationScorer:
    """The scorer of scikit-learn's IsolationForest, PyOD's IForest, or a Pipeline of a StandardScaler and one of the two.

    Raises ForestError where it is something else, or scores otherwise than expected.
    """
    scaling, last = _without_scaler(model)
    fitted = getattr(last, "detector_", last)  # PyOD wraps scikit-learn's
    if not isinstance(fitted, import_module("sklearn.ensemble").IsolationForest):
        raise ForestError(f"a {type(last).__name__} is no isolation forest: give an IsolationForest or PyOD's IForest")
    trees = [estimator.tree_ for estimator in _fitted(fitted)]
    path = [tree.compute_node_depths() + _average_path(tree.n_node_samples) - 1.0 for tree in trees]
    scale = _identity(fitted) if scaling is None else scaling
    forest = _forest(trees, path, fitted.estimators_features_, scale)
    denominator = float((len(trees) * _average_path(np.array([fitted.max_samples_])))[0])
    scorer = IsolationScorer(forest, denominator, float(fitted.offset_))
    rows = _probes(forest)
    sign = 1.0 if fitted is not last else -1.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a model that was fitted on named columns
        theirs = sign * model.decision_function(rows)
    _hold_against(theirs, scorer.scores(rows), model)
    return scorer


def flatten_regression(model: Any) -> RegressionForest:
    """The forest of a RandomForestRegressor or ExtraTreesRegressor, or of a Pipeline of a StandardScaler and one of them.

    Raises ForestError where it is something else, or predicts otherwise than expected.
    """
    scaling, fitted = _without_scaler(model)
    ensemble = import_module("sklearn.ensemble")
    if not isinstance(fitted, ensemble.RandomForestRegressor | ensemble.ExtraTreesRegressor):
        raise ForestError(f"a {type(fitted).__name__} is no forest of regression trees: give a RandomForestRegressor")
    trees = [estimator.tree_ for estimator in _fitted(fitted)]
    if fitted.n_outputs_ != 1:
        raise ForestError(f"the forest predicts {fitted.n_outputs_} figures: train one forest for each")
    scale = _identity(fitted) if scaling is None else scaling
    forest = _forest(trees, [tree.value[:, 0, 0] for tree in trees], None, scale)
    flat = RegressionForest(forest)
    rows = _probes(forest)
    jobs, fitted.n_jobs = fitted.n_jobs, 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = model.predict(rows)
    finally:
        fitted.n_jobs = jobs
    _hold_against(theirs, flat.predict(rows), model)
    return flat


def _fitted(model: Any) -> list[Any]:
    if not hasattr(model, "estimators_"):
        raise ForestError(f"the {type(model).__name__} has not been trained: call its fit first")
    return list(model.estimators_)


def _identity(model: Any) -> Floats:
    return np.array([np.zeros(model.n_features_in_), np.ones(model.n_features_in_)])


def _without_scaler(model: Any) -> tuple[Floats | None, Any]:
    """The scaling of a pipeline (2, features), None where there is none, and what comes after it."""
    if not isinstance(model, import_module("sklearn.pipeline").Pipeline):
        return None, model
    *before, last = (step for _, step in model.steps if step not in {None, "passthrough"})
    if not before:
        return None, last
    if len(before) > 1 or not isinstance(before[0], import_module("sklearn.preprocessing").StandardScaler):
        names = ", ".join(type(step).__name__ for step in before)
        raise ForestError(f"{names} before the forest cannot be folded into it: one StandardScaler can, and a forest needs none")
    scaler, width = before[0], before[0].n_features_in_
    mean = np.zeros(width) if not scaler.with_mean else scaler.mean_
    return np.array([mean, np.ones(width) if scaler.scale_ is None else scaler.scale_]), last


def _average_path(rows: NDArray[Any]) -> Floats:
    """c(n), mean depth of a row in an isolation tree of n rows."""
    rows = np.asarray(rows)
    path = np.where(rows == 2, 1.0, 0.0)
    many = rows > 2
    path[many] = 2.0 * (np.log(rows[many] - 1.0) + np.euler_gamma) - 2.0 * (rows[many] - 1.0) / rows[many]
    return path


def _places(left: list[int], right: list[int], rows: list[float]) -> NDArray[np.int64]:
    """Return the places of nodes: children side by side, and right after a node the children of the child that gets more rows."""
    place, free, open_nodes = [0] * len(left), 1, [0]
    while open_nodes:
        node = open_nodes.pop()
        if left[node] < 0:
            continue
        place[left[node]], place[right[node]] = free, free + 1
        free += 2
        more_go_left = rows[left[node]] >= rows[right[node]]
        open_nodes.extend((right[node], left[node]) if more_go_left else (left[node], right[node]))
    return np.array(place)


def _rounded_down(thresholds: Floats) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        near = thresholds.astype(np.float32)
    down = np.where(near.astype(np.float64) > thresholds, np.nextafter(near, np.float32(-np.inf)), near)
    return np.asarray(np.maximum(down, np.finfo(np.float32).min), dtype=np.float32)


def _forest(trees: list[Any], values: Iterable[Floats], features: Iterable[Any] | None, scaling: Floats) -> Forest:
    columns: dict[str, list[NDArray[Any]]] = {name: [] for name in ("child", "feature", "threshold", "value")}
    for tree, value, own in zip(trees, values, features or [np.arange(scaling.shape[1])] * len(trees), strict=True):
        left, right = tree.children_left, tree.children_right
        place, leaf = _places(left.tolist(), right.tolist(), tree.weighted_n_node_samples.tolist()), left < 0
        order = np.argsort(place)
        columns["child"].append(np.where(leaf, 0, place[left] - place)[order].astype(np.int32))
        columns["feature"].append(np.where(leaf, -1, np.asarray(own)[np.maximum(tree.feature, 0)])[order].astype(np.int16))
        columns["threshold"].append(np.where(leaf, np.float32(0.0), _rounded_down(tree.threshold))[order])
        columns["value"].append(np.where(leaf, value, np.nan)[order])
    whole = {name: np.concatenate(parts) for name, parts in columns.items()}
    value = whole.pop("value")
    leaf = whole["child"] == 0
    distinct, number = np.unique(value[leaf], return_inverse=True)
    if len(distinct) > leaf.sum() / 2:  # hardly any are shared: leave them in the order in which trees come to them
        distinct, number = value[leaf], np.arange(leaf.sum())
    whole["leaf"] = np.full(len(leaf), -1, np.int32)
    whole["leaf"][leaf] = number
    nodes = np.array([len(part) for part in columns["child"]], dtype=np.int32)
    return forest_of_arrays({**whole, "values": distinct, "tree_nodes": nodes, "scaling": scaling})


def _probes(forest: Forest) -> Floats:
    """Rows that stand on thresholds, and just beside them: where a wrong comparison shows."""
    generator = np.random.default_rng(0)
    rows = np.zeros((PROBES, forest.features))
    arrays = forest.arrays()
    for feature in range(forest.features):
        thresholds = arrays["threshold"][arrays["feature"] == feature]
        if len(thresholds):
            on = generator.choice(thresholds, PROBES)
            aside = np.nextafter(on, generator.choice(np.array([-np.inf, np.inf], np.float32), PROBES))
            rows[:, feature] = np.where(generator.random(PROBES) < 0.5, on, aside)
    return np.asarray(rows * forest.scaling[1] + forest.scaling[0])


def _hold_against(theirs: Floats, ours: Floats, model: Any) -> None:
    if different := int((np.asarray(theirs).view(np.int64) != ours.view(np.int64)).sum()):
        version = import_module("sklearn").__version__
        raise ForestError(
            f"{type(model).__name__} of scikit-learn {version}: {different} of {len(ours)} rows come out otherwise than from the "
            "flattened forest; use a scikit-learn that cnctwin was tested with"
        )
