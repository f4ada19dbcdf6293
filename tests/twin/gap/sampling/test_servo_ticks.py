"""The same axis gets the same answer at any sample period."""

import numpy as np
import pytest

from tests.twin.gap.sampling.recorded_at import case_recorded_every
from tests.twin.gap.small_case import MACHINE, case_of, columns_of, plant
from twin.case import Case, RunKind
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Verdict
from twin.gap.inspection import inspected
from twin.gap.stages.open_loop.mechanics import Mechanics
from twin.gap.stages.plan import axis_stage, ground_of
from twin.gap.stages.stage import Model
from twin.machine import AddedEffect

ASYMMETRY = AddedEffect(effect="direction_friction", on="z", parameters={"asymmetry": 0.12})
PLAY = AddedEffect(effect="backlash", on="z", parameters={"play_mm": 0.012})


@pytest.mark.parametrize(
    ("sample_s", "jitter_s", "effect"),
    [
        (0.0005, 0.0, ASYMMETRY),
        (0.002, 0.0005, ASYMMETRY),
        (0.0033, 0.0, PLAY),
        (0.004, 0.0, PLAY),
        (0.012, 0.0, ASYMMETRY),
    ],
)
def test_an_effect_has_the_same_name_at_any_sample_period(sample_s: float, jitter_s: float, effect: AddedEffect) -> None:
    answer = diagnose(case_recorded_every(sample_s, effect, jitter_s=jitter_s)).diagnosis
    assert answer.verdict is Verdict.EXPLAINED
    (cause,) = answer.causes
    assert (cause.effect, cause.on) == (effect.effect, "z")
    for name, true in effect.parameters.items():
        found = cause.parameters[name]
        width = found.high - found.low
        assert found.low - width < true < found.high + width
        assert width < 0.15 * abs(true)


@pytest.mark.parametrize(("sample_s", "jitter_s"), [(0.0005, 0.0), (0.0012, 0.0), (0.0033, 0.001), (0.008, 0.0)])
def test_a_healthy_axis_is_healthy_at_any_sample_period(sample_s: float, jitter_s: float) -> None:
    assert diagnose(case_recorded_every(sample_s, jitter_s=jitter_s)).diagnosis.verdict is Verdict.HEALTHY


@pytest.mark.parametrize("first", [0, 400])
def test_a_recording_that_begins_in_motion_is_no_gap(first: int) -> None:
    case = case_recorded_every(0.001)
    cut = {}
    for name, columns in columns_of(case).items():
        begin = int(np.flatnonzero(np.diff(columns["z_ref_mm"]))[first])
        cut[name] = {column: values[begin:] for column, values in columns.items()}
    answer = diagnose(case_of(MACHINE, cut)).diagnosis
    assert answer.verdict is Verdict.HEALTHY, answer.sentence
    assert sum("begins while z moves" in note for note in answer.notes) == 1


def test_the_spindle_turns_on_between_slower_samples() -> None:
    t_s = np.arange(500) * 0.004
    turn = 2.0 * np.pi * 130.0 / 60.0 * 60.0  # 7800 rev/min: half a turn and more from sample to sample
    columns = {"t_s": t_s, "z_ref_mm": 5.0 * np.sin(t_s), "z_pos_mm": 5.0 * np.sin(t_s)}
    columns |= {"spindle_rpm": np.full(500, 7800.0), "spindle_angle_rad": np.mod(turn * t_s, 2.0 * np.pi)}
    columns["force_x_n"] = 100.0 + np.cos(turn * t_s)
    log = inspected(case_of(MACHINE, {"fit": columns, "check": columns}, RunKind.AIR))[0].runs[0].log
    away = np.angle(np.exp(1j * (log["spindle_angle_rad"] - turn * log.t_s)))
    assert np.abs(away).max() < 1e-6
    assert np.isfinite(log["force_x_n"]).sum() == 500


def test_what_was_measured_stays_where_only_the_reference_is_in_doubt() -> None:
    looked, notes = inspected(case_recorded_every(0.008))
    log = looked.runs[0].log
    doubt = log.columns["z_doubt"] > 0.0
    assert 0.05 < doubt.mean() < 0.5
    assert any("is not known well enough" in note for note in notes)
    assert np.isfinite(log["z_pos_mm"][doubt]).any()
    stage = axis_stage(ground_of(looked, frozenset()), "z", {})
    assert stage is not None
    data = stage.runs[0]
    assert np.isnan(data.of_loops(data.measured["pos_mm"])[doubt]).all()


@pytest.mark.parametrize("sample_s", [0.002, 0.0033, 0.008])
def test_an_open_loop_of_the_true_machine_leaves_as_little_at_any_sample_period(sample_s: float) -> None:
    left = []
    for every_s in (0.001, sample_s):
        case = case_recorded_every(every_s)
        looked, _ = inspected(Case(case.name, plant(), case.runs))
        stage = axis_stage(ground_of(looked, frozenset()), "z", {})
        assert stage is not None
        run, loop = stage.runs[-1], Mechanics()
        away = loop.answer(stage, Model((), ()), np.zeros((1, 0)), run)[0] - loop.recorded(run)
        left.append(float(np.sqrt(np.nanmean(away**2))))
    assert left[1] < 2.0 * left[0]
