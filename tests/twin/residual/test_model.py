"""The artefact: arrays and a manifest with a checksum; scikit-learn's figures to the last bit; nothing damaged is used."""

import json
from pathlib import Path

import numpy as np
import pytest
from sklearn.ensemble import RandomForestRegressor

from tests.twin.residual.days import small_model
from twin.forest.artefact import ARRAYS, MANIFEST
from twin.residual.errors import ResidualError
from twin.residual.model import load_model, load_models, save_model
from twin.residual.prediction import predict_correction
from twin.residual.training import TrainingSettings, fitted


def test_the_flattened_forest_says_what_scikit_learn_says_to_the_last_bit() -> None:
    done = small_model()
    x, y = done.table.of(done.model.features), done.table.residual_k
    theirs = RandomForestRegressor(20, max_depth=14, min_samples_leaf=5, random_state=3).fit(x[:2000], y[:2000]).predict(x[:500])
    ours = fitted(x[:2000], y[:2000], TrainingSettings(trees=20, seed=3))
    assert [ours.predict_one(row) for row in x[:500].tolist()] == theirs.tolist()
    assert ours.predict(x[:500]).tolist() == theirs.tolist()


def test_a_model_comes_back_as_it_was_written(tmp_path: Path) -> None:
    model = small_model().model
    again = load_model(save_model(model, tmp_path))
    rows = small_model().table.of(model.features)[::50].tolist()
    assert [again.correction_one(row) for row in rows] == [model.correction_one(row) for row in rows]
    assert (again.version, again.features, again.held_out, again.trained) == (
        model.version, model.features, model.held_out, model.trained)  # fmt: skip
    assert dict(again.files) == dict(model.files)
    assert (tmp_path / model.version / ARRAYS).exists()


def test_a_model_names_its_training_and_its_gain() -> None:
    model = small_model().model
    assert model.version in model.in_words
    assert "gain over the physics on 18 h held out: " in model.in_words
    manifest = json.loads(model.files[MANIFEST])
    assert manifest["trained"]["machine"] == "okuma"
    assert manifest["trained"]["from"] < manifest["trained"]["to"]
    assert manifest["trained"]["physics"]["capacity_j_per_k"] == 4000.0


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


DAMAGE = {
    "arrays cut off": (lambda folder: _cut(folder / ARRAYS), "SHA-256"),
    "a bit of the arrays": (lambda folder: _bit(folder / ARRAYS), "SHA-256"),
    "arrays missing": (lambda folder: (folder / ARRAYS).unlink(), "cannot be read"),
    "no JSON": (lambda folder: (folder / MANIFEST).write_text("{"), "is not JSON"),
    "another kind": (lambda folder: _edited(folder, kind="cnctwin anomaly model"), "kind is"),
    "another version": (lambda folder: _edited(folder, version=2), "train again"),
    "a feature less": (lambda folder: _edited(folder, features=["spindle_rpm"]), "1 features"),
    "an unknown feature": (lambda folder: _edited(folder, features=["x"] * 7), "is no feature"),
    "a key too many": (lambda folder: _edited(folder, more=1), "more"),
}


def _edited(folder: Path, **keys: object) -> None:
    document = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps({**document, **keys}))


@pytest.mark.parametrize("case", DAMAGE.values(), ids=DAMAGE.keys())
def test_a_damaged_model_is_refused_in_one_line(tmp_path: Path, case: tuple[object, str]) -> None:
    damage, said = case
    folder = save_model(small_model().model, tmp_path)
    damage(folder)  # type: ignore[operator]
    with pytest.raises(ResidualError, match=said) as refused:
        load_model(folder)
    assert str(folder) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_pointer_names_the_model_that_counts(tmp_path: Path) -> None:
    machine = tmp_path / "residual" / "okuma"
    model = small_model().model
    save_model(model, machine)
    assert load_models(tmp_path) == {}
    (machine / "current.json").write_text(json.dumps({"champion": model.version}))
    assert load_models(tmp_path)["okuma"].version == model.version
    assert load_models(tmp_path / "residual")["okuma"].version == model.version
    (machine / "current.json").write_text(json.dumps({"champion": "../.."}))
    with pytest.raises(ResidualError, match="has to name a folder"):
        load_models(tmp_path)
    (machine / "current").symlink_to(model.version, target_is_directory=True)
    assert load_models(tmp_path)["okuma"].version == model.version
    assert load_models(tmp_path / "nowhere") == {}


def test_a_course_is_corrected_as_far_as_the_region_goes() -> None:
    model, n = small_model(feature_set="lean").model, 400
    # 8,000 rev/min from cold, 20 s apart.
    rise = 20.0 * (1.0 - np.exp(-np.arange(n) * 20.0 / 640.0))
    course = {
        "spindle_rpm": [8000.0] * n,
        "spindle_load_pct": [30.0] * n,
        "ambient_temp_c": [21.0] * n,
        "twin/spindle_temp_c": (21.0 + rise).tolist(),
    }
    found = predict_correction(model, course, 20.0)
    used = [one.correction_k for one in found if one.correction_k is not None]
    assert len(used) > 100
    assert min(used) < -3.0
    assert all(one.reason for one in found if one.correction_k is None)
    far = predict_correction(model, {**course, "spindle_rpm": [30_000.0] * n}, 20.0)
    assert far[0].reason == "outside the region of training: spindle_rpm~600 is about 30000, trained for -149 to 8160"


def test_a_course_without_a_feature_says_which() -> None:
    model = small_model(feature_set="published").model
    found = predict_correction(model, {"spindle_rpm": [1.0, 2.0], "ambient_temp_c": [20.0, 20.0]}, 1.0)
    assert len(found) == 2
    assert found[0].reason is not None
    assert "feed_mm_min, axis_x_pos_mm" in found[0].reason
    with pytest.raises(ResidualError, match="lengths differ: spindle_rpm 1, ambient_temp_c 2"):
        predict_correction(model, {"spindle_rpm": [1.0], "ambient_temp_c": [20.0, 20.0]}, 1.0)
    with pytest.raises(ResidualError, match="dt_s is 0"):
        predict_correction(model, {}, 0.0)
