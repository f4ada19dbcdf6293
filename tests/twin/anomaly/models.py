"""A small trained model and its threshold."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.calibration import Calibration
from twin.anomaly.common_mode import Method
from twin.anomaly.detector import Detector, trained_model
from twin.anomaly.manifest import Trained
from twin.anomaly.model import AnomalyModel

Floats = NDArray[np.float64]
FEATURES = ("spindle_load_pct", "spindle_rpm", "feed_mm_min", "spindle_temp_c", "vibration_rms_g")


def rows(count: int = 600, seed: int = 1) -> Floats:
    spread, centre = np.array([10.0, 1000.0, 300.0, 5.0, 0.1]), np.array([40.0, 6000.0, 1000.0, 40.0, 0.2])
    return np.random.default_rng(seed).normal(size=(count, 5)) * spread + centre


def small_model(name: str = "isolation_forest", seed: int = 1, **parameters: Any) -> AnomalyModel:
    given = {"n_estimators": 20, **parameters} if name in {"isolation_forest", "IForest"} else parameters
    about = Trained(machine="vmc", at="2026-01-01T00:00:00Z", source=("run.parquet",), from_s=0.0, to_s=600.0)
    return trained_model(Detector(name, given, seed), rows(), FEATURES, about)


def calibration(**other: Any) -> Calibration:
    fields = {
        "tick_s": 1.0,
        "dwell_ticks": 3,
        "clear_fraction": 0.8,
        "calm_s": 600.0,
        "common_mode": Method.SOURCE,
        "common_mode_factor": 0.5,
        "exclude_gated_peers": False,
        "tail_s": 8.0,
        "look_back_s": 0.0,
        "threshold": 0.05,
        "alerts_per_week": 1.0,
        "estimate": 0.9,
        "low": 0.1,
        "high": 2.5,
        "hours": 160.0,
        "is_extrapolated": False,
        "raw_center": -0.1,
        "raw_spread": 0.04,
        "hourly_means": (-0.1, -0.11),
    }
    return Calibration(**{**fields, **other})
