"""What is known of the twin that comes out: intervals of causes and constants as `[uncertainty]`, which nothing stumbles over."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from tests.twin.gap.one_line import BIAS, OneLine
from tests.twin.gap.small_case import HOT, MACHINE
from twin.gap.descent import Minimum
from twin.gap.diagnosis import Cause, Diagnosed, Diagnosis, GapNumbers, Interval, Verdict
from twin.gap.experiment.run import with_constant
from twin.gap.fitting import fitted
from twin.gap.joined import joined
from twin.gap.refitted import cause_deviations, constant_deviations, with_uncertainty
from twin.gap.stages.axis import axis_constant_path, axis_constants_free
from twin.gap.stages.stage import Model
from twin.identification.axis_parameters import axis_parameters
from twin.identification.identify import stated_uncertainty
from twin.machine import AddedEffect, machine_from_toml
from twin.machine_toml import machine_to_toml

EDGE = Cause("edge_force", "", 1.0, {"tangential_n_per_mm": Interval(20.0, 18.0, 22.0, "N/mm")}, (), 1.0)


def cause(effect: str, on: str = "", **parameters: Interval) -> Cause:
    return Cause(effect, on, 1.0, parameters, (), 0.5)


def test_a_cause_is_known_as_well_as_its_interval_says() -> None:
    assert cause_deviations(EDGE) == {"effects.edge_force.tangential_n_per_mm": pytest.approx(2.0 / 1.645 / 20.0, rel=1e-2)}
    down = cause("gravity", "z", force_n=Interval(-400.0, -408.0, -392.0, "N"))
    assert cause_deviations(down) == {"effects.gravity.z.force_n": pytest.approx(0.0122)}


@pytest.mark.parametrize("interval", [(0.0, -1.0, 1.0), (math.inf, 2e4, math.inf), (2e4, 1e4, math.inf), (3.0, 3.0, 3.0)])
def test_what_is_nothing_or_has_no_end_is_left_out(interval: tuple[float, float, float]) -> None:
    assert cause_deviations(cause("presliding", "x", stiffness_n_per_mm=Interval(*interval))) == {}


def test_a_constant_that_the_runs_tell_has_the_width_of_its_covariance_and_one_that_they_do_not_keeps_what_was_stated() -> None:
    stage = OneLine(slope=1.02)
    found = fitted(stage, Model(stage.constants, (BIAS,)), np.zeros(2))
    assert constant_deviations(MACHINE, stage, found) == {
        "slope": pytest.approx(math.sqrt(found.covariance[0, 0]), rel=1e-2)  # three digits
    }
    hardly = _HardlyKnown(**{f.name: getattr(found.minimum, f.name) for f in fields(Minimum)})
    assert constant_deviations(MACHINE, stage, replace(found, minimum=hardly)) == {}


class _HardlyKnown(Minimum):
    known = np.array([0.4, 1.0])  # type: ignore[assignment]


def test_the_path_of_a_constant_is_where_the_machine_has_it() -> None:
    as_force = MACHINE.axes["z"].model_copy(update={"force_per_command_n": 30.0, "torque_constant_nm_per_a": None})
    for machine in (MACHINE, MACHINE.model_copy(update={"axes": {"z": as_force}})):
        for free in axis_constants_free(machine, "z"):
            path = axis_constant_path(machine, "z", free.name)
            assert with_constant(machine, path, 1.1) != machine


def test_uncertainty_survives_the_file_and_whoever_reads_it_finds_what_was_there() -> None:
    told = {"axes.z.mass_kg": 0.011}
    causes = (EDGE, cause("gravity", "z", force_n=Interval(400.0, 392.0, 408.0, "N")))
    twin = with_uncertainty(MACHINE, told, causes)
    assert machine_from_toml(machine_to_toml(twin)) == twin
    assert dict(twin.uncertainty) == {
        "relative": 0.03,
        "axes.z.mass_kg": 0.011,
        "effects.edge_force.tangential_n_per_mm": 0.0608,
        "effects.gravity.z.force_n": 0.0122,
    }
    without = with_uncertainty(MACHINE, told, ())
    for force_known in (False, True):
        kinds = {"force_known": force_known, "free_gains": False}
        assert axis_parameters(twin, "z", **kinds) == axis_parameters(without, "z", **kinds)
    assert axis_constants_free(twin, "z") == axis_constants_free(without, "z")
    assert stated_uncertainty(twin, "tool.radial_ratio") == stated_uncertainty(MACHINE, "tool.radial_ratio")


def test_a_machine_and_its_programs_diagnosed_together_know_what_either_knows() -> None:
    gap = GapNumbers(1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, {})
    said = Diagnosis(Verdict.HEALTHY, "", (), (), (), (), gap, (), (), (), None, (), 0.0)
    slow = cause("tool_change_time", change_s=Interval(3.0, 2.8, 3.2, "s"))
    effect = AddedEffect(effect="tool_change_time", parameters={"change_s": 3.0})
    programs = with_uncertainty(HOT.model_copy(update={"effects": (effect,)}), {}, (slow,))
    motion = with_uncertainty(HOT, {"thermal.capacity_j_per_k": 0.02}, (EDGE,))
    both = joined(Diagnosed(said, motion), Diagnosed(said, programs)).twin
    assert both.effects == (effect,)
    assert dict(both.uncertainty) == {**motion.uncertainty, **cause_deviations(slow)}
