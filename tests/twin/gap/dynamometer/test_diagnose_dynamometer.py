"""Cuts that a dynamometer alone recorded, diagnosed: what is certain is named in spite of what is left."""

from dataclasses import replace

import pytest

from tests.twin.gap.dynamometer.dynamometer_case import dynamometer_case
from tests.twin.gap.dynamometer.milled import Bench, Cutter
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis, Verdict

EDGED = {"edge_n_per_mm": 15.0, "edge_radial_n_per_mm": 20.0}
ROUGH = Bench(resonance_hz=1000.0, damping=0.03, noise_n=6.0, vibration_n=25.0, drift_n_per_s=6.0)


def found(cutter: Cutter, bench: Bench | None = None, *, with_angle: bool = False) -> Diagnosis:
    return diagnose(dynamometer_case(cutter, bench, with_angle=with_angle)).diagnosis


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


def test_drift_alone_is_no_cause() -> None:
    diagnosis = found(Cutter(), replace(Bench(), drift_n_per_s=25.0))
    assert diagnosis.causes == (), diagnosis.sentence
