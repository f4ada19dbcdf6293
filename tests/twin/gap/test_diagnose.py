"""The diagnosis of a case: small ones of one axis or of the spindle's heat, and a few of the recorded ones."""

import json
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.recordings import recordings_folder
from tests.twin.gap.small_case import MACHINE, air_case, case_of, columns_of, warm_case
from twin.case import Case, read_case
from twin.effects.catalogue import catalogue
from twin.errors import TwinError
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosed, Verdict, closure_of
from twin.gap.experiment.run import with_constant
from twin.gap.score_of import score_of
from twin.machine import AddedEffect, machine_from_toml
from twin.machine_toml import machine_to_toml
from twin.runlog import RunLog

GRAVITY = AddedEffect(effect="gravity", on="z", parameters={"force_n": 400.0})
SECOND = AddedEffect(effect="second_thermal_mass", parameters={"conductance_w_per_k": 4.0, "capacity_j_per_k": 4e4})
KEYS = {"verdict", "where", "causes", "gap", "candidates", "not_observable", "next_experiment", "seconds"}


@cache
def heavy() -> Diagnosed:
    """Of an axis that hangs on its motor."""
    return diagnose(air_case(GRAVITY))


@cache
def warm() -> Diagnosed:
    """Of a spindle whose heat flows on into the column."""
    return diagnose(warm_case(SECOND))


def test_an_axis_that_hangs_on_its_motor_is_explained_by_gravity() -> None:
    found = heavy().diagnosis
    assert found.verdict is Verdict.EXPLAINED
    (cause,) = found.causes
    assert (cause.effect, cause.on) == ("gravity", "z")
    force = cause.parameters["force_n"]
    assert force.low < 400.0 < force.high
    assert force.unit == "N"
    assert found.gap.after < 1.3 < found.gap.before
    assert found.where[0].signal == "z_torque_a"
    assert "gravity on Z" in found.sentence


def test_a_healthy_machine_is_healthy_though_its_constants_are_a_little_off() -> None:
    found = diagnose(air_case()).diagnosis
    assert found.verdict is Verdict.HEALTHY
    assert found.causes == ()
    assert found.gap.as_stated > found.gap.before


@pytest.mark.parametrize("of", [heavy, warm])
def test_the_json_has_the_keys_of_the_format_and_nothing_that_is_no_json(of: Callable[[], Diagnosed]) -> None:
    found = json.loads(of().diagnosis.to_json())
    assert set(found) >= KEYS
    assert found["verdict"] in {"healthy", "explained", "partly_explained", "unknown"}
    assert set(found["where"][0]) >= {"signal", "regime", "share", "effect_size", "significance", "sentence"}
    assert set(found["causes"][0]) >= {"effect", "on", "probability", "parameters", "indistinguishable_from", "closure"}
    assert all(set(p) == {"value", "low", "high", "unit"} for c in found["causes"] for p in c["parameters"].values())
    assert set(found["gap"]) >= {"before", "after", "floor", "closure", "closure_low", "closure_high", "by_signal"}
    assert all(set(s) == {"before", "after", "floor", "unit"} for s in found["gap"]["by_signal"].values())
    assert set(found["candidates"][0]) >= {"effect", "on", "closure", "p_value"}
    assert all(set(n) == {"effect", "why"} for n in found["not_observable"])


@pytest.mark.parametrize("of", [heavy, warm])
def test_shares_add_up_to_the_closure_which_is_the_formula(of: Callable[[], Diagnosed]) -> None:
    gap, causes = of().diagnosis.gap, of().diagnosis.causes
    assert gap.closure == pytest.approx(closure_of(gap.before, gap.after, gap.floor), abs=1e-6)
    assert sum(cause.closure for cause in causes) == pytest.approx(gap.closure, abs=2e-4)
    assert gap.closure_low <= gap.closure <= gap.closure_high


def test_shares_of_where_add_to_one_within_the_signals_of_a_group() -> None:
    assert sum(cell.share for cell in heavy().diagnosis.where) == pytest.approx(
        round(sum(c.share for c in heavy().diagnosis.where))
    )


@pytest.mark.parametrize("of", [heavy, warm])
def test_every_effect_was_tried_or_could_not_be_seen(of: Callable[[], Diagnosed]) -> None:
    found = of().diagnosis
    tried = {c.effect for c in found.candidates} | {e.effect for e in of().twin.effects}
    unseen = {n.effect for n in found.not_observable}
    assert tried | unseen == set(catalogue())
    assert not tried & unseen


@pytest.mark.parametrize(("of", "made"), [(heavy, lambda: air_case(GRAVITY)), (warm, lambda: warm_case(SECOND))])
def test_the_twin_that_comes_out_is_a_machine_file_that_explains_the_runs(
    of: Callable[[], Diagnosed], made: Callable[[], Case]
) -> None:
    twin = machine_from_toml(machine_to_toml(of().twin))
    assert twin == of().twin
    case = made()
    assert score_of(twin, case).gap < 0.3 * score_of(case.machine, case).gap
    assert diagnose(replace(case, machine=twin)).diagnosis.verdict is Verdict.HEALTHY


