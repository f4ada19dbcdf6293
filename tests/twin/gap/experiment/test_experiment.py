"""The next experiment: safe programs, and what they tell apart."""

import re

import numpy as np
import pytest

from tests.twin.gap.traces import MACHINE, strokes
from twin.gap.diagnosis import Cell, Effected
from twin.gap.experiment.choice import Hypothesis, next_experiment
from twin.gap.experiment.envelope import CutSeen, Envelope, envelope_of
from twin.gap.experiment.menu import Snippet, axis_menu, machine_menu
from twin.gap.experiment.remainder import remainder_experiment
from twin.gap.experiment.run import with_constant
from twin.machine import AddedEffect, MachineFile, SpindleDrive, Thermal
from twin.motion.path import path_from_moves
from twin.motion.plan import plan
from twin.motion.sampling import sampled
from twin.programs import interpret
from twin.runlog import run_log
from twin.simulator.simulation import IDEAL_TIMES

FLOORS = {"x_pos_mm": 0.0005, "x_table_mm": 0.0005, "x_torque_a": 0.012, "spindle_temp_c": 0.1}
SERVO = frozenset({"x_pos_mm", "x_torque_a"})
SEEN = envelope_of([strokes()])
EXACT = MACHINE.model_copy(update={"uncertainty": {"relative": 0.01}})


def hypothesis(effect: str, on: str, machine: MachineFile = EXACT, **parameters: float) -> Hypothesis:
    added = AddedEffect(effect=effect, on=on, parameters=parameters)
    return Effected(effect, on), machine.model_copy(update={"effects": (added,)})


GRAVITY = hypothesis("gravity", "x", force_n=90.0)
FRICTION = hypothesis("direction_friction", "x", asymmetry=0.2)


def test_the_envelope_is_what_the_runs_have_done() -> None:
    assert SEEN.box_mm["x"] == pytest.approx((0.0, 40.0))
    assert SEEN.feed_mm_min["x"] == pytest.approx(3000.0, rel=0.01)
    assert (SEEN.far_mm("x"), SEEN.spindle_rpm, SEEN.coolant, SEEN.cut) == (pytest.approx(40.0), 0.0, False, None)
    t_s = np.arange(2000) * 0.001
    depth = np.where(t_s > 1.0, 2.5, 0.0)
    angles = {"entry_angle_rad": np.zeros(2000), "exit_angle_rad": np.full(2000, 3.0)}
    motion = {"x_ref_mm": 10.0 * t_s, "y_ref_mm": np.zeros(2000), "spindle_rpm": np.full(2000, 3600.0)}
    cut = envelope_of([run_log({"t_s": t_s, "axial_depth_mm": depth, **angles, **motion})]).cut
    assert cut is not None
    assert cut == CutSeen(2.5, 0.0, 3.0, 3600.0, (pytest.approx(600.0), pytest.approx(600.0)))  # type: ignore[arg-type]


def menu(envelope: Envelope) -> list[Snippet]:
    return [s for a in envelope.box_mm for s in axis_menu(a, envelope, 10.0)] + list(machine_menu(envelope))


@pytest.mark.parametrize(
    ("box", "home"),
    [
        ({"x": (0.0, 75.0), "y": (-13.0, 70.0), "z": (-60.0, 0.0)}, {"x": 0.0, "y": 0.0, "z": 0.0}),
        ({"x": (-20.0, 5.0), "z": (-3.0, 3.0)}, {"x": 0.0, "z": 0.0}),
        ({"x": (0.0, 0.4)}, {"x": 0.0}),
    ],
)
def test_no_program_leaves_what_the_runs_have_done(box: dict[str, tuple[float, float]], home: dict[str, float]) -> None:
    cut = CutSeen(2.0, 0.0, 3.1, 3600.0, (400.0, 2000.0))
    envelope = Envelope(box, home, dict.fromkeys(box, 4800.0), 8000.0, True, 4000.0, cut)
    programs = menu(envelope)
    assert len(programs) >= (12 if len(box) == 3 else 1)
    for snippet in programs:
        text = snippet.program()
        body = text.strip().splitlines()[1:-2]
        assert all(re.fullmatch(r"N\d+ [A-Z0-9. -]+ \([^()]+\)", line) for line in body), text
        assert text.endswith("M30\n%\n")
        planned = plan(path_from_moves(interpret(text)), IDEAL_TIMES)
        if planned.total_s > 300.0:
            assert not len(planned.path)
            continue
        motion = sampled(planned, 0.002)
        for column, axis in enumerate(planned.path.axes):
            low, high = box.get(axis, (0.0, 0.0))
            reference = motion.reference_mm[:, column]
            assert low - 1e-3 <= reference.min()
            assert reference.max() <= high + 1e-3
            assert 60.0 * np.abs(np.gradient(reference, motion.t_s)).max() <= 4800.0 * 1.01


