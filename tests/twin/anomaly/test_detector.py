"""Detectors are trained by name; what is no forest is trained again when it is loaded, and has to score the same."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.depth import IS_FULL
from tests.twin.anomaly.models import FEATURES, rows, small_model
from twin.anomaly import refit
from twin.anomaly.detector import Detector, trained_model
from twin.anomaly.errors import ModelError
from twin.anomaly.model import load_model, save_model

QUICK: dict[str, dict[str, Any]] = {
    "ABOD": {},
    "CBLOF": {},
    "COPOD": {},
    "ECOD": {},
    "GMM": {},
    "HBOS": {"n_bins": 12},
    "INNE": {"n_estimators": 20},
    "KDE": {},
    "KNN": {"n_neighbors": 7, "method": "mean"},
    "LODA": {},
    "LOF": {},
    "MCD": {},
    "OCSVM": {},
    "PCA": {},
}


def test_every_detector_of_the_table_is_tried() -> None:
    assert set(QUICK) == set(refit.KINDS)


@pytest.mark.parametrize("name", QUICK if IS_FULL else ["ECOD", "GMM", "HBOS", "INNE", "KNN", "LOF"])
def test_a_detector_of_pyod_comes_back_with_the_same_scores(name: str, tmp_path: Path) -> None:
    model = small_model(name, **QUICK[name])
    save_model(model, tmp_path / "model")
    again = load_model(tmp_path / "model")
    judged = rows(20, 9)
    assert np.allclose(again.scores(judged), model.scores(judged), rtol=1e-9, atol=1e-9)
    assert np.allclose([again.score_one(row) for row in judged.tolist()], again.scores(judged), rtol=1e-9, atol=1e-9)
    assert again.score_one(judged.mean(axis=0)) < again.score_one(judged.mean(axis=0) + 10.0 * judged.std(axis=0))


@pytest.mark.parametrize("name", ["isolation_forest", "IForest", "KNN", "LODA"])
def test_the_same_seed_trains_the_same_model(name: str) -> None:
    judged = rows(50, 9)
    assert np.array_equal(small_model(name, seed=3).scores(judged), small_model(name, seed=3).scores(judged))


def test_zero_is_what_the_contamination_share_exceeds() -> None:
    for name in ("isolation_forest", "IForest", "KNN"):
        model = small_model(name, contamination=0.05)
        assert (model.scores(rows()) > 0.0).mean() == pytest.approx(0.05, abs=0.02)


def test_rows_that_are_not_wholly_known_are_left_out() -> None:
    holed = rows()
    holed[::3, 2] = np.nan
    model = trained_model(Detector(parameters={"n_estimators": 5}), holed, FEATURES)
    assert model.trained.rows == 400


def test_training_rows_are_bounded() -> None:
    model = small_model("ECOD")
    assert len(refit.fitted("ECOD", {}, 0, rows(5000)).rows) == refit.KINDS["ECOD"].rows_max
    assert np.array_equal(model.scorer.rows, rows())


def never_known() -> Any:
    holed = rows()
    holed[:, 3] = np.nan
    return holed


REFUSED: list[tuple[Detector, Any, str]] = [
    (Detector("DeepSVDD"), rows(), "there is no detector 'DeepSVDD'; there are isolation_forest, IForest, ABOD"),
    (Detector("KNN", {"neighbours": 3}), rows(), "KNN has no parameter 'neighbours'; it has"),
    (Detector("isolation_forest", {"trees": 3}), rows(), "isolation_forest cannot be trained: .*trees"),
    (Detector("KNN", {"contamination": 0.9}), rows(), "KNN cannot be trained on 600 rows"),
    (Detector(), rows(63), "63 of 63 rows have all features: at least 64"),
    (Detector(), never_known(), "spindle_temp_c is never known"),
    (Detector(), rows()[:, :3], "for the 5 features"),
]


@pytest.mark.parametrize("case", range(len(REFUSED)))
def test_what_cannot_be_trained_is_refused_by_name(case: int) -> None:
    detector, given, message = REFUSED[case]
    with pytest.raises(ModelError, match=message):
        trained_model(detector, given, FEATURES)


def test_a_detector_that_scores_otherwise_when_it_is_loaded_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_model(small_model("KNN"), tmp_path / "model")
    known = refit._trained
    monkeypatch.setattr(refit, "_trained", lambda name, parameters, seed, kept: known(name, parameters, seed, kept[:300]))
    with pytest.raises(ModelError, match="trained again, scores the kept rows otherwise"):
        load_model(tmp_path / "model")


def test_without_the_libraries_the_way_out_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name="sklearn")

    monkeypatch.setattr(refit, "import_module", missing)
    with pytest.raises(ModelError, match=r"sklearn is not installed.*pip install 'cnctwin\[anomaly\]'"):
        trained_model(Detector(), rows(), FEATURES)


def test_a_value_that_is_not_finite_is_refused() -> None:
    model = small_model("HBOS")
    with pytest.raises(ModelError, match="5 finite numbers"):
        model.score_one([1.0, 2.0, float("nan"), 3.0, 4.0])
    with pytest.raises(ModelError, match="5 finite numbers"):
        model.score_one([1.0])
    assert len(model.scores(np.zeros((0, 5)))) == 0