@pytest.mark.parametrize("of", [heavy, warm])
def test_the_twin_knows_how_well_its_causes_and_constants_are_known(of: Callable[[], Diagnosed]) -> None:
    twin, found = of().twin, of().diagnosis
    told = {path: value for path, value in twin.uncertainty.items() if path != "relative"}
    (cause,) = found.causes
    for name, interval in cause.parameters.items():
        path = ".".join(filter(None, ("effects", cause.effect, cause.on, name)))
        half = told.pop(path) * 1.645 * abs(interval.value)
        assert half == pytest.approx((interval.high - interval.low) / 2.0, rel=0.01)
    assert told
    for path, deviation in told.items():
        assert with_constant(twin, path, 1.1) != twin
        assert 0.0 < deviation < 0.05
        assert not any(path.removeprefix("axes.z.") in said for said in found.not_identifiable)


def test_asking_again_gives_the_same_answer_and_side_by_side_too() -> None:
    case = warm_case(SECOND)
    assert diagnose(case).diagnosis == warm().diagnosis

    def in_threads(explain: Callable[..., object], stages: Iterable[object]) -> Iterable[object]:
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(explain, stages))

    assert diagnose(case, side_by_side=in_threads).diagnosis == warm().diagnosis  # type: ignore[arg-type]


def test_an_effect_that_is_left_out_of_the_catalogue_is_not_named() -> None:
    found = diagnose(warm_case(SECOND), without=frozenset({"second_thermal_mass"})).diagnosis
    assert "second_thermal_mass" not in {c.effect for c in (*found.causes, *found.candidates)}
    assert "second_thermal_mass" not in {n.effect for n in found.not_observable}
    assert found.verdict in (Verdict.UNKNOWN, Verdict.PARTLY)


def test_a_torque_in_milliamperes_is_a_sensor_with_a_scale_of_a_thousand() -> None:
    columns = columns_of(air_case())
    for own in columns.values():
        own["z_torque_a"] = 1000.0 * own["z_torque_a"]
    found = diagnose(case_of(MACHINE, columns)).diagnosis
    assert [(c.effect, c.on) for c in found.causes] == [("sensor_scale", "z_torque_a")]
    assert found.causes[0].parameters["scale"].value == pytest.approx(1000.0, rel=0.05)


@pytest.mark.parametrize("missing", ["z_pos_mm", "z_table_mm", "z_torque_a"])
def test_a_healthy_axis_of_which_less_is_recorded_gets_no_name(missing: str) -> None:
    columns = columns_of(air_case())
    for own in columns.values():
        del own[missing]
    found = diagnose(case_of(MACHINE, columns)).diagnosis
    assert found.causes == ()
    if missing == "z_table_mm":
        assert "backlash" in {n.effect for n in found.not_observable}


def test_nothing_to_learn_from_is_one_line() -> None:
    columns = columns_of(warm_case())
    case = warm_case()
    with pytest.raises(TwinError, match="no run of role fit") as said:
        diagnose(case_of(case.machine, {"check": columns["check"]}, case.runs[0].entry.kind))
    assert len(str(said.value).splitlines()) == 1


def shared_case(name: str) -> Case:
    """A case beside the recordings; skips where it is not there."""
    folder = recordings_folder().parent / "cases" / name
    if not folder.is_dir():
        pytest.skip(f"no case {folder}")
    return read_case(folder)


def test_a_second_effect_of_a_sensor_stands_in_one_class_with_what_shows_the_same() -> None:
    late = AddedEffect(effect="sensor_lag", on="spindle_temp_c", parameters={"time_constant_s": 60.0})
    steep = AddedEffect(effect="sensor_scale", on="spindle_temp_c", parameters={"scale": 1.02})
    found = diagnose(warm_case(late, steep)).diagnosis
    classes = {c.effect: {c.effect, *(other.effect for other in c.indistinguishable_from)} for c in found.causes}
    assert "sensor_lag" in classes
    assert any({"sensor_scale", "sensor_bias"} <= one for one in classes.values())
    assert not any("sensor_lag" in one and "sensor_scale" in one for one in classes.values())


@pytest.mark.parametrize("name", ["case_13", "case_14", "case_15"])
def test_the_heat_of_an_independent_machine_is_named_right(name: str) -> None:
    case = shared_case(name)
    answers = json.loads((recordings_folder().parent / "cases" / "answers.json").read_text())
    (true,) = (effect["effect"] for effect in answers[name]["effects"])
    found = diagnose(case).diagnosis
    assert true in {c.effect for c in found.causes}
    assert found.gap.closure > 0.9


def test_a_real_axis_recorded_once_gets_an_answer_that_says_so() -> None:
    case = shared_case("emps")
    columns = {name: _until(run.log, 4.0) for name, run in zip(("fit", "check"), case.runs, strict=True)}
    found = diagnose(case_of(case.machine, columns)).diagnosis
    assert found.verdict in (Verdict.PARTLY, Verdict.UNKNOWN)
    assert found.gap.after <= found.gap.before
    assert any("no run was repeated" in note for note in found.notes)


def _until(log: RunLog, t_s: float) -> dict[str, NDArray[np.float64]]:
    kept = log.t_s - log.t_s[0] <= t_s
    return {"t_s": log.t_s[kept]} | {name: values[kept] for name, values in log.columns.items()}
