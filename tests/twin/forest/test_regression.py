"""The flattened random forest predicts as scikit-learn does, to the last bit."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from sklearn.ensemble import ExtraTreesRegressor, GradientBoostingRegressor, RandomForestRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tests.twin.forest.forests import regression, same_bits
from twin.forest import ForestError, flatten_regression

ROWS = np.random.default_rng(5).normal(size=(3000, 8))


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


def test_what_is_no_forest_of_one_figure_is_refused() -> None:
    rows = ROWS[:100]
    with pytest.raises(ForestError, match="GradientBoostingRegressor is no forest"):
        flatten_regression(GradientBoostingRegressor(n_estimators=3).fit(rows, rows[:, 0]))
    with pytest.raises(ForestError, match="predicts 2 figures"):
        flatten_regression(RandomForestRegressor(3).fit(rows, rows[:, :2]))