def test_gravity_and_friction_that_differs_by_direction_are_told_apart() -> None:
    found = next_experiment([GRAVITY, FRICTION], SERVO, SEEN, FLOORS)
    assert found is not None
    assert found.program.startswith("%\nN1 G21 G90 G94 G17")
    assert found.separation >= 5.0
    assert EXACT.program is not None
    planned = plan(path_from_moves(interpret(found.program)), EXACT.program)
    assert found.seconds == pytest.approx(planned.total_s, abs=0.05)
    assert found.why.startswith("separates gravity from direction_friction on x: ")
    assert re.search(r"expected difference [\d.]+ × the repeatability in x_", found.why)


def test_constants_that_are_not_known_can_hide_a_difference() -> None:
    vague = {f"axes.x.{name}": 1.0 for name in ("friction.coulomb_n", "friction.viscous_n_s_per_mm", "friction.static_n")}
    separations = []
    for nuisance in ({}, vague):
        found = next_experiment([GRAVITY, FRICTION], SERVO, SEEN, FLOORS, nuisance=nuisance)
        assert found is not None
        separations.append(found.separation)
    assert separations[1] < separations[0]


def test_hypotheses_that_do_the_same_have_no_experiment_and_a_reason() -> None:
    found = next_experiment([GRAVITY, hypothesis("gravity", "x", force_n=90.2)], SERVO, SEEN, FLOORS)
    assert found is not None
    assert found.program == ""
    assert found.why.startswith("no program of the menu separates gravity")
    assert next_experiment([GRAVITY], SERVO, SEEN, FLOORS) is None


def test_a_sensor_that_would_tell_is_asked_for() -> None:
    pair = [hypothesis("backlash", "x", play_mm=0.01), hypothesis("lead_error", "x", amplitude_mm=0.01)]
    found = next_experiment(pair, SERVO, SEEN, FLOORS)
    assert found is not None
    assert "record x_table_mm as well" in found.why
    assert found.program
    seen = next_experiment(pair, SERVO | {"x_table_mm"}, SEEN, FLOORS)
    assert seen is not None
    assert "record" not in seen.why.partition(":")[2]


def test_an_axis_that_never_moved_is_left_alone() -> None:
    still = Envelope({"x": (1.0, 1.0)}, {"x": 1.0}, {"x": 0.0})
    found = next_experiment([GRAVITY, FRICTION], SERVO, still, FLOORS)
    assert found is not None
    assert (found.program, found.seconds) == ("", 0.0)
    assert "no recorded run has moved" in found.why


def test_coolant_that_cools_and_a_biased_sensor_are_told_apart_by_switching_it() -> None:
    warm = EXACT.model_copy(
        update={
            "spindle": SpindleDrive(rated_power_kw=11.0, efficiency=0.85, idle_power_kw=0.25),
            "thermal": Thermal(
                alpha_w_per_pct_rpm2=2.2e-8, beta_w_per_rpm=0.016, resistance_k_per_w=0.12, capacity_j_per_k=9000.0
            ),
        }
    )
    pair = [hypothesis("coolant_cooling", "", warm, gain=0.3), hypothesis("sensor_bias", "spindle_temp_c", warm, bias=-2.0)]
    envelope = Envelope({}, {}, {}, 8000.0, True, 4000.0)
    found = next_experiment(pair, frozenset({"spindle_temp_c"}), envelope, FLOORS)
    assert found is not None
    assert "M8 (coolant on)" in found.program


def test_a_constant_is_changed_by_its_path() -> None:
    skewed = MACHINE.axes["x"].friction.model_copy(update={"coulomb_n": (300.0, 400.0)})
    machine = MACHINE.model_copy(update={"axes": {"x": MACHINE.axes["x"].model_copy(update={"friction": skewed})}})
    changed = with_constant(with_constant(machine, "axes.x.mass_kg", 2.0), "axes.x.friction.coulomb_n", 1.1)
    assert changed.axes["x"].mass_kg == 640.0
    assert changed.axes["x"].friction.coulomb_n == pytest.approx((330.0, 440.0))
    assert machine.axes["x"].mass_kg == 320.0


def cell(signal: str, regime: str) -> Cell:
    return Cell(signal, regime, 0.5, 0.2, 4.0, 1e-6, True, "")


def test_a_remainder_is_asked_after_by_where_it_lies() -> None:
    cells = [cell("x_pos_mm", "acceleration"), cell("x_torque_a", "acceleration")]
    elsewhere = frozenset({"screw_compliance", "velocity_feedback_delay"})
    found = remainder_experiment("x", cells, EXACT, SERVO, SEEN, FLOORS, without=elsewhere)
    assert found is not None
    assert found.why.startswith("what is left on x lies mostly while it accelerates and has no name")
    assert "acceleration_feedforward" in found.why
    assert remainder_experiment("y", cells, EXACT, SERVO, SEEN, FLOORS) is None
    assert remainder_experiment("x", [], EXACT, SERVO, SEEN, FLOORS) is None
