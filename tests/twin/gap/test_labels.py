"""Every sample has one label, known from what the machine was told."""

import numpy as np
import pytest

from tests.twin.gap.traces import MACHINE, strokes
from twin.gap.labels import regime_labels
from twin.runlog import RunLog, run_log


def named(log: RunLog, signal: str, at_s: float) -> str:
    names, label = regime_labels(log, signal, MACHINE)
    return names[label[int(np.searchsorted(log.t_s, at_s))]]


def process() -> RunLog:
    """10 s at 100 Hz: the spindle starts, dwells, moves in air, cuts, changes its tool."""
    t_s = np.arange(1000) * 0.01
    return run_log(
        {
            "t_s": t_s,
            "x_ref_mm": np.interp(t_s, [0.0, 3.0, 8.0, 10.0], [0.0, 0.0, 50.0, 50.0]),
            "spindle_rpm": np.interp(t_s, [0.0, 1.0], [0.0, 3000.0]),
            "axial_depth_mm": np.where((t_s > 5.0) & (t_s < 7.0), 2.0, 0.0),
            "tool_change_active": (t_s > 9.0).astype(float),
        }
    )


@pytest.mark.parametrize("signal", ["x_pos_mm", "x_torque_a", "force_x_n", "spindle_load_pct", "spindle_temp_c", "y_pos_mm"])
def test_every_sample_has_one_label_that_has_a_name(signal: str) -> None:
    for log in (strokes(), process()):
        names, label = regime_labels(log, signal, MACHINE)
        assert label.shape == (len(log),)
        assert label.dtype == np.int8
        assert label.min() >= 0
        assert label.max() < len(names)
        assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("at_s", "regime"),
    [(0.5, "spindle ramp"), (2.0, "dwell"), (4.0, "air"), (6.0, "cutting"), (8.5, "dwell"), (9.5, "tool change")],
)
def test_force_and_load_know_cutting_air_dwell_ramp_and_tool_change(at_s: float, regime: str) -> None:
    assert named(process(), "force_x_n", at_s) == regime
    assert named(process(), "spindle_load_pct", at_s) == regime


def test_an_axis_at_rapid_is_at_rapid_where_the_machine_states_one() -> None:
    log = strokes((6000.0, 3000.0))
    assert named(log, "x_torque_a", 0.7) == "rapid"
    names, label = regime_labels(log, "x_torque_a", MACHINE.model_copy(update={"program": None}))
    assert names[label[700]] == "constant speed +"
    assert named(log, "x_torque_a", 0.4) == "rest"
    assert named(process(), "x_torque_a", 9.5) == "tool change"


def test_heat_knows_whether_the_spindle_turns() -> None:
    log = run_log({"t_s": np.arange(100.0), "spindle_rpm": np.where(np.arange(100) < 50, 8000.0, 0.0)})
    assert (named(log, "spindle_temp_c", 10.0), named(log, "spindle_temp_c", 80.0)) == ("warm-up", "cool-down")


def test_a_gap_in_the_reference_is_no_motion() -> None:
    log = strokes()
    reference = log["x_ref_mm"].copy()
    reference[100:120] = np.nan
    names, label = regime_labels(run_log({"t_s": log.t_s, "x_ref_mm": reference}), "x_pos_mm", MACHINE)
    assert {names[i] for i in label[90:130]} == {"rest"}
