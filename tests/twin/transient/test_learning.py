"""A template is learned from a few noisy captures, not from the truth."""

import numpy as np
import pytest

from benchmarks import synthetic_changes as drive
from tests.twin.transient.synthetic import small
from twin.transient.capture import parts_of
from twin.transient.errors import TransientError
from twin.transient.learning import learned
from twin.transient.template import resampled


def captures(count: int, snr_db: float, seed: int, **how: bool) -> list[np.ndarray]:  # type: ignore[type-arg]
    rng = np.random.default_rng(seed)
    stream = drive.stream_of_changes(count, snr_db, rng, **{"stretched": False, "stalled": False} | how)
    return [stream.window(at_s, 10.0, 10.0) for at_s in stream.changes_s]


def test_the_parts_of_a_capture_are_where_it_moves() -> None:
    window = np.concatenate([np.ones(40), drive.changed(1.0, 0.0, 3.0), np.ones(40)])
    parts = parts_of(window, 0.1)
    assert 32 <= parts.first <= 43 and 55 <= parts.begun <= 75 and 95 <= parts.ending <= 110 and 120 <= parts.last <= 145


@pytest.mark.parametrize("how", [{}, {"stretched": True}, {"stalled": True}], ids=["alike", "stretched", "stalled"])
def test_the_average_is_near_to_the_truth(how: dict[str, bool]) -> None:
    found = learned(captures(6, 10.0, 1, **how), 0.1, 4.0)
    template = found.template
    truth = np.concatenate([np.ones(400), drive.synthetic_change(np.arange(0.0, 10.0, 0.01)), np.ones(400)])
    whole, best = template.whole, 0.0
    for begin_s in np.arange(0.0, 6.0, 0.1):
        for seconds in np.arange(7.0, 14.0, 0.1):
            piece = truth[round(begin_s * 100) : round((begin_s + seconds) * 100)]
            best = max(best, float(np.corrcoef(resampled(piece, len(whole)), whole)[0, 1]))
    assert best > 0.94
    assert sum(fit is not None for fit in found.fits) >= 5


def test_one_capture_is_enough_to_begin_with() -> None:
    found = learned(captures(1, 20.0, 2), 0.1, 4.0)
    assert 6.0 < found.template.seconds < 12.0


@pytest.mark.parametrize(
    ("windows", "words"),
    [
        ([], "no captured change"),
        ([np.ones(200)], "nothing moves"),
        ([np.concatenate([np.ones(100), np.zeros(100)])], "no beginning and end"),
    ],
    ids=["none", "flat", "a step"],
)
def test_what_holds_no_change_is_refused_with_the_reason(windows: list[np.ndarray], words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(TransientError, match=words):
        learned(windows, 0.1, 4.0)


def test_training_says_what_it_rests_on() -> None:
    done = small()
    assert done.changes == len(done.captured) == done.confirmed == 5
    assert done.rate.null_hours == pytest.approx(4.0, abs=0.2)
    assert done.rate.low <= done.rate.per_day <= done.rate.high
    assert done.rate.is_extrapolated
    assert done.copies_found > 0.9
    assert done.weighed_peaks is None
