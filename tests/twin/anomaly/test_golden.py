"""The golden week: the same model gives its frozen scores and alerts; another stays within what its threshold stands for."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.anomaly.models import calibration, rows, small_model
from twin.anomaly.alarm import AlarmRule, is_alarm, onsets
from twin.anomaly.common_mode import CommonModeRule, Method, adjust_frames, standardised
from twin.anomaly.errors import ModelError
from twin.anomaly.golden_check import adjusted_by_peers, checked, frozen, most_alerts, peers_of
from twin.anomaly.model import load_golden, load_model, save_model

COUNT = 2000
NO_PEERS = np.full(COUNT, np.nan)


def week() -> tuple[np.ndarray, np.ndarray]:
    """Rows with three bursts far out, one of them gated, and one hole."""
    features, gated = rows(COUNT, 4), np.zeros(COUNT, dtype=bool)
    for start in (300, 900, 1500):
        features[start : start + 10] += 60.0 * np.array([10.0, 1000.0, 300.0, 5.0, 0.1])
    features[1000, 2] = np.nan
    gated[895:920] = True
    return features, gated


def test_the_model_itself_passes_and_so_does_what_comes_back_from_a_folder(tmp_path: Path) -> None:
    model = small_model().calibrated(calibration(threshold=0.1))
    golden = frozen(model, *week(), NO_PEERS)
    assert golden.alerts == 2
    save_model(model, tmp_path / "model", golden)
    kept = load_golden(tmp_path / "model")
    assert kept is not None
    found = checked(load_model(tmp_path / "model"), kept)
    assert (found.passes, found.differ, found.alerts, found.frozen_alerts) == (True, 0, 2, 2)
    assert found.ticks == COUNT


def test_a_model_that_is_another_fails_as_the_same_and_may_pass_as_a_challenger() -> None:
    golden = frozen(small_model().calibrated(calibration(threshold=0.1)), *week(), NO_PEERS)
    other = small_model(seed=2).calibrated(calibration(threshold=0.1, alerts_per_week=1000.0))
    found = checked(other, golden)
    assert not found.passes
    assert "scores are not the frozen ones" in found.faults[0]
    assert checked(other, golden, is_challenger=True).passes


def test_a_challenger_beyond_its_budget_fails() -> None:
    golden = frozen(small_model().calibrated(calibration(threshold=0.1)), *week(), NO_PEERS)
    loud = small_model(seed=2).calibrated(calibration(threshold=0.1, alerts_per_week=1.0))
    found = checked(loud, golden, is_challenger=True)
    assert (found.passes, found.alerts, found.alerts_max) == (False, 2, 0)
    assert "2 alerts in 0.0033 machine-weeks; 1 a week allow 0" in found.faults[0]


def test_what_cannot_be_compared_is_refused() -> None:
    golden = frozen(small_model().calibrated(calibration()), *week(), NO_PEERS)
    with pytest.raises(ModelError, match="no threshold"):
        checked(small_model(), golden)
    with pytest.raises(ModelError, match=r"tick of 1 s, the model of 0\.1 s"):
        checked(small_model().calibrated(calibration(tick_s=0.1)), golden)


def test_a_damaged_golden_week_is_refused(tmp_path: Path) -> None:
    model = small_model().calibrated(calibration())
    save_model(model, tmp_path / "model", frozen(model, *week(), NO_PEERS))
    (tmp_path / "model" / "golden.npz").write_bytes(b"PK")
    load_model(tmp_path / "model")  # scoring does not need it
    with pytest.raises(ModelError, match="SHA-256"):
        load_golden(tmp_path / "model")


@given(st.integers(0, 2**31), st.integers(1, 6), st.sampled_from([Method.SOURCE, Method.RESIDUAL]), st.booleans())
@settings(max_examples=60, deadline=None)
def test_alarms_beside_frozen_peers_are_those_of_the_cell(seed: int, machines: int, method: Method, excluded: bool) -> None:
    """What the peers were is one figure a tick; the alarms that come of it are those of the whole frame."""
    generator = np.random.default_rng(seed)
    raw = generator.normal(0.0, 1.0, (200, machines)).round(1)
    raw[generator.random(raw.shape) < 0.1] = np.nan
    gated = generator.random(raw.shape) < 0.2
    found = calibration(common_mode=method, exclude_gated_peers=excluded, raw_center=0.1, raw_spread=0.7)
    rule = CommonModeRule(method, found.common_mode_factor, excluded)
    scale = raw if method is Method.SOURCE else (raw - found.raw_center) / found.raw_spread
    assert np.isnan(raw[0, 0]) or scale[0, 0] == (raw[0, 0] if method is Method.SOURCE else standardised(raw[0, 0], 0.1, 0.7))
    adjusted, _ = adjust_frames(rule, scale, gated)
    alarm = AlarmRule(0.5, 2)
    for place in range(machines):
        mine = adjusted_by_peers(found, raw[:, place], gated[:, place], peers_of(rule, scale, gated, place))
        assert np.allclose(mine, adjusted[:, place], rtol=0.0, atol=1e-12, equal_nan=True)
        if method is Method.SOURCE:
            both = [onsets(is_alarm(alarm, one, gated[:, place])).tolist() for one in (mine, adjusted[:, place])]
            assert both[0] == both[1]


def test_a_budget_of_nothing_allows_nothing_and_of_much_no_more_than_chance() -> None:
    assert [most_alerts(expected) for expected in (0.0, 0.01, 1.0, 5.0, 1000.0)] == [0, 0, 3, 9, 1053]
