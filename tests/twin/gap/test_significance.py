"""Significance of means and energies of correlated samples."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from twin.gap.significance import MEAN_TOLERANCE, discoveries, means_of

Floats = NDArray[np.float64]


def coloured(rng: np.random.Generator, memory: float, count: int) -> Floats:
    """Noise of rms 1 whose autocorrelation is memory^|lag|."""
    white = rng.standard_normal(count + 2000)
    return np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white)[2000:])


def all_of(values: Floats) -> NDArray[np.bool_]:
    return np.ones((1, len(values)), dtype=bool)


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.98])
def test_the_error_of_a_mean_is_that_of_a_circular_block_bootstrap(memory: float) -> None:
    rng = np.random.default_rng(7)
    count = 20000
    series = coloured(rng, memory, count)
    time = (1.0 + memory) / (1.0 - memory)
    block = max(1, round(3.0 * time))
    wrapped = np.concatenate([series, series[:block]])
    sums = np.cumsum(np.concatenate([[0.0], wrapped]))
    starts = rng.integers(0, count, (1000, count // block))
    means = (sums[starts + block] - sums[starts]).sum(axis=1) / (count // block * block)
    worth = float(means_of(series, all_of(series)).worth[0])
    assert series.std() / np.sqrt(worth) == pytest.approx(means.std(), rel=0.25)
    assert worth == pytest.approx(count / time, rel=0.3)


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.99])
def test_what_repeats_is_seldom_called_a_gap(memory: float) -> None:
    rng = np.random.default_rng(11)
    p = [float(means_of(noise, all_of(noise)).p()[0]) for noise in (coloured(rng, memory, 4000) for _ in range(200))]
    assert np.mean(np.array(p) < 0.05) <= 0.05


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.99])
def test_a_gap_of_twice_the_floor_is_called_one(memory: float) -> None:
    rng = np.random.default_rng(13)
    for _ in range(20):
        found = means_of(coloured(rng, memory, 8000) + 2.0, np.ones((1, 8000), dtype=bool))
        assert found.p_mean()[0] < 0.01
        assert found.p()[0] < 0.01


def test_structure_in_a_gap_does_not_hide_it() -> None:
    gap = 30.0 * np.sign(np.sin(np.arange(4000) / 300.0))
    assert means_of(gap, all_of(gap)).p_energy()[0] < 1e-6


def test_a_mean_within_the_tolerance_is_none_however_many_samples() -> None:
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(200_000) + 0.9 * MEAN_TOLERANCE
    assert means_of(noise, all_of(noise)).p_mean()[0] > 0.05


def test_a_cell_without_samples_is_no_discovery() -> None:
    values = np.array([np.nan, 1.0, 2.0, np.nan])
    found = means_of(values, np.array([[True, False, False, True], [False, True, True, False]]))
    assert found.count.tolist() == [0, 2]
    assert found.p()[0] == 1.0
    assert np.isfinite(found.p()).all()


def test_discoveries_are_those_of_benjamini_and_hochberg() -> None:
    rng = np.random.default_rng(5)
    false = []
    for _ in range(200):
        p = np.concatenate([rng.uniform(size=45), rng.uniform(0.0, 1e-6, size=5)])
        stands = discoveries(p)
        assert stands[45:].all()
        false.append(stands[:45].sum() / max(stands.sum(), 1))
    assert 0.02 < np.mean(false) < 0.08
    assert not discoveries(np.array([])).any()
