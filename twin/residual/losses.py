"""Squared errors of a residual model on a recording, by which a challenger is held against a champion."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from twin.residual.model import load_model
from twin.residual.recorded_run import recorded_run
from twin.residual.table import table_of
from twin.runlog import RunLog

Floats = NDArray[np.float64]
ROW_S = 10.0


def losses(folder: Path, run: RunLog) -> tuple[Floats, Floats]:
    """Times (n,), s, and squared errors (n,), K², of measured less corrected; outside its region the physics alone counts.

    Raises ResidualError where the model is damaged, or the run lacks a signal that it needs.
    """
    model = load_model(folder)
    table = table_of(recorded_run(run, model.trained.physics), model.features, ROW_S)
    inside = model.region.has(table.x)
    error = table.residual_k.copy()
    if inside.any():
        error[inside] -= model.forest.predict(table.x[inside])
    return table.t_s, error**2
