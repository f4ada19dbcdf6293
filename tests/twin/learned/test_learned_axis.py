"""Learned terms of a machine in its simulation: laws that hold whatever the table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.twin.learned.small_axis import FORTH_AND_BACK, MACHINE, columns, learned, same
from twin.errors import EffectError
from twin.learned.section import LearnedSection
from twin.learned.sites import AXIS_SITES, READINGS
from twin.learned.standing import moved_by, on_axes
from twin.machine import AddedEffect


@pytest.mark.parametrize("site", [*AXIS_SITES, *READINGS])
def test_a_table_of_zeros_changes_nothing(site: str) -> None:
    same(columns(learned(site, "position_mm", [0.0, 5.0, 20.0], [0.0, 0.0, 0.0])), columns())
    same(
        columns(learned(site, "torque_a", [0.0, 5.0], [0.0, 0.0]), learned(site, "velocity_mm_s", [0.0, 5.0], [0.0, 0.0])),
        columns(),
    )


@settings(max_examples=5, deadline=None)
@given(
    force_n=st.floats(-900.0, 900.0).map(lambda v: round(v, 3)),
    column=st.sampled_from(["position_mm", "velocity_mm_s", "torque_a", "time_since_start_s"]),
)
def test_a_constant_force_is_gravity_of_the_other_sign(force_n: float, column: str) -> None:
    term = learned("axis_force", column, [0.0, 10.0], [force_n, force_n])
    same(columns(term), columns(effects=(AddedEffect(effect="gravity", on="x", parameters={"force_n": -force_n}),)), 1e-9)


@settings(max_examples=5, deadline=None)
@given(more_n=st.floats(-200.0, 400.0).map(lambda v: round(v, 3)))
def test_a_constant_friction_is_coulomb_friction_raised_by_it(more_n: float) -> None:
    axis = MACHINE.axes["x"]
    friction = axis.friction.model_copy(update={"coulomb_n": 300.0 + more_n, "static_n": 300.0 + more_n})
    raised = MACHINE.model_copy(update={"axes": {"x": axis.model_copy(update={"friction": friction})}})
    same(columns(learned("friction", "position_mm", [3.0], [more_n])), columns(machine=raised), 1e-9)


@settings(max_examples=5, deadline=None)
@given(
    one=st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3),
    other=st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3),
    site=st.sampled_from(["axis_force", "friction"]),
)
def test_two_terms_are_their_sum(one: list[float], other: list[float], site: str) -> None:
    at = [-100.0, 0.0, 100.0]
    alike = learned(site, "velocity_mm_s", at, one)
    twice = {name: [v for v in values for _ in (0, 1)] for name, values in (("velocity_mm_s", at), ("value", other))}
    over_two = LearnedSection.model_validate({"site": site, "on": "x", "table": twice | {"direction": [-1.0, 1.0] * 3}})
    both = learned(site, "velocity_mm_s", at, [a + b for a, b in zip(one, other, strict=True)])
    same(columns(alike, over_two), columns(both), 1e-9)


def test_a_reading_is_off_by_its_term_and_the_machine_is_as_it_was() -> None:
    shown, bare = columns(learned("position_reading", "direction", [-1.0, 1.0], [-0.002, 0.002])), columns()
    speed = np.gradient(FORTH_AND_BACK)
    moving = np.abs(speed) > 1e-9
    np.testing.assert_allclose((shown["x_pos_mm"] - bare["x_pos_mm"])[moving], 0.002 * np.sign(speed[moving]), atol=1e-12)
    same(columns(learned("position_reading", "direction", [-1.0, 1.0], [-0.002, 0.002], on="x_pos_mm")), shown)
    assert (shown["x_torque_a"] == bare["x_torque_a"]).all()


def test_a_term_over_the_time_of_recordings_is_no_part_of_another_run() -> None:
    table = {"t_s": [0.0, 0.1], "run": ["runs/a.csv", "runs/a.csv"], "value": [0.0, 50.0]}
    same(columns(LearnedSection.model_validate({"site": "axis_force", "on": "x", "table": table})), columns())


@pytest.mark.parametrize(
    ("terms", "complaint"),
    [
        (
            [learned("axis_force", "temperature_c", [0.0], [1.0])],
            "axis_force on x needs temperature_c, which this run does not have",
        ),
        ([learned("axis_force", "position_mm", [0.0], [1.0], on="w")], "axis_force is put on 'w'; it can be on x"),
        ([learned("heat_loss", "coolant_on", [0.0, 1.0], [0.0, 1.0])], "heat_loss is put on 'x'; it can be on nothing"),
        ([learned("friction", "position_mm", [0.0], [1.0])] * 2, "friction on x over position_mm is there twice"),
    ],
)
def test_a_term_that_does_not_fit_the_machine_is_refused(terms: list[LearnedSection], complaint: str) -> None:
    with pytest.raises(EffectError, match=complaint):
        columns(*terms)


def test_two_terms_on_one_place_over_different_things_stand_side_by_side() -> None:
    table = {"position_mm": [0.0, 5.0], "velocity_mm_s": [0.0, 1.0]}
    terms = [learned("axis_force", column, at, [0.0, 40.0]) for column, at in table.items()]
    assert np.abs(columns(*terms)["x_torque_a"] - columns(terms[0])["x_torque_a"]).max() > 0.01


def test_a_machine_with_fewer_axes_keeps_the_terms_that_it_can_have() -> None:
    on_x, on_y = (learned("friction", "position_mm", [0.0], [1.0], on) for on in "xy")
    coupled = learned("axis_force", "y_acceleration_mm_s2", [0.0], [1.0])
    warm = learned("friction", "temperature_c", [20.0], [1.0])
    spindle = learned("spindle_power", "spindle_rpm", [0.0], [1.0], on="")
    every = (on_x, on_y, coupled, warm, spindle)
    assert on_axes(every, ["x"]) == (on_x, coupled, warm, spindle)
    assert moved_by(every, ["x"]) == (on_x, spindle)
