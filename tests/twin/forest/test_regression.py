"""The flattened random forest predicts as scikit-learn does, to the last bit, and is kept in a folder."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.ensemble import ExtraTreesRegressor, GradientBoostingRegressor, RandomForestRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tests.twin.forest.forests import regression, same_bits
from twin.forest import ForestError, flatten_regression
from twin.forest.regression import load_regression, save_regression

ROWS = np.random.default_rng(5).normal(size=(3000, 8))
NAMES = tuple("abcdefgh")


@cache
def models() -> dict[str, Any]:
    return {
        "random forest": regression(),
        "extra trees": regression(ExtraTreesRegressor),
        "unlimited depth": regression(max_depth=None, min_samples_leaf=1),
        "best first": regression(max_leaf_nodes=40),  # not in depth-first order
        "least absolute error": regression(n_estimators=3, criterion="absolute_error"),
        "scaled": make_pipeline(StandardScaler(), RandomForestRegressor(20, random_state=1, n_jobs=1)).fit(ROWS, ROWS[:, 0]),
    }


@pytest.mark.parametrize(
    "name", ["random forest", "extra trees", "unlimited depth", "best first", "least absolute error", "scaled"]
)
def test_every_row_is_predicted_the_same(name: str) -> None:
    model = models()[name]
    flat, theirs = flatten_regression(model), model.predict(ROWS)
    assert same_bits(flat.predict(ROWS), theirs)
    assert same_bits([flat.predict_one(row) for row in ROWS[:300].tolist()], theirs[:300])


def test_a_forest_on_many_threads_is_held_against_itself_on_one() -> None:
    model = regression(n_jobs=2)
    flat = flatten_regression(model)
    assert model.n_jobs == 2
    assert np.allclose(flat.predict(ROWS), model.predict(ROWS), rtol=1e-12)


def test_what_comes_back_from_a_folder_is_the_same(tmp_path: Path) -> None:
    flat = flatten_regression(models()["random forest"])
    save_regression(flat, tmp_path / "load", NAMES, "spindle_load_pct")
    again = load_regression(tmp_path / "load", NAMES)
    assert same_bits(again.predict(ROWS), flat.predict(ROWS))
    assert sorted(path.name for path in (tmp_path / "load").iterdir()) == ["arrays.npz", "manifest.json"]
    assert json.loads((tmp_path / "load" / "manifest.json").read_text())["target"] == "spindle_load_pct"
    save_regression(flat, tmp_path / "again", NAMES, "spindle_load_pct")
    assert (tmp_path / "again" / "arrays.npz").read_bytes() == (tmp_path / "load" / "arrays.npz").read_bytes()


def test_other_features_or_another_order_are_refused(tmp_path: Path) -> None:
    flat = flatten_regression(models()["random forest"])
    save_regression(flat, tmp_path / "load", NAMES, "spindle_load_pct")
    with pytest.raises(ForestError, match="give them in its order"):
        load_regression(tmp_path / "load", NAMES[::-1])
    with pytest.raises(ForestError, match="3 names for 8 features"):
        save_regression(flat, tmp_path / "other", NAMES[:3], "spindle_load_pct")


def test_what_is_no_forest_of_one_figure_is_refused() -> None:
    rows = ROWS[:100]
    with pytest.raises(ForestError, match="GradientBoostingRegressor is no forest"):
        flatten_regression(GradientBoostingRegressor(n_estimators=3).fit(rows, rows[:, 0]))
    with pytest.raises(ForestError, match="predicts 2 figures"):
        flatten_regression(RandomForestRegressor(3).fit(rows, rows[:, :2]))
