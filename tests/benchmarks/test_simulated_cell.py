"""The simulated cell: programs say what is cut, each fault moves what it says by as much, and nothing else is touched."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.scored.parts import expectations, recorded
from benchmarks.simulated_cell.cell import Cell, draw_cell, machine_readings
from benchmarks.simulated_cell.fault import ONE_TOOL, PLANTED, SIZES, Fault, FaultKind, Overlap
from benchmarks.simulated_cell.machine import of_pass
from benchmarks.simulated_cell.part_program import Cut, Sense, Work
from benchmarks.simulated_cell.schedule import DAY_S, KNOWN_PROGRAMS
from benchmarks.simulated_cell.signals import FEATURES, Readings
from cnctwin.standins.reference_machine.milling import CutPhysics

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
LOAD, RPM, FEED, TEMP, VIBRATION = range(5)
FULL_PCT = 100.0


@pytest.fixture(scope="module")
def cell() -> Cell:
    """Four machines, a day without faults and two with them."""
    return draw_cell(7, 4, 3, 1)


@pytest.fixture(scope="module")
def healthy(cell: Cell) -> Readings:
    return machine_readings(cell, 0, with_faults=False)


def test_a_seed_is_a_cell(cell: Cell) -> None:
    again = draw_cell(7, 4, 3, 1)
    assert (again.faults, again.disturbances) == (cell.faults, cell.disturbances)
    assert np.array_equal(machine_readings(cell, 1).rows, machine_readings(again, 1).rows)
    assert draw_cell(8, 4, 3, 1).faults != cell.faults


def test_the_readings_are_those_of_machines(cell: Cell, healthy: Readings) -> None:
    rows, work = healthy.rows, cell.schedules[0].work
    assert rows.shape == (3 * DAY_S, len(FEATURES))
    cutting, standing, changing = (rows[work == one] for one in (Work.CUTTING, Work.STANDING, Work.TOOL_CHANGE))
    assert 0.25 < float((work == Work.CUTTING).mean()) < 0.6
    assert float(np.median(standing[:, RPM])) == 0.0
    assert 5.0 < float(np.median(cutting[:, LOAD])) < 90.0
    assert 0.03 < float(np.median(cutting[:, VIBRATION])) < 0.8
    assert 15.0 < float(rows[:, TEMP].min()) < float(rows[:, TEMP].max()) < 60.0
    assert float(changing[:, VIBRATION].max()) > 0.8, "a tool that is clamped shakes"
    assert float(rows[:, LOAD].max()) > 120.0, "a spindle that runs up takes more than rated power"


def test_one_machine_in_four_tells_late_of_its_tool_changes(cell: Cell) -> None:
    for place, schedule in enumerate(cell.schedules):
        begins = np.flatnonzero(np.diff(schedule.is_changing.astype(int)) == 1) + 1
        told = np.flatnonzero(np.diff(schedule.tool_change_active.astype(int)) == 1) + 1
        after = told[np.minimum(np.searchsorted(told, begins), len(told) - 1)] - begins
        assert (float(np.median(after)) > 4.0) == (place == 3)


def test_two_machines_share_a_program_and_each_has_a_new_one_later(cell: Cell) -> None:
    first, second = cell.machines[:2]
    assert first.programs[0] == second.programs[0]
    assert first.programs[1] != second.programs[1]
    for schedule in cell.schedules:
        new = [part.start_s for part in schedule.parts if part.program == KNOWN_PROGRAMS]
        assert new and min(new) > 2 * DAY_S


def test_the_twin_reads_in_a_program_what_the_cell_cuts(cell: Cell) -> None:
    """Length of each line, and K a b f / (π D n) as the mean force of each pass where its arc is whole."""
    machine = cell.machines[2]
    for program, expected in zip(machine.programs, expectations(machine, "vmc3"), strict=True):
        runs = {run.line: run for run in expected.runs}
        for operation in program.operations:
            tool = machine.tools[operation.tool]
            for line in operation.lines:
                run = runs.get(line.number)
                assert run is not None or line.length_mm < 1e-6
                if run is None or line.cut < 0:
                    continue
                cut = operation.cuts[line.cut]
                assert (run.tool, run.length_mm) == (operation.tool, pytest.approx(line.length_mm, abs=0.01))
                removed = cut.depth_mm * cut.width_mm * line.feed_mm_min
                force_n = tool.tangential_n_per_mm2 * removed / (np.pi * tool.diameter_mm * operation.rpm)
                most = max(stretch.forces_n[-1] / (3.0 if len(stretch.forces_n) > 1 else 1.0) for stretch in run.stretches)
                assert most * line.feed_mm_min / run.feed_mm_min == pytest.approx(force_n, rel=0.02)


def test_the_force_of_a_pass_is_linear_in_chip_and_edge() -> None:
    tool, cut = CutPhysics(16.0, 3, 900.0, 0.4, 14.0, 11.0, thinning=0.12, runout_mm=0.004), Cut(4.0, 6.0, Sense.CLIMB)
    harder = tool._replace(tangential=1170.0, edge_n_per_mm=28.0, edge_radial_n_per_mm=22.0)
    plain, other = of_pass(tool, cut, 3000.0, 900.0), of_pass(harder, cut, 3000.0, 900.0)
    assert np.allclose(other[0], 1.3 * plain[0])
    assert np.allclose(other[1], 2.0 * plain[1])
    assert np.allclose(other[2:], plain[2:] * np.array([[1.3**2], [2.6], [4.0]]))


@cache
def broken_for(cell: Cell, kind: FaultKind, size: float, tool: int, bursts: bool) -> Readings:
    """The first machine with one fault on the second and third day."""
    last_s = float(cell.days * DAY_S)
    shown = ((0.0, last_s),) if bursts else ()
    return machine_readings(replace(cell, faults=(Fault(0, kind, size, float(DAY_S), last_s, Overlap.NONE, shown, tool),)), 0)


def cut_by(cell: Cell, tool: int = 0) -> Flags:
    """The seconds of the last day in which the first machine cuts with the whole arc, by a tool where it is given."""
    own = cell.schedules[0]
    lines, line = own.lines, own.line
    gone = lines.length_mm[line] * own.since_s / own.lasts_s[own.stretch]
    is_whole = (gone > lines.lead_mm[line]) & (gone < lines.lead_mm[line] + lines.stock_mm[line] - lines.reach_mm[line])
    later = np.arange(len(line)) > 2 * DAY_S
    return np.asarray((own.work == Work.CUTTING) & later & is_whole & ((tool == 0) | (own.tool_number == tool)))


def factor(kind: FaultKind, cell: Cell, healthy: Readings, signal: int, tool: int, idle: float = 0.0) -> float:
    """Median of broken over healthy where it cuts, less what the spindle takes idle."""
    at, rows = cut_by(cell, tool), broken_for(cell, kind, 1.0, tool, kind is FaultKind.INTERMITTENT).rows
    return float(np.median((rows[at, signal] - idle) / np.maximum(healthy.rows[at, signal] - idle, 1e-3)))


def hardest_tool(cell: Cell, healthy: Readings) -> int:
    own = cell.schedules[0]
    tools = {one.tool for one in own.operations if one.cuts}
    loads = {tool: healthy.rows[cut_by(cell, tool), LOAD] for tool in tools}
    return max(tools, key=lambda tool: float(np.median(loads[tool])) if len(loads[tool]) > 200 else 0.0)


EFFECTS = [
    (FaultKind.BEARING, VIBRATION, 2.5, 0.02),
    (FaultKind.CHIP_PACKING, LOAD, 1.5, 0.03),
    (FaultKind.CHIP_PACKING, VIBRATION, 1.4, 0.02),
    (FaultKind.FEED_MISMATCH, FEED, 0.5, 0.02),
    (FaultKind.INTERMITTENT, VIBRATION, 2.5, 0.02),
    (FaultKind.INTERMITTENT, LOAD, 1.25, 0.03),
    (FaultKind.WRONG_MATERIAL, VIBRATION, 1.3, 0.05),
    (FaultKind.DULLING_TOOL, LOAD, 1.6, 0.35),
    (FaultKind.TOOL_TOO_LONG, VIBRATION, 1.1, 0.09),
]


@pytest.mark.parametrize(("kind", "signal", "wanted", "within"), EFFECTS)
def test_a_fault_moves_its_signal_by_what_it_says(
    kind: FaultKind, signal: int, wanted: float, within: float, cell: Cell, healthy: Readings
) -> None:
    tool = hardest_tool(cell, healthy) if kind in ONE_TOOL else 0
    assert factor(kind, cell, healthy, signal, tool) == pytest.approx(wanted, rel=within)


@pytest.mark.parametrize(("kind", "kelvin"), [(FaultKind.BEARING, 3.0), (FaultKind.SPINDLE_HEAT, 12.0)])
def test_heat_is_as_many_kelvin(kind: FaultKind, kelvin: float, cell: Cell, healthy: Readings) -> None:
    middle = slice(DAY_S + 8 * 3600, DAY_S + 20 * 3600)
    risen = broken_for(cell, kind, 1.0, 0, False).rows[middle, TEMP] - healthy.rows[middle, TEMP]
    assert float(np.median(risen)) == pytest.approx(kelvin, abs=0.1)


def test_a_broken_tool_takes_what_a_spindle_takes_in_air(cell: Cell, healthy: Readings) -> None:
    tool = hardest_tool(cell, healthy)
    at, own = cut_by(cell, tool), cell.schedules[0]
    broken = broken_for(cell, FaultKind.BROKEN_TOOL, 1.0, tool, False).rows
    in_air = (own.work == Work.RAPID) & (own.tool_number == tool) & (own.line >= 0) & (np.arange(len(own.work)) > 2 * DAY_S)
    assert float(np.median(broken[at, LOAD])) == pytest.approx(float(np.median(healthy.rows[in_air, LOAD])), abs=1.0)
    assert float(np.median(healthy.rows[at, LOAD])) > 15.0


def test_a_broken_insert_shakes_and_hardly_loads(cell: Cell, healthy: Readings) -> None:
    tool = hardest_tool(cell, healthy)
    assert factor(FaultKind.BROKEN_INSERT, cell, healthy, VIBRATION, tool) > 1.15
    assert factor(FaultKind.BROKEN_INSERT, cell, healthy, LOAD, tool) == pytest.approx(1.0, abs=0.15)


def test_without_coolant_wet_cuts_are_harder_and_the_spindle_warmer_and_the_control_says_nothing(
    cell: Cell, healthy: Readings
) -> None:
    broken, own = broken_for(cell, FaultKind.COOLANT_OFF, 1.0, 0, False), cell.schedules[0]
    is_wet = np.array([one.is_wet for one in own.operations])[own.operation] & cut_by(cell)
    is_dry = cut_by(cell) & ~is_wet
    ratio = broken.rows[:, VIBRATION] / healthy.rows[:, VIBRATION]
    assert float(np.median(ratio[is_wet])) == pytest.approx(1.2, rel=0.03)
    assert not is_dry.any() or float(np.median(ratio[is_dry])) == 1.0
    assert float(np.median((broken.rows - healthy.rows)[is_wet, TEMP])) > 0.3
    assert np.array_equal(broken.coolant_on, healthy.coolant_on)


def test_a_worn_bearing_comes_over_days(cell: Cell, healthy: Readings) -> None:
    broken = broken_for(cell, FaultKind.WORN_BEARING, 1.0, 0, False).rows
    at = np.flatnonzero(healthy.rows[:, RPM] > 200.0)
    ratio = broken[:, VIBRATION] / np.maximum(healthy.rows[:, VIBRATION], 1e-3)
    early, late = (
        float(np.median(ratio[at[(at >= start) & (at < start + 6 * 3600)]])) for start in (DAY_S + 21_600, 2 * DAY_S + 43_200)
    )
    assert 1.0 < early < 1.25 < late < 1.5


@pytest.mark.parametrize("kind", [kind for kind in PLANTED if kind in ONE_TOOL])
def test_a_fault_of_one_tool_leaves_the_others_as_they_are(kind: FaultKind, cell: Cell, healthy: Readings) -> None:
    tool, own = hardest_tool(cell, healthy), cell.schedules[0]
    broken = broken_for(cell, kind, 1.0, tool, False).rows
    others = [LOAD, RPM, FEED, VIBRATION]
    is_other = own.tool_number != tool
    assert np.array_equal(broken[is_other][:, others], healthy.rows[is_other][:, others])
    assert not np.array_equal(broken[~is_other], healthy.rows[~is_other])


def test_outside_of_faults_all_is_the_same_but_for_heat_that_stays(cell: Cell) -> None:
    with_faults, without = machine_readings(cell, 2).rows, machine_readings(cell, 2, with_faults=False).rows
    own = [fault for fault in cell.faults if fault.machine == 2]
    rows = [LOAD, RPM, FEED, VIBRATION]
    differs = np.flatnonzero((with_faults != without)[:, rows].any(axis=1))
    assert own and len(differs) > 0
    assert all(any(fault.start_s <= tick <= fault.end_s + 1 for fault in own) for tick in differs)
    first_s = int(min(fault.start_s for fault in own))
    assert np.array_equal(with_faults[:first_s], without[:first_s])


def test_faults_are_of_all_kinds_sizes_and_overlaps() -> None:
    cell = draw_cell(9, 4, 14, 7)
    faults = cell.faults
    assert len(faults) == 54
    assert {fault.kind for fault in faults} == set(PLANTED)
    assert {fault.size for fault in faults} == set(SIZES)
    assert {fault.overlap for fault in faults} == set(Overlap)
    for fault in faults:
        assert (fault.tool > 0) == (fault.kind in ONE_TOOL)
        assert fault.size == 1.0 or fault.kind is not FaultKind.BROKEN_TOOL
        if fault.kind is FaultKind.WRONG_MATERIAL:
            assert any(abs(fault.end_s - part.end_s) < 1.0 for part in cell.schedules[fault.machine].parts)
        if fault.kind is FaultKind.INTERMITTENT:
            assert all(30.0 <= end - start <= 60.0 for start, end in fault.bursts_s)


def test_a_disturbance_is_felt_by_all_each_with_its_own_strength(cell: Cell) -> None:
    for one in cell.disturbances:
        assert len(one.gains) == len(one.delays_s) == 4
        assert 1.0 < max(one.gains) / min(one.gains) < 30.0


def test_a_recording_tells_program_line_tool_and_expectation(cell: Cell) -> None:
    one, own = recorded(cell, 0), cell.schedules[0]
    cutting = own.work == Work.CUTTING
    assert one.expected is not None
    assert np.isfinite(one.expected[cutting, 0]).all()
    assert np.isnan(one.expected[own.program == 0]).all()
    assert float(np.median(one.expected[cutting, 0])) > 3.0
    assert one.programs[0] == "O9000" and len(one.programs) == KNOWN_PROGRAMS + 2
