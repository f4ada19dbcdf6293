"""What needs the rest of the twin: a replay through the same folds, and predictions that a residual model corrects."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cnctwin.api import replay_child
from cnctwin.api.constants import Constants
from cnctwin.api.residual import Models
from cnctwin.api.store_reader import StoreReader
from cnctwin.memory.store.opening import open_store
from processors.discovery import find
from tests.cnctwin.api.small_plant import birth, client_of, data, small_plant
from tests.cnctwin.memory.replay.simulated_day import T0_MS, Day
from twin.forest.forest import forest_of_arrays
from twin.forest.regression import RegressionForest
from twin.residual.features import feature
from twin.residual.held_out import HeldOut, Interval
from twin.residual.model import ResidualModel, Trained, save_model
from twin.residual.physics import Physics
from twin.residual.region import Region

SECONDS = 10
PHYSICS_TOLD = Physics(alpha_w_per_pct_rpm2=2.2e-8, beta_w_per_rpm=1.6e-2, resistance_k_per_w=0.16, capacity_j_per_k=4000.0)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with some seconds of a machine and what `cutting_force` said of it."""
    day = Day([(find("cutting_force"), {})])
    events = [(0.2, birth({"spindle_rpm": 6000.0, "spindle_load_pct": 10.0, "tool_number": 1}, T0_MS + 200))]
    events += [(n, data({"spindle_load_pct": 10.0 + n}, T0_MS + 1000 * n)) for n in range(1, SECONDS)]
    day.run(events, SECONDS)
    folder = tmp_path_factory.mktemp("store")
    store = open_store(folder, writable=True)
    store.append(day.store.log)
    store.close()
    return folder


def replayed(place: Path, body: Any) -> tuple[int, dict[str, Any]]:
    store = StoreReader(str(place))
    with client_of(store=store) as client:
        answer = client.post("/twin/replay", json=body)
    store.close()
    return answer.status_code, answer.json()


def test_a_replay_gives_what_was_published_then(place: Path) -> None:
    status, told = replayed(place, {"machine": "vmc", "from": T0_MS, "to": T0_MS + 1000 * SECONDS})
    assert status == 200
    assert (told["equal"], told["differences"]) == (True, [])
    assert told["compared"] >= SECONDS - 1
    assert [one["name"] for one in told["processors"]] == ["cutting_force"]


@pytest.mark.parametrize(
    ("body", "status", "line"),
    [
        ({"machine": "lathe", "from": T0_MS, "to": T0_MS + 1}, 404, "there are vmc"),
        ({"machine": "vmc", "from": T0_MS, "to": T0_MS}, 400, "is no stretch of at most six hours"),
        ({"machine": "vmc", "from": T0_MS, "to": T0_MS + 6 * 3_600_000 + 1}, 400, "is no stretch of at most six hours"),
        ({"machine": "vmc", "from": -1, "to": T0_MS}, 400, "from is -1"),
        ({"machine": "", "from": 0, "to": 1}, 400, "machine is ''"),
        ({"machine": "vmc\x00", "from": 0, "to": 1}, 400, "machine is"),
        ({"machine": "--help", "from": 0, "to": 1}, 404, "there are vmc"),
        ({"machine": "vmc"}, 400, "from is missing"),
        ({"machine": "vmc", "from": "NaN", "to": 1}, 400, "from is 'NaN'"),
        ({"machine": "vmc", "from": 0, "to": 1, "store": "/etc"}, 400, "store is '/etc'"),
    ],
)  # fmt: skip
def test_a_replay_that_cannot_be_is_refused_in_one_line(place: Path, body: Any, status: int, line: str) -> None:
    code, told = replayed(place, body)
    assert (code, line in told["error"]) == (status, True), told


def test_a_replay_that_takes_too_long_is_ended(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_child, "SECONDS_MAX", 0.05)
    code, told = replayed(place, {"machine": "vmc", "from": T0_MS, "to": T0_MS + 1000})
    assert (code, "was ended" in told["error"]) == (503, True)


def test_without_a_store_a_replay_says_so() -> None:
    with client_of(small_plant()) as client:
        refusal = client.post("/twin/replay", json={"machine": "vmc", "from": 0, "to": 1})
    assert (refusal.status_code, "--store" in refusal.json()["error"]) == (503, True)


