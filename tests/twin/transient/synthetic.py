"""The synthetic drive of `benchmarks/tool_change_detector.py`, and a small detector that was learned from it."""

import importlib
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from twin.transient.training import Trained

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@cache
def benchmark() -> ModuleType:
    """The benchmark, as a module."""
    return _script("tool_change_detector")


@cache
def drive() -> ModuleType:
    """Its synthetic drive, as a module."""
    return _script("synthetic_changes")


@cache
def small() -> Trained:
    """Learned from five captures at 10 dB and four hours of null."""
    trained: Trained = drive().learned_from(5, 4.0, 10.0, np.random.default_rng(7))
    return trained


def _script(name: str) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.path", [*sys.path, str(BENCHMARKS)])  # last: a benchmark is called edge.py
        return importlib.import_module(name)
