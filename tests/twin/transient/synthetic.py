"""The synthetic drive of `benchmarks/tool_change_detector.py`, and a small detector that was learned from it."""

import importlib.util
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

from twin.transient.training import Trained


@cache
def benchmark() -> ModuleType:
    """The benchmark, as a module."""
    path = Path(__file__).parents[3] / "benchmarks" / "tool_change_detector.py"
    spec = importlib.util.spec_from_file_location("tool_change_detector_benchmark", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def small() -> Trained:
    """Learned from five captures at 10 dB and four hours of null."""
    trained: Trained = benchmark().learned_from(5, 4.0, 10.0, np.random.default_rng(7))
    return trained
