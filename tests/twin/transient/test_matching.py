"""The matched filter says what scipy.signal.correlate says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import correlate

from twin.transient.history import History
from twin.transient.level import QUANTA
from twin.transient.matching import append, best_parts, best_pattern
from twin.transient.template import Bank, Template, resampled

Floats = NDArray[np.float64]
RNG = np.random.default_rng(3)
SHAPE = np.concatenate([np.linspace(1.0, -1.0, 20), np.full(40, -0.6), np.linspace(-1.0, 1.4, 15), np.full(15, 1.0)])
TEMPLATE = Template(0.1, SHAPE[:25], SHAPE[25:58], SHAPE[58:], stall_s=2.0)


def oracle(stream: Floats, part: Floats) -> Floats:
    """Normalised cross correlation by scipy, at each last sample of a window."""
    n = len(part)
    weights = part - part.mean()
    sums = correlate(stream, np.ones(n), mode="valid")
    energy = correlate(stream**2, np.ones(n), mode="valid") - sums**2 / n
    return np.asarray(correlate(stream, weights, mode="valid") / (np.linalg.norm(weights) * np.sqrt(energy)))


def streamed(stream: Floats, bank: Bank) -> tuple[Floats, Floats]:
    """rho of each part and stretch, (n, 2, k), and the best of both, (n, 2)."""
    history = History.empty(bank.samples + 1, 2)
    out = np.zeros((4, bank.terms.shape[1]))
    all_, best = [], []
    for value in stream:
        history = history.with_room()
        append(history.rows, history.end, value, -1.0, -1.0)
        history = history.grown()
        best.append(best_parts(history.rows, history.end, bank.weights, bank.terms, 0.0, 1e12, out))
        all_.append(out[:2].copy())
    return np.array(all_), np.array(best)


@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_each_stretched_form_is_correlated_as_scipy_does(offset: float) -> None:
    stream = np.rint((RNG.standard_normal(600).cumsum() * 0.2 + offset) * QUANTA)
    found, best = streamed(stream, TEMPLATE.bank)
    for k, stretch in enumerate(TEMPLATE.stretches):
        for part, values in enumerate((TEMPLATE.start, TEMPLATE.end)):
            form = resampled(values, round(len(values) * stretch))
            np.testing.assert_allclose(found[len(form) - 1 :, part, k], oracle(stream, form), atol=1e-9)
    np.testing.assert_array_equal(best, np.maximum(found.max(axis=2), 0.0))


def test_both_parts_count_as_one_window_with_a_gap() -> None:
    bank = TEMPLATE.bank
    stream = np.rint(RNG.standard_normal(400) * QUANTA)
    history = History.empty(bank.samples + 1, 2)
    out = np.zeros((4, bank.terms.shape[1]))
    for value in stream:
        history = history.with_room()
        append(history.rows, history.end, value, -1.0, -1.0)
        history = history.grown()
        best_parts(history.rows, history.end, bank.weights, bank.terms, 0.0, 1e12, out)
    found = best_pattern(history.rows, history.end, 0, -1.0, bank.weights, bank.terms, out)
    best = -1.0
    for k, stretch in enumerate(TEMPLATE.stretches):
        start, end = (resampled(part, round(len(part) * stretch)) for part in (TEMPLATE.start, TEMPLATE.end))
        form = np.concatenate([start, end])
        for gap in range(int(bank.terms[2, k]), int(bank.terms[3, k]) + 1):
            last = stream[len(stream) - len(end) :]
            over = len(stream) - len(end) - gap
            best = max(best, float(np.corrcoef(form, np.concatenate([stream[over - len(start) : over], last]))[0, 1]))
    assert found[0] == pytest.approx(best, abs=1e-9)


def test_a_window_that_is_flat_or_too_small_is_no_part_of_a_pattern() -> None:
    bank = TEMPLATE.bank
    flat = np.full(200, 5.0 * QUANTA)
    assert streamed(flat, bank)[0].max() == 0.0
    out = np.zeros((4, bank.terms.shape[1]))
    history = History.of([[float(round(value * 0.1 * QUANTA)) for value in SHAPE], [0.0] * 90, [0.0] * 90], bank.samples + 1, 90)
    assert max(best_parts(history.rows, 90, bank.weights, bank.terms, 0.5 * QUANTA, 2.0 * QUANTA, out)) == 0.0
    assert max(best_parts(history.rows, 90, bank.weights, bank.terms, 0.05 * QUANTA, 2.0 * QUANTA, out)) > 0.95


@given(size=st.floats(0.05, 20.0), offset=st.floats(-10.0, 10.0))
@settings(max_examples=20, deadline=None)
def test_neither_size_nor_offset_matters(size: float, offset: float) -> None:
    stream = np.concatenate([np.full(30, SHAPE[0]), SHAPE])
    plain, _ = streamed(np.rint(stream * QUANTA), TEMPLATE.bank)
    other, _ = streamed(np.rint((stream * size + offset) * QUANTA), TEMPLATE.bank)
    np.testing.assert_allclose(other, plain, atol=0.03)
