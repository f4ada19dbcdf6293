"""The model that ships with the simulated machine: it was trained on this machine, and knows all that it does."""

from pathlib import Path

import numpy as np

from cnctwin.importing.shdr import recorded_runs
from cnctwin.standins.simulated_machine.anomaly_model import FEATURES, place_model
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from cnctwin.standins.simulated_machine.expectation import place_expectation
from cnctwin.training.anomaly.replayed_cell import replayed
from processors.config import read_tables
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scoring_of


def test_the_part_that_ships_with_the_project_is_nothing_unusual_to_it(tmp_path: Path) -> None:
    """Where this fails: scripts/make-model."""
    settings = tmp_path / "processors.toml"
    place_expectation(tmp_path / "expectations", "vmc")
    settings.write_text(place_model(tmp_path / "models", "vmc", tmp_path / "expectations"))
    table = read_tables(settings)["joint_anomaly"]
    scoring = scoring_of(PROCESSOR.configured(table), "vmc")
    model = scoring.model
    assert model is not None and model.parts is not None
    assert model.features == FEATURES
    assert {"O1701|T1|1", "O1701|T5|1"} & set(model.parts.usual)
    assert {key.split("|")[1] for key in model.parts.usual} == {"T1", "T2", "T3", "T4", "T5"}
    assert "o1701" in scoring.expectations
    (run,) = recorded_runs(SPARE_PART, DEVICES)
    track = replayed({"vmc": run}, {"vmc": model}, {"common_mode": "parts"})["vmc"]
    judged = track.adjusted[np.isfinite(track.adjusted) & ~track.skipped]
    assert len(judged) > 15
    assert model.calibration is not None
    assert judged.max() < model.calibration.threshold
