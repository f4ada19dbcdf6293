"""An axis whose controller is not the twin's: its mechanics and its table are named all the same, its controller is not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.twin.gap.one_line import OneLine
from tests.twin.gap.robot_case import ASYMMETRY, MOVING_KG, STIFFNESS_N_PER_MM, Joint, robot_case
from tests.twin.gap.small_case import air_case
from twin.gap.diagnose import diagnose
from twin.gap.diagnosis import Diagnosis, Effected, Verdict
from twin.gap.fitting import fitted
from twin.gap.parts.opened import Opened
from twin.gap.search import Explained
from twin.gap.stages.stage import Model
from twin.gap.verdict import Judged
from twin.machine import AddedEffect


@pytest.fixture(scope="module", params=[True, False], ids=["with a reference", "without a reference"])
def robot(request: pytest.FixtureRequest) -> Diagnosis:
    return diagnose(robot_case(with_reference=request.param)).diagnosis


def test_what_its_mechanics_and_its_table_show_is_named_and_nothing_else(robot: Diagnosis) -> None:
    assert {(cause.effect, cause.on) for cause in robot.causes} == {("direction_friction", "b"), ("screw_compliance", "b")}
    by_name = {cause.effect: cause for cause in robot.causes}
    assert by_name["direction_friction"].parameters["asymmetry"].value == pytest.approx(ASYMMETRY, rel=0.02)
    stiffness = by_name["screw_compliance"].parameters["stiffness_n_per_mm"].value
    assert stiffness == pytest.approx(STIFFNESS_N_PER_MM, rel=0.01)


def test_its_controller_is_said_to_be_another_one_and_the_gap_is_not_that_of_a_loop_that_nobody_believes(
    robot: Diagnosis,
) -> None:
    parts = {part.subsystem: part for part in robot.subsystems}
    assert robot.verdict is Verdict.PARTLY
    assert robot.gap.before < 150.0
    assert robot.gap.after < 0.1 * robot.gap.before
    assert {"b_torque_a", "b_table_mm"} == set(robot.gap.by_signal)
    assert any("compared alone" in note for note in robot.notes)
    if "b controller" in parts:
        assert parts["b controller"].verdict is Verdict.UNKNOWN
        assert parts["b controller"].causes == ()
    assert parts["b mechanics"].causes[0] == "direction_friction"


@pytest.fixture(scope="module")
def with_friction_on_the_motor() -> Diagnosis:
    return diagnose(robot_case(with_reference=False, joint=Joint(on_motor=0.9))).diagnosis


def test_a_joint_whose_friction_is_on_the_motor_is_found_to_give_and_where_its_friction_is(
    with_friction_on_the_motor: Diagnosis,
) -> None:
    found = {cause.effect: cause for cause in with_friction_on_the_motor.causes}
    assert set(found) == {"direction_friction", "screw_compliance"}
    joint, behind = found["screw_compliance"].parameters, 1.0 - Joint().motor_kg / MOVING_KG
    assert joint["stiffness_n_per_mm"].value == pytest.approx(STIFFNESS_N_PER_MM / behind, rel=0.05)
    assert joint["before"].value == pytest.approx(1.0 - 0.1 / behind, abs=0.03)
    table = next(part for part in with_friction_on_the_motor.subsystems if part.subsystem == "b table")
    assert table.before > 3.0 > 1.3 > table.after


RIPPLE, FORWARD = Effected("torque_ripple", "z"), Effected("velocity_feedforward", "z")


def part(verdict: Verdict, *effects: Effected) -> Judged:
    """Return what was found in a part of an axis."""
    stage = OneLine()
    base = fitted(stage, Model(stage.constants, ()), np.zeros(1))
    best = replace(base, model=Model(stage.constants, effects))
    return Judged(Explained(stage, base, best, (), {}, {}), verdict, ())


@pytest.mark.parametrize(
    ("closed", "controller", "mechanics", "decides"),
    [
        (part(Verdict.HEALTHY), part(Verdict.HEALTHY), part(Verdict.HEALTHY), False),
        (part(Verdict.HEALTHY), part(Verdict.HEALTHY), part(Verdict.UNKNOWN), True),
        (part(Verdict.EXPLAINED, FORWARD), part(Verdict.UNKNOWN), part(Verdict.EXPLAINED, RIPPLE), False),
        (part(Verdict.PARTLY, FORWARD), part(Verdict.PARTLY, FORWARD), part(Verdict.EXPLAINED, RIPPLE), True),
        (part(Verdict.PARTLY, FORWARD, RIPPLE), part(Verdict.PARTLY, FORWARD), part(Verdict.EXPLAINED, RIPPLE), False),
        (part(Verdict.UNKNOWN), part(Verdict.EXPLAINED, FORWARD), part(Verdict.UNKNOWN), True),
        (part(Verdict.UNKNOWN), part(Verdict.UNKNOWN), part(Verdict.UNKNOWN), True),
        (part(Verdict.UNKNOWN), part(Verdict.HEALTHY), part(Verdict.UNKNOWN), False),
    ],
    ids=[
        "all as told", "the control hides it", "the closed loop is explained", "the mechanics tell more",
        "the mechanics tell the same", "the controller is understood", "nothing is understood", "the controller is as told",
    ],
)  # fmt: skip
def test_the_open_loops_decide_where_they_tell_more(closed: Judged, controller: Judged, mechanics: Judged, decides: bool) -> None:
    assert Opened("z", closed, {"controller": controller, "mechanics": mechanics}).decides is decides


def test_a_controller_keeps_the_names_that_the_closed_loop_confirms() -> None:
    mechanics, controller = part(Verdict.EXPLAINED, RIPPLE), part(Verdict.PARTLY, FORWARD)
    confirmed = Opened("z", part(Verdict.PARTLY, FORWARD), {"controller": controller, "mechanics": mechanics})
    other = Opened("z", part(Verdict.UNKNOWN), {"controller": controller, "mechanics": mechanics})
    assert confirmed.judged == (controller, mechanics)
    assert [loop.explained.best.effects for loop in other.judged] == [(), (RIPPLE,)]


def test_what_the_mechanics_show_is_named_beside_another_controller() -> None:
    late = AddedEffect(effect="reference_filter", on="z", parameters={"time_constant_s": 0.004})
    ripple = AddedEffect(effect="torque_ripple", on="z", parameters={"amplitude_a": 0.3, "order": 4.0, "phase_rad": 1.0})
    found = diagnose(air_case(late, ripple)).diagnosis
    assert found.verdict is Verdict.EXPLAINED
    assert {cause.effect for cause in found.causes} == {"reference_filter", "torque_ripple"}