# Predictions with a residual model.


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of okuma by which the physics is 3 K too warm above 5,000 rev/min, trained up to 10,000."""
    gain = Interval(value=50.0, low=40.0, high=60.0)
    held_out = HeldOut(
        hours=1.0, gap_s=60.0, blocks=2, in_region=1.0, physics_rmse_k=2.0, corrected_rmse_k=1.0, constant_rmse_k=2.0,
        linear_rmse_k=2.0, gain=gain, over_constant=gain,
    )  # fmt: skip
    forest = forest_of_arrays(  # one tree of one question: is it 5,000 rev/min at most?
        {
            "child": np.array([1, 0, 0], np.int32),
            "feature": np.array([0, -1, -1], np.int16),
            "threshold": np.array([5000.0, 0.0, 0.0], np.float32),
            "leaf": np.array([-1, 0, 1], np.int32),
            "values": np.array([0.0, -3.0]),
            "tree_nodes": np.array([3], np.int32),
            "scaling": np.array([[0.0], [1.0]]),
        }
    )
    none = np.array([0.0])
    region = Region(none, np.array([10_000.0]), np.array([1e-4]), np.linspace(0.0, 1.0, 11)[:, None], np.array([0.1]))
    model = ResidualModel(
        (feature("spindle_rpm"),), RegressionForest(forest), region, Trained(machine="okuma", physics=PHYSICS_TOLD), held_out
    )
    folder = tmp_path_factory.mktemp("models")
    save_model(model, folder / "residual" / "okuma")
    (folder / "residual" / "okuma" / "current.json").write_text(json.dumps({"champion": model.version}))
    return folder


@pytest.fixture(scope="module")
def constants(tmp_path_factory: pytest.TempPathFactory) -> Constants:
    file = tmp_path_factory.mktemp("config") / "processors.toml"
    told = PHYSICS_TOLD.model_dump(exclude={"ambient_temp_c"})
    file.write_text("[thermal]\n" + "".join(f"{name} = {value}\n" for name, value in told.items()))
    return Constants(file)


def course(machine: str, rpm: float, **more: Any) -> dict[str, Any]:
    lists = {"spindle_rpm": [rpm] * 200, "spindle_load_pct": [30.0] * 200, "ambient_temp_c": [21.0] * 200}
    return {"machine": machine, "start_temp_c": 21.0, "dt_s": 20.0, **lists, **more}


def test_a_machine_with_a_model_is_corrected_where_the_model_was_trained(models: Path, constants: Constants) -> None:
    with client_of(models=Models(models), constants=constants) as client:
        told = client.post("/predict", json=course("okuma", 8000.0)).json()
        far = client.post("/predict", json=course("okuma", 30_000.0)).json()
        other = client.post("/predict", json=course("vmc", 8000.0)).json()
        metrics = client.get("/metrics").text
    added_k = [one - physics for one, physics in zip(told["corrected_temp_c"], told["spindle_temp_c"], strict=True)]
    assert added_k == pytest.approx([-3.0] * 200, abs=0.01)
    assert told["basis"]["residual"].startswith("model ")
    assert set(far["corrected_temp_c"]) == {None}
    assert "outside the region of training" in far["basis"]["residual"]
    assert (other["corrected_temp_c"], "no model of 'vmc'" in other["basis"]["residual"]) == (None, True)
    assert 'twin_model_version_info{machine="okuma",model="residual"' in metrics


def test_a_model_of_other_constants_corrects_nothing(models: Path) -> None:
    with client_of(models=Models(models)) as client:
        told = client.post("/predict", json=course("okuma", 8000.0)).json()
    assert told["corrected_temp_c"] is None
    assert "corrects another heat of the spindle; train it again" in told["basis"]["residual"]


def test_models_that_are_not_there_or_damaged_leave_the_physics(models: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "residual" / "okuma"
    damaged.mkdir(parents=True)
    (damaged / "current.json").write_text("{")
    for folder in (tmp_path, tmp_path / "none"):
        with client_of(models=Models(folder)) as client:
            told = client.post("/predict", json=course("okuma", 8000.0))
            (part,) = (part for part in client.get("/health").json()["parts"] if part["part"] == "models")
            assert 'twin_model_missing{model="residual"} 1.0' in client.get("/metrics").text
        assert (told.status_code, told.json()["corrected_temp_c"]) == (200, None)
        assert (part["state"], bool(part["do"])) == ("missing", True)
