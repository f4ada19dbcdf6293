"""What a twin shows beside a recorded run."""

import numpy as np
import pytest

from tests.twin.gap.small_case import MACHINE, air_case, case_of, columns_of, plant, warm_case
from twin.errors import EffectError
from twin.gap.inspection import inspected
from twin.gap.stages.plan import ground_of
from twin.gap.stages.shown import shown
from twin.learned.section import LearnedSection
from twin.machine import AddedEffect

BIAS = AddedEffect(effect="sensor_bias", on="z_torque_a", parameters={"bias": 1.5})


def test_the_machine_that_made_a_run_shows_it() -> None:
    case = air_case()
    ground = ground_of(case, frozenset())
    run = case.runs[2]
    found = shown(plant(), run, ground.floors)
    for signal, values in found.items():
        over = (values - run.log[signal]) / ground.floors.of(run.log, signal)
        assert np.sqrt(np.nanmean(over**2)) < 1.5, signal


def test_an_effect_in_the_machine_shows_once() -> None:
    case = air_case()
    run, floors = case.runs[0], ground_of(case, frozenset()).floors
    bare, biased = (shown(m, run, floors)["z_torque_a"] for m in (plant(), plant((BIAS,))))
    moved = np.isfinite(bare)
    assert np.median(biased[moved] - bare[moved]) == pytest.approx(1.5, abs=0.05)


def test_where_nothing_moves_nothing_is_compared() -> None:
    columns = columns_of(air_case())
    for own in columns.values():
        for name in ("z_ref_mm", "z_pos_mm", "z_table_mm"):
            own[name] = np.full(len(own["t_s"]), own[name][0])
    case = case_of(MACHINE, columns)
    assert shown(MACHINE, case.runs[0], ground_of(case, frozenset()).floors) == {}


@pytest.mark.parametrize("column", ["z_pos_mm", "z_torque_a", "z_table_mm"])
def test_samples_that_are_missing_where_a_motion_starts_hide_no_motion(column: str) -> None:
    columns = columns_of(air_case())
    for own in columns.values():
        own[column][:110] = np.nan
    case, _ = inspected(case_of(MACHINE, columns))
    found = shown(plant(), case.runs[0], ground_of(case, frozenset()).floors)
    assert np.isfinite(found["z_pos_mm"]).mean() > 0.5


def test_an_effect_that_there_is_not_is_one_line() -> None:
    case = air_case()
    wrong = MACHINE.model_copy(update={"effects": (AddedEffect(effect="gremlins", on="z"),)})
    with pytest.raises(EffectError, match="gremlins"):
        shown(wrong, case.runs[0], ground_of(case, frozenset()).floors)


def test_the_heat_of_a_warm_up_is_shown() -> None:
    case = warm_case()
    found = shown(case.machine, case.runs[0], ground_of(case, frozenset()).floors)
    assert list(found) == ["spindle_temp_c"]
    assert np.isfinite(found["spindle_temp_c"]).all()


TABLES = {
    "friction": {"direction": (-1.0, 1.0), "value": (40.0, 40.0)},
    "axis_force": {"position_mm": (0.0, 45.0), "value": (0.0, 250.0)},
}


@pytest.mark.parametrize("site", TABLES)
def test_a_learned_term_closes_the_gap_of_a_machine_that_has_it(site: str) -> None:
    learned = (LearnedSection.model_validate({"site": site, "on": "z", "table": TABLES[site]}),)
    real, case = plant().model_copy(update={"learned": learned}), air_case(learned=learned)
    run, floors = case.runs[2], ground_of(case, frozenset()).floors
    left = {}
    for name, machine in (("with", real), ("without", plant())):
        found = shown(machine, run, floors)
        left[name] = {s: np.sqrt(np.nanmean(((v - run.log[s]) / floors.of(run.log, s)) ** 2)) for s, v in found.items()}
    assert max(left["with"].values()) < 1.5
    assert left["without"]["z_torque_a"] > 3.0


def test_a_learned_reading_is_shown_once() -> None:
    case = air_case()
    run, floors = case.runs[0], ground_of(case, frozenset()).floors
    term = LearnedSection.model_validate(
        {"site": "torque_reading", "on": "z_torque_a", "table": {"direction": (-1.0, 1.0), "value": (1.5, 1.5)}}
    )
    bare, biased = (shown(m, run, floors)["z_torque_a"] for m in (plant(), plant().model_copy(update={"learned": (term,)})))
    moved = np.isfinite(bare)
    assert np.median(biased[moved] - bare[moved]) == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize(
    ("site", "table", "effect"),
    [
        ("torque_reading", {"velocity_mm_s": (0.0,), "value": (1.5,)}, BIAS),
        (
            "axis_force",
            {"position_mm": (0.0,), "value": (310.0,)},
            AddedEffect(effect="gravity", on="z", parameters={"force_n": -310.0}),
        ),
    ],
)
@pytest.mark.parametrize("blind", [(), ("z_torque_a",)])
def test_a_constant_term_is_shown_as_the_effect_that_it_amounts_to(
    site: str, table: dict[str, tuple[float, ...]], effect: AddedEffect, blind: tuple[str, ...]
) -> None:
    columns = columns_of(air_case())
    case = case_of(MACHINE, {run: {n: v for n, v in own.items() if n not in blind} for run, own in columns.items()})
    run, floors = case.runs[0], ground_of(case, frozenset()).floors
    term = LearnedSection.model_validate({"site": site, "on": "z", "table": table})
    found, other = (shown(m, run, floors) for m in (plant().model_copy(update={"learned": (term,)}), plant((effect,))))
    for signal, values in other.items():
        np.testing.assert_allclose(found[signal], values, atol=1e-9, err_msg=signal)
