"""The gap of any twin on recorded runs, and the interval of its closure."""

import numpy as np
import pytest

from tests.twin.gap.small_case import MACHINE, air_case, case_of, columns_of
from twin.errors import CaseError
from twin.gap.floors import Floors
from twin.gap.score import Squares, gap_of, squares_of
from twin.gap.score_of import score_of
from twin.gap.units import unit_of
from twin.machine import AddedEffect

GRAVITY = AddedEffect(effect="gravity", on="z", parameters={"force_n": 400.0})


def test_each_sample_counts_by_its_own_floor() -> None:
    found = Squares(ratio=np.array([4.0, 16.0]), weight=np.array([1.0, 4.0]), count=np.array([1.0, 1.0]))
    assert found.over_floor() == pytest.approx(np.sqrt(10.0))  # errors of 2 on a floor of 1, and of 2 on one of a half
    assert found.floor() == pytest.approx(np.sqrt(2.0 / 5.0))
    assert found.rms() == pytest.approx(2.0)


def test_the_gap_of_all_signals_counts_each_alike() -> None:
    one, other = (Squares(np.array([n * r**2]), np.array([n]), np.array([n])) for n, r in ((1000.0, 3.0), (10.0, 1.0)))
    assert gap_of({"x_pos_mm": one, "x_torque_a": other}) == pytest.approx(np.sqrt(5.0))
    assert gap_of({}) == 0.0


def test_a_sample_that_is_not_there_does_not_count() -> None:
    columns = columns_of(air_case())
    columns["check"]["z_pos_mm"][100:2000] = np.nan
    (run,) = (r for r in case_of(MACHINE, columns).runs if r.name == "check")
    away = {"check": {"z_pos_mm": run.log["z_ref_mm"]}}
    squares = squares_of([run], away, Floors(MACHINE, {}))
    assert squares["z_pos_mm"].count.sum() == len(run.log) - 1900


def test_the_machine_that_was_recorded_scores_better_than_the_one_without_its_effect() -> None:
    case = air_case(GRAVITY)
    without, with_it = (score_of(m, case) for m in (MACHINE, MACHINE.model_copy(update={"effects": (GRAVITY,)})))
    assert without.gap > 5.0 * with_it.gap
    assert set(with_it.by_signal) == {"z_pos_mm", "z_table_mm", "z_torque_a"}
    assert with_it.by_signal["z_torque_a"].unit == "A"
    ratios = [s.rms / s.floor for s in with_it.by_signal.values()]
    assert with_it.gap == pytest.approx(np.sqrt(np.mean(np.square(ratios))))


def test_runs_to_be_judged_on_alone_can_be_scored() -> None:
    columns = columns_of(air_case())
    assert score_of(MACHINE, case_of(MACHINE, {"check": columns["check"]})).gap > 0.0


def test_a_case_without_a_signal_says_so() -> None:
    columns = {name: {"t_s": c["t_s"], "z_ref_mm": c["z_ref_mm"]} for name, c in columns_of(air_case()).items()}
    with pytest.raises(CaseError, match="there are z_ref_mm"):
        score_of(MACHINE, case_of(MACHINE, columns))


def test_units_are_in_the_names() -> None:
    assert [unit_of(s) for s in ("x_pos_mm", "x_torque_a", "force_x_n", "spindle_load_pct", "spindle_temp_c")] == [
        *("mm", "A", "N", "%", "°C")
    ]
