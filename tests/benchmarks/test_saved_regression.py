"""A regression forest in a folder comes back to the last bit, and only for its own features."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.saved_regression import load_regression, save_regression
from tests.twin.forest.forests import regression, same_bits
from twin.forest import ForestError, flatten_regression

ROWS = np.random.default_rng(5).normal(size=(3000, 8))
NAMES = tuple("abcdefgh")


def test_what_comes_back_from_a_folder_is_the_same(tmp_path: Path) -> None:
    flat = flatten_regression(regression())
    save_regression(flat, tmp_path / "load", NAMES, "spindle_load_pct")
    again = load_regression(tmp_path / "load", NAMES)
    assert same_bits(again.predict(ROWS), flat.predict(ROWS))
    assert sorted(path.name for path in (tmp_path / "load").iterdir()) == ["arrays.npz", "manifest.json"]
    assert json.loads((tmp_path / "load" / "manifest.json").read_text())["target"] == "spindle_load_pct"
    save_regression(flat, tmp_path / "again", NAMES, "spindle_load_pct")
    assert (tmp_path / "again" / "arrays.npz").read_bytes() == (tmp_path / "load" / "arrays.npz").read_bytes()


def test_other_features_or_another_order_are_refused(tmp_path: Path) -> None:
    flat = flatten_regression(regression())
    save_regression(flat, tmp_path / "load", NAMES, "spindle_load_pct")
    with pytest.raises(ForestError, match="give them in its order"):
        load_regression(tmp_path / "load", NAMES[::-1])
    with pytest.raises(ForestError, match="3 names for 8 features"):
        save_regression(flat, tmp_path / "other", NAMES[:3], "spindle_load_pct")
