"""A machine with several tools: each cut is compared with the tool in the spindle, and an effect may be of one tool."""

from dataclasses import replace

import numpy as np
import pytest

from tests.twin.gap.dynamometer.dynamometer_case import dynamometer_case
from tests.twin.gap.dynamometer.milled import Cutter
from twin.case import RunAtHand
from twin.effects.added import check_effects
from twin.errors import EffectError
from twin.gap.diagnose import diagnose
from twin.machine import AddedEffect, MachineFile
from twin.runlog import run_log
from twin.simulator.recorded import tool_of
from twin.simulator.response import RunInput, respond

SHARP, WORN = Cutter(), Cutter(edge_n_per_mm=15.0, edge_radial_n_per_mm=20.0)
EDGE = {"tangential_n_per_mm": 15.0, "radial_n_per_mm": 20.0}


def with_tools(machine: MachineFile, *effects: AddedEffect) -> MachineFile:
    assert machine.tool is not None
    wide = machine.tool.model_copy(update={"diameter_mm": 16.0})
    return machine.model_copy(update={"tool": None, "tools": {"3": machine.tool, "7": wide}, "effects": effects})


def told(tool: str) -> RunInput:
    t_s = np.arange(200) * 0.001
    same = {name: np.full(200, value) for name, value in (("spindle_rpm", 3000.0), ("axial_depth_mm", 2.0))}
    arc = {"entry_angle_rad": np.zeros(200), "exit_angle_rad": np.full(200, 1.9)}
    way = {"x": 10.0 * t_s, "y": np.zeros(200)}
    return RunInput(t_s, way, spindle_angle_rad=100.0 * np.pi * t_s, tool=tool, **same, **arc)


def test_an_effect_on_one_tool_is_felt_with_that_tool_in_the_spindle_only() -> None:
    machine = dynamometer_case(SHARP).machine
    worn, sharp = with_tools(machine, AddedEffect(effect="edge_force", on="3", parameters=EDGE)), with_tools(machine)
    forces = {tool: [respond(m, told(tool)).columns["force_y_n"] for m in (worn, sharp)] for tool in ("3", "7")}
    assert np.ptp(forces["3"][0] - forces["3"][1]) > 10.0
    assert np.array_equal(*forces["7"])


def test_an_effect_of_the_cut_may_be_on_a_tool_that_there_is_and_no_other_effect_may() -> None:
    machine = dynamometer_case(SHARP).machine
    check_effects(with_tools(machine, AddedEffect(effect="edge_force", on="3", parameters=EDGE)))
    for wrong in (
        AddedEffect(effect="edge_force", on="5", parameters=EDGE),
        AddedEffect(effect="rated_power", on="3", parameters={"scale": 1.1}),
    ):
        with pytest.raises(EffectError, match="acts on"):
            check_effects(with_tools(machine, wrong))


@pytest.mark.parametrize(("number", "expected"), [([3.0], "3"), ([3.0, 7.0], ""), ([9.0], "")])
def test_the_tool_of_a_run_is_the_one_that_it_cuts_with(number: list[float], expected: str) -> None:
    machine = with_tools(dynamometer_case(SHARP).machine)
    count = len(number)
    log = run_log({"t_s": np.arange(count) * 1.0, "tool_number": np.array(number), "axial_depth_mm": np.ones(count)})
    assert tool_of(log, machine) == expected


def test_the_worn_one_of_two_tools_is_named_and_written_into_the_twin() -> None:
    runs = []
    for tool, cutter in ((3.0, WORN), (7.0, SHARP)):
        for run in dynamometer_case(cutter).runs:
            columns = {"t_s": run.log.t_s, **run.log.columns, "tool_number": np.full(len(run.log), tool)}
            entry = run.entry.model_copy(update={"file": f"tool_{tool:.0f}_{run.name}"})
            runs.append(RunAtHand(entry, run.folder, run_log(columns)))
    case = dynamometer_case(SHARP)
    found = diagnose(replace(case, machine=with_tools(case.machine), runs=tuple(runs)))
    assert [(c.effect, c.on) for c in found.diagnosis.causes] == [("edge_force", "3")], found.diagnosis.sentence
    assert "edge force on tool 3" in found.diagnosis.sentence
    assert [(e.effect, e.on) for e in found.twin.effects] == [("edge_force", "3")]
    assert found.diagnosis.gap.after < 0.3 * found.diagnosis.gap.before
