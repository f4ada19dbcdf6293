"""A model in a folder is the model, or is refused in one line."""

import json
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.anomaly.models import FEATURES, calibration, rows, small_model
from twin.anomaly.detector import flattened
from twin.anomaly.errors import ModelError
from twin.anomaly.model import AnomalyModel, files_of, load_golden, load_model, load_models, save_model
from twin.forest.artefact import write_folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_model(small_model().calibrated(calibration()), tmp_path / "model")
    return tmp_path / "model"


def changed(folder: Path, **other: Any) -> Path:
    """The manifest with other values."""
    path = folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **other}))
    return folder


def test_what_comes_back_scores_the_same_and_knows_the_same(folder: Path) -> None:
    model, again = small_model().calibrated(calibration()), load_model(folder)
    assert np.array_equal(again.scores(rows(500, 2)), model.scores(rows(500, 2)))
    assert [again.score_one(row) for row in rows(50, 3).tolist()] == model.scores(rows(50, 3)).tolist()
    assert (again.features, again.trained, again.calibration) == (model.features, model.trained, model.calibration)
    assert load_golden(folder) is None


def test_the_same_model_is_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    save_model(load_model(folder), tmp_path / "again")
    for name in ("manifest.json", "arrays.npz"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()


def test_the_manifest_can_be_read_by_people(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["features"] == list(FEATURES)
    assert manifest["trained"]["rows"] == 600
    assert {"numpy", "scikit-learn", "pyod"} <= set(manifest["trained"]["versions"])
    assert manifest["calibration"]["common_mode"] == "source"
    assert len(manifest["arrays_sha256"]) == 64


def test_in_words(folder: Path) -> None:
    model = load_model(folder)
    assert model.in_words == f"isolation forest of 20 trees on {', '.join(FEATURES)}, trained 2026-01-01T00:00:00Z on 600 rows"
    assert model.calibration is not None
    assert model.calibration.in_words == "0.05, 0.9 alerts a machine-week (0.1 to 2.5) in 160 h"


def test_damaged_arrays_are_refused(folder: Path) -> None:
    data = bytearray((folder / "arrays.npz").read_bytes())
    data[len(data) // 2] ^= 1
    (folder / "arrays.npz").write_bytes(bytes(data))
    with pytest.raises(ModelError, match="SHA-256"):
        load_model(folder)


def test_arrays_of_another_model_are_refused(folder: Path, tmp_path: Path) -> None:
    save_model(small_model(seed=2), tmp_path / "other")
    (folder / "arrays.npz").write_bytes((tmp_path / "other" / "arrays.npz").read_bytes())
    with pytest.raises(ModelError, match="SHA-256"):
        load_model(folder)


FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "another kind": ({"kind": "cnctwin regression forest"}, "it has to be 'cnctwin anomaly model'"),
    "another version": ({"version": 2}, "version 2 of the format; this cnctwin reads 1"),
    "no features": ({"features": []}, "features"),
    "fewer features": ({"features": list(FEATURES[:4])}, "names 4 features, the arrays have 5"),
    "an unknown key": ({"pickle": "yes"}, "pickle"),
    "an unknown detector": ({"detector": {"kind": "neural"}}, "detector"),
    "a detector from elsewhere": ({"detector": {"kind": "pyod", "name": "os.system"}}, "no detector 'os.system'"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_manifest_that_does_not_fit_is_refused_in_one_line(folder: Path, case: str) -> None:
    other, message = FAULTS[case]
    with pytest.raises(ModelError, match=message) as caught:
        load_model(changed(folder, **other))
    assert "\n" not in str(caught.value)
    assert str(folder) in str(caught.value)


def test_what_is_not_there_or_no_json_is_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="cannot be read"):
        load_model(tmp_path / "nowhere")
    (folder / "manifest.json").write_text("{")
    with pytest.raises(ModelError, match="is not JSON"):
        load_model(folder)
    with pytest.raises(ModelError, match="no such folder"):
        load_models(tmp_path / "nowhere")
    with pytest.raises(ModelError, match="holds 0 models"):
        load_models(tmp_path)


def test_a_forest_that_was_handed_in_has_to_have_these_features() -> None:
    from sklearn.ensemble import IsolationForest

    model = IsolationForest(n_estimators=5, random_state=0).fit(rows())
    assert isinstance(flattened(model, FEATURES), AnomalyModel)
    with pytest.raises(ModelError, match="fitted on 5 features"):
        flattened(model, FEATURES[:4])
    model.feature_names_in_ = np.array(FEATURES[::-1])
    with pytest.raises(ModelError, match="in the order of its columns"):
        flattened(model, FEATURES)
    with pytest.raises(ModelError, match="no isolation forest"):
        flattened(object(), FEATURES)


def test_a_forest_scores_where_no_training_library_is_installed(folder: Path) -> None:
    program = f"""
import sys
sys.modules.update(dict.fromkeys(("sklearn", "pyod", "ruptures", "matplotlib", "joblib", "pickle5")))
from pathlib import Path
from twin.anomaly.model import load_model
print(load_model(Path({str(folder)!r})).score_one({rows(1, 3)[0].tolist()!r}))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3]
    )
    assert float(done.stdout) == small_model().score_one(rows(1, 3)[0])


@given(st.integers(0, 10**9), st.integers(0, 255))
@settings(max_examples=40, deadline=None)
def test_no_changed_byte_of_the_arrays_goes_unnoticed(at: int, value: int) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "model"
        write_folder(folder, _files())
        data = bytearray((folder / "arrays.npz").read_bytes())
        is_other = data[at % len(data)] != value
        data[at % len(data)] = value
        (folder / "arrays.npz").write_bytes(bytes(data))
        if is_other:
            with pytest.raises(ModelError, match="SHA-256"):
                load_model(folder)


@cache
def _files() -> dict[str, bytes]:
    return files_of(small_model())
