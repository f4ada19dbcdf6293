"""The model of the simulated machine's scores, as `scripts/make-model` has trained it on a day of parts."""

import json
import shutil
from pathlib import Path

from cnctwin.standins.simulated_machine.description import ANOMALY_MODEL

FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c")


def place_model(folder: Path, machine: str, expectations: Path) -> str:
    """Put the model where `joint_anomaly` looks for it, under the machine's name; the table that tells it so.

    expectations: the folder with what the twin expects of the program
    """
    shutil.copytree(ANOMALY_MODEL, folder / machine / "current")
    return f"\n[joint_anomaly]\nmodels = {json.dumps(str(folder))}\nexpectations = {json.dumps(str(expectations))}\n"
