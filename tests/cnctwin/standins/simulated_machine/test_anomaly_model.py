"""The model that ships with the simulated machine: it was trained on this machine, and knows all that it does."""

from pathlib import Path

import numpy as np

from cnctwin.importing.shdr import recorded_runs
from cnctwin.standins.simulated_machine.anomaly_model import FEATURES, place_model
from cnctwin.standins.simulated_machine.description import DEVICES, SPARE_PART
from cnctwin.training.anomaly.replayed_cell import replayed
from processors.config import read_tables
from processors.joint_anomaly.processor import PROCESSOR
from processors.joint_anomaly.scoring import scoring_of


def test_the_part_that_ships_with_the_project_is_nothing_unusual_to_it(tmp_path: Path) -> None:
    """Where this fails: scripts/make-model."""
    settings = tmp_path / "processors.toml"
    settings.write_text(place_model(tmp_path / "models", "vmc"))
    table = read_tables(settings)["joint_anomaly"]
    model = scoring_of(PROCESSOR.configured(table), "vmc").model
    assert model is not None
    assert model.features == FEATURES
    assert model.preparation is not None
    assert {"O1701|1|100", "O1701|5|100", "standing"} <= set(model.preparation.regimes)
    (run,) = recorded_runs(SPARE_PART, DEVICES)
    track = replayed({"vmc": run}, {"vmc": model}, {"common_mode": "features"})["vmc"]
    judged = track.adjusted[np.isfinite(track.adjusted) & ~track.skipped]
    assert len(judged) > 15
    assert model.calibration is not None
    assert judged.max() < model.calibration.threshold
