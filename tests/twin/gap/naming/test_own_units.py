"""A diagnosis speaks of a rotary axis in degrees and N m, from its files to its answer."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.twin.rotary_axis import STATED, rotary_case
from twin.errors import CaseError
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosed, Learned, MovedConstant, Verdict
from twin.gap.inspection import inspected
from twin.gap.naming.own_units import in_own_units
from twin.gap.score_of import score_of
from twin.machine import machine_from_toml
from twin.machine_toml import machine_to_toml

LOAD = '[[effects]]\neffect = "gravity"\non = "b"\nparameters = { torque_nm = 6.0 }\n'


@cache
def loaded() -> Diagnosed:
    return diagnose(rotary_case(LOAD))


def test_a_load_on_a_rotary_axis_is_named_and_told_in_n_m() -> None:
    answer = loaded().diagnosis
    assert answer.verdict is Verdict.EXPLAINED
    (cause,) = answer.causes
    assert (cause.effect, cause.on) == ("gravity", "b")
    found = cause.parameters["torque_nm"]
    assert found.unit == "N m"
    assert found.low < 6.0 < found.high
    assert f"{found.value:.3g} ± " in answer.sentence
    assert "N m" in answer.sentence


def test_nothing_in_the_answer_is_in_mm() -> None:
    text = loaded().diagnosis.to_json()
    for unit in ("_mm", " mm", "µm", " N ", '"N"'):
        assert unit not in text.replace(" N m", "")
    assert set(json.loads(text)["gap"]["by_signal"]) == {"b_pos_deg", "b_table_deg", "b_torque_a"}
    assert {trace.unit for trace in loaded().traces} == {"deg", "A"}


def test_the_twin_that_comes_out_explains_the_runs() -> None:
    text = machine_to_toml(loaded().twin)
    assert "torque_nm" in text
    assert '"effects.gravity.b.torque_nm"' in text
    score = score_of(machine_from_toml(text), rotary_case(LOAD))
    assert score.gap < 1.5
    assert score.by_signal["b_pos_deg"].unit == "deg"


def test_a_healthy_rotary_axis_is_healthy() -> None:
    assert diagnose(rotary_case()).diagnosis.verdict is Verdict.HEALTHY


def test_the_joint_of_a_robot_is_an_axis_though_no_program_has_a_word_for_it() -> None:
    answer = diagnose(rotary_case(LOAD, name="j1", every=4)).diagnosis
    assert [(cause.effect, cause.on) for cause in answer.causes] == [("gravity", "j1")]
    found = answer.causes[0].parameters["torque_nm"]
    assert found.low < 6.0 < found.high


def test_an_axis_of_another_kind_than_stated_is_not_compared() -> None:
    linear = STATED.replace("inertia_kg_m2", "mass_kg").replace("torque_per_command_nm", "force_per_command_n")
    linear = linear.replace("_per_deg", "_per_mm").replace("_nm_s_", "_n_s_").replace("_nm =", "_n =").replace("_deg_s", "_mm_s")
    with pytest.raises(CaseError, match=r"b is recorded in degrees, and axes\.b is a linear axis"):
        inspected(rotary_case(stated=linear))


def test_what_is_learned_and_what_moved_is_told_in_the_units_of_the_axis() -> None:
    table = {"position_mm": (0.0, 10.0), "value": (17.45, 34.9), "low": (0.0, 0.0), "high": (40.0, 40.0)}
    learned = Learned("axis_force", "b", "N", ("position",), True, 0.8, 0.7, 0.9, table, (), "a force on B of +34.9 N at 10 mm")
    moved = MovedConstant("axes.b.mass_kg", 761.54, 776.77, 2.0, 0.4)
    whole = loaded()
    answer = Diagnosed(
        replace(whole.diagnosis, learned=(learned,), constants=(moved,)),
        whole.twin,
    )
    told = in_own_units(answer, whole.twin).diagnosis
    assert told.learned[0].unit == "N m"
    assert told.learned[0].table["position_deg"] == (0.0, 10.0)
    assert np.allclose(told.learned[0].table["value"], (1.0, 2.0), rtol=1e-3)  # type: ignore[arg-type]
    assert told.learned[0].sentence == "a force on B of +2 N m at 10 deg"
    assert told.constants[0].name == "axes.b.inertia_kg_m2"
    assert told.constants[0].found == pytest.approx(2.55, rel=1e-3)
