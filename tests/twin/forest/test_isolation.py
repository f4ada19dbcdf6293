"""The flattened isolation forest scores as scikit-learn and PyOD do, to the last bit."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.decomposition import PCA
from sklearn.ensemble import IsolationForest, RandomForestClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tests.depth import examples
from tests.twin.forest.forests import SPREAD, isolation, machine_rows, same_bits
from twin.forest import ForestError, IsolationScorer, flatten_isolation

NUMBERS = st.floats(-1e30, 1e30) | st.floats(-2.0, 2.0)


@cache
def model_and_scorer() -> tuple[Any, IsolationScorer]:
    model = isolation(200)
    return model, flatten_isolation(model)


def test_a_hundred_thousand_rows_score_the_same() -> None:
    model, scorer = model_and_scorer()
    rows = machine_rows(100_000, 7)
    assert same_bits(scorer.scores(rows), -model.decision_function(rows))
    assert same_bits(scorer.score_samples(rows[:2000]), model.score_samples(rows[:2000]))


def test_a_row_scores_alone_as_among_others() -> None:
    model, scorer = model_and_scorer()
    rows = machine_rows(3000, 8)
    assert same_bits([scorer.score_one(row) for row in rows.tolist()], -model.decision_function(rows))


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 47, 48, 49, 127, 128, 129, 200, 300])
def test_any_number_of_rows_scores_the_same(count: int) -> None:
    model, scorer = model_and_scorer()
    rows = machine_rows(300, 9)
    assert same_bits(scorer.scores(rows[:count]), -model.decision_function(rows)[:count])


@given(st.lists(NUMBERS, min_size=5, max_size=5))
@settings(max_examples=examples(200), deadline=None)
def test_any_row_scores_the_same(row: list[float]) -> None:
    model, scorer = model_and_scorer()
    assert same_bits(scorer.score_one(row), -model.decision_function([row])[0])


def test_a_value_on_a_threshold_or_beside_it_goes_the_same_way() -> None:
    model, scorer = model_and_scorer()
    thresholds = np.concatenate([tree.tree_.threshold[tree.tree_.feature == 1] for tree in model.estimators_])
    near = np.concatenate([thresholds, np.nextafter(thresholds, np.inf), np.nextafter(thresholds.astype(np.float32), -np.inf)])
    rows = np.tile(machine_rows(1, 3), (len(near), 1))
    rows[:, 1] = near
    assert same_bits(scorer.scores(rows), -model.decision_function(rows))


def test_zero_and_minus_zero_and_the_smallest_numbers_go_the_same_way() -> None:
    tiny = np.float64(np.finfo(np.float32).smallest_subnormal)
    values = np.random.default_rng(0).choice([-1.0, -tiny, -0.0, 0.0, tiny, 1e-300, 1.0], size=(500, 3))
    model = IsolationForest(n_estimators=40, random_state=0).fit(values)
    assert same_bits(flatten_isolation(model).scores(values), -model.decision_function(values))


FORMS: dict[str, dict[str, Any]] = {
    "one tree": {"trees": 1},
    "nine trees": {"trees": 9},
    "some features": {"max_features": 0.5},
    "one feature": {"max_features": 1},
    "with replacement": {"bootstrap": True},
    "all rows": {"max_samples": 1.0},
    "two rows": {"max_samples": 2},
    "one row": {"max_samples": 1},
    "no contamination": {"contamination": "auto"},
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_forest_scores_the_same(form: str) -> None:
    model = isolation(**{"rows": 400, **FORMS[form]})
    scorer, rows = flatten_isolation(model), machine_rows(200, 4)
    assert same_bits(scorer.scores(rows), -model.decision_function(rows))
    assert same_bits([scorer.score_one(row) for row in rows], -model.decision_function(rows))


def test_rows_that_are_all_alike_make_a_forest_of_leaves() -> None:
    model = IsolationForest(n_estimators=5, random_state=0).fit(np.ones((50, 2)))
    rows = np.array([[1.0, 1.0], [2.0, -5.0]])
    assert same_bits(flatten_isolation(model).scores(rows), -model.decision_function(rows))


@pytest.mark.parametrize("settings", [{}, {"with_mean": False}, {"with_std": False}])
def test_a_standard_scaler_is_folded_in(settings: dict[str, bool]) -> None:
    pipeline = make_pipeline(StandardScaler(**settings), IsolationForest(n_estimators=60, contamination=0.01, random_state=1))
    pipeline.fit(machine_rows(2000, 1))
    scorer, rows = flatten_isolation(pipeline), machine_rows(20_000, 5)
    assert same_bits(scorer.scores(rows), -pipeline.decision_function(rows))
    assert same_bits([scorer.score_one(row) for row in rows[:500]], -pipeline.decision_function(rows[:500]))


def test_the_iforest_of_pyod_scores_the_same_with_its_own_sign() -> None:
    iforest = pytest.importorskip("pyod.models.iforest").IForest
    rows = machine_rows(5000, 6)
    model = iforest(n_estimators=60, contamination=0.02, random_state=3).fit(machine_rows(2000, 1))
    assert same_bits(flatten_isolation(model).scores(rows), model.decision_function(rows))


def test_the_score_is_zero_centred_and_larger_is_worse() -> None:
    _, scorer = model_and_scorer()
    training = machine_rows(2000, 1)
    assert (scorer.scores(training) > 0.0).mean() == pytest.approx(0.01, abs=0.001)
    assert scorer.score_one(training.mean(axis=0)) < -0.1 < 0.1 < scorer.score_one(training.mean(axis=0) + 8.0 * SPREAD)


WRONG: dict[str, tuple[list[Any], str]] = {
    "NaN": ([1.0, float("nan"), 1.0, 1.0, 1.0], "feature 1 is nan"),
    "infinite": ([1.0, 1.0, 1.0, 1.0, float("inf")], "feature 4 is inf"),
    "beyond a float32": ([1e39, 1.0, 1.0, 1.0, 1.0], "feature 0 is 1e[+]39"),
    "null": ([1.0, 1.0, None, 1.0, 1.0], "feature 2 is None"),
    "text": ([1.0, 1.0, 1.0, "fast", 1.0], "feature 3 is fast"),
    "too short": ([1.0, 1.0], "2 values: .* 5 features"),
    "too long": ([1.0] * 6, "6 values"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_row_that_is_not_finite_numbers_is_refused_by_name(case: str) -> None:
    _, scorer = model_and_scorer()
    row, message = WRONG[case]
    with pytest.raises(ForestError, match=message):
        scorer.score_one(row)


def test_among_many_rows_the_bad_one_is_named() -> None:
    _, scorer = model_and_scorer()
    for count in (20, 200):
        rows = machine_rows(count, 1)
        rows[17, 3] = np.nan
        with pytest.raises(ForestError, match="row 17: feature 3 is nan"):
            scorer.scores(rows)
    with pytest.raises(ForestError, match=r"\(n, 5\)"):
        scorer.scores(np.zeros((3, 4)))


def test_whole_numbers_are_numbers() -> None:
    _, scorer = model_and_scorer()
    assert scorer.score_one([40, 6000, 1000, 40, 0]) == scorer.score_one([40.0, 6000.0, 1000.0, 40.0, 0.0])


def test_what_is_no_isolation_forest_is_refused() -> None:
    rows = machine_rows(100, 1)
    cases = [
        (RandomForestClassifier(5).fit(rows, np.arange(100) % 2), "RandomForestClassifier is no isolation forest"),
        (IsolationForest(), "has not been trained"),
        (make_pipeline(PCA(2), IsolationForest(n_estimators=5)).fit(rows), "PCA before the forest cannot be folded"),
    ]
    for model, message in cases:
        with pytest.raises(ForestError, match=message):
            flatten_isolation(model)


def test_a_scikit_learn_that_scores_otherwise_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model = isolation(5, 200)
    theirs = model.decision_function
    monkeypatch.setattr(model, "decision_function", lambda rows: np.nextafter(theirs(rows), 1.0))
    with pytest.raises(ForestError, match="come out otherwise"):
        flatten_isolation(model)
