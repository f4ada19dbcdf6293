"""Cuts that a dynamometer alone recorded, diagnosed: what is certain is named in spite of what is left."""

from dataclasses import replace

import numpy as np
import pytest

from tests.twin.gap.dynamometer.dynamometer_case import dynamometer_case
from tests.twin.gap.dynamometer.milled import Bench, Cutter
from twin.case import RunAtHand
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis, Verdict
from twin.runlog import run_log

EDGED = {"edge_n_per_mm": 15.0, "edge_radial_n_per_mm": 20.0}
ROUGH = Bench(resonance_hz=1000.0, damping=0.03, noise_n=6.0, vibration_n=25.0, drift_n_per_s=6.0)


def found(cutter: Cutter, bench: Bench | None = None, *, with_angle: bool = False, air_s: float = 0.4) -> Diagnosis:
    return diagnose(dynamometer_case(cutter, bench, with_angle=with_angle, air_s=air_s)).diagnosis


def names(diagnosis: Diagnosis) -> set[str]:
    return {cause.effect for cause in diagnosis.causes}


@pytest.mark.parametrize("with_angle", [False, True])
def test_a_sharp_tool_that_runs_true_is_healthy(with_angle: bool) -> None:
    diagnosis = found(Cutter(), with_angle=with_angle)
    assert diagnosis.verdict is Verdict.HEALTHY, diagnosis.sentence


@pytest.mark.parametrize("with_angle", [False, True])
def test_runout_and_edge_force_are_both_named(with_angle: bool) -> None:
    diagnosis = found(Cutter(runout_mm=0.01, **EDGED), with_angle=with_angle)
    assert names(diagnosis) == {"runout", "edge_force"}, diagnosis.sentence
    of = {cause.effect: cause.parameters for cause in diagnosis.causes}
    assert of["runout"]["eccentricity_mm"].value == pytest.approx(0.01, rel=0.1)
    assert of["edge_force"]["radial_n_per_mm"].value == pytest.approx(20.0, rel=0.15)


@pytest.mark.parametrize(
    ("cutter", "named"),
    [
        (Cutter(runout_mm=0.012), "runout"),
        (Cutter(**EDGED), "edge_force"),
        (Cutter(thinning=0.25), "size_effect"),
    ],
    ids=["runout", "edge force", "size effect"],
)
def test_one_alone_is_named_alone(cutter: Cutter, named: str) -> None:
    diagnosis = found(cutter)
    assert names(diagnosis) == {named}, diagnosis.sentence


def test_both_are_named_on_a_rough_bench() -> None:
    diagnosis = found(Cutter(runout_mm=0.01, helix_deg=30.0, **EDGED), ROUGH)
    assert names(diagnosis) >= {"runout", "edge_force"}, diagnosis.sentence


def test_an_edge_is_certain_beside_a_chipped_tooth_that_is_in_no_catalogue() -> None:
    diagnosis = found(Cutter(chipped_mm=0.02, **EDGED))
    assert diagnosis.verdict is Verdict.PARTLY, diagnosis.sentence
    assert names(diagnosis) == {"edge_force"}, diagnosis.sentence


def test_a_chipped_tooth_alone_has_no_name() -> None:
    diagnosis = found(Cutter(chipped_mm=0.02))
    assert (diagnosis.verdict, diagnosis.causes) == (Verdict.UNKNOWN, ()), diagnosis.sentence


def test_without_air_an_edge_is_told_by_what_changes_within_a_turn() -> None:
    diagnosis = found(Cutter(runout_mm=0.01, **EDGED), air_s=0.0)
    assert names(diagnosis) == {"runout", "edge_force"}, diagnosis.sentence


def test_a_recording_at_the_servo_period_with_references_is_one_too() -> None:
    case = dynamometer_case(Cutter(runout_mm=0.01, **EDGED), replace(ROUGH, rate_hz=1000.0, resonance_hz=0.0), with_angle=True)
    runs = []
    for run in case.runs:
        way = np.concatenate([[0.0], np.cumsum(run.log["feed_mm_min"][1:] / 60.0 * np.diff(run.log.t_s))])
        columns = {name: values for name, values in run.log.columns.items() if name != "feed_mm_min"}
        columns |= {"t_s": run.log.t_s, "x_ref_mm": way, "y_ref_mm": np.zeros_like(way)}
        runs.append(RunAtHand(run.entry, run.folder, run_log(columns)))
    diagnosis = diagnose(replace(case, runs=tuple(runs))).diagnosis
    assert names(diagnosis) == {"runout", "edge_force"}, diagnosis.sentence


def test_drift_alone_is_no_cause() -> None:
    diagnosis = found(Cutter(), replace(Bench(), drift_n_per_s=25.0))
    assert diagnosis.causes == (), diagnosis.sentence


@pytest.mark.parametrize("filtered", [Bench(resonance_hz=300.0, damping=0.71), Bench(resonance_hz=400.0, damping=1.0)])
def test_a_filter_near_the_tooth_passing_is_no_helix(filtered: Bench) -> None:
    diagnosis = found(Cutter(), filtered, with_angle=True)
    assert names(diagnosis) == set(), diagnosis.sentence
    assert any("helix is not named: a low pass of both forces" in note for note in diagnosis.notes) or (
        diagnosis.verdict is Verdict.HEALTHY
    )
