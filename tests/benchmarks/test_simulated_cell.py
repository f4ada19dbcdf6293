"""The simulated cell: what it draws is what it says, and a slice of the benchmark that is judged on it."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import scoring
from benchmarks.simulated_cell.cell import Cell, draw_cell, machine_signals
from benchmarks.simulated_cell.fault import SIZES, FaultKind, Overlap
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S
from benchmarks.simulated_cell.signals import FEATURES

Floats = NDArray[np.float64]
LOAD, RPM, FEED, TEMP, VIBRATION = range(5)


@pytest.fixture(scope="module")
def cell() -> Cell:
    """Four machines, a day without faults and a day with them."""
    return draw_cell(7, 4, 2, 1)


def test_a_seed_is_a_cell(cell: Cell) -> None:
    again = draw_cell(7, 4, 2, 1)
    assert (again.faults, again.disturbances) == (cell.faults, cell.disturbances)
    assert np.array_equal(machine_signals(cell, 1), machine_signals(again, 1))
    assert draw_cell(8, 4, 2, 1).faults != cell.faults


def test_the_features_are_those_of_machines(cell: Cell) -> None:
    rows, work = machine_signals(cell, 0), cell.schedules[0].work
    assert rows.shape == (2 * DAY_S, len(FEATURES))
    cutting, standing, changing = (rows[work == one] for one in (Work.CUTTING, Work.STANDING, Work.TOOL_CHANGE))
    assert 0.25 < float((work == Work.CUTTING).mean()) < 0.6
    assert float(np.median(standing[:, RPM])) == 0.0
    assert 5.0 < float(np.median(cutting[:, LOAD])) < 90.0
    assert 0.05 < float(np.median(cutting[:, VIBRATION])) < 0.8
    assert 17.0 < float(rows[:, TEMP].min()) < float(rows[:, TEMP].max()) < 60.0
    assert float(changing[:, VIBRATION].max()) > 0.8, "a tool that is clamped shakes"
    assert float(rows[:, LOAD].max()) > 120.0, "a spindle that runs up takes more than rated power"


def test_one_machine_in_four_tells_late_of_its_tool_changes(cell: Cell) -> None:
    for place, schedule in enumerate(cell.schedules):
        begins = np.flatnonzero(np.diff(schedule.is_changing.astype(int)) == 1) + 1
        told = np.flatnonzero(np.diff(schedule.tool_change_active.astype(int)) == 1) + 1
        after = told[np.searchsorted(told, begins)[: len(begins) - 1]] - begins[:-1]
        assert (float(np.median(after)) > 4.0) == (place == 3)


def test_before_the_faults_all_is_the_same_without_them(cell: Cell) -> None:
    with_faults, without = machine_signals(cell, 2), machine_signals(cell, 2, with_faults=False)
    own = [fault for fault in cell.faults if fault.machine == 2]
    differs = np.flatnonzero((with_faults != without).any(axis=1))
    assert own
    assert all(any(fault.start_s <= tick <= fault.end_s + 1 for fault in own) for tick in differs)
    assert len(differs) > 0


@pytest.fixture(scope="module")
def faulty() -> Cell:
    return draw_cell(9, 4, 14, 7)


@pytest.fixture(scope="module")
def of_a_machine(faulty: Cell) -> Callable[[int, bool], Floats]:
    """Its signals with and without its faults, made once."""
    return cache(lambda machine, with_faults: machine_signals(faulty, machine, with_faults=with_faults))


def test_faults_are_of_all_kinds_sizes_and_overlaps(faulty: Cell) -> None:
    faults = faulty.faults
    assert len(faults) == 54
    assert {fault.kind for fault in faults} == set(FaultKind)
    assert {fault.size for fault in faults} == set(SIZES)
    assert {fault.overlap for fault in faults} == set(Overlap)


@pytest.mark.parametrize("kind", list(FaultKind))
def test_a_fault_is_as_big_as_it_is_said_to_be(
    kind: FaultKind, faulty: Cell, of_a_machine: Callable[[int, bool], Floats]
) -> None:
    fault = next(fault for fault in faulty.faults if fault.kind is kind and fault.size >= 1.0 and fault.overlap is Overlap.NONE)
    quarter = 0.25 * (fault.end_s - fault.start_s)
    middle = slice(int(fault.start_s + quarter), int(fault.end_s - quarter))
    rows, healthy = (of_a_machine(fault.machine, with_faults)[middle] for with_faults in (True, False))
    cut = faulty.schedules[fault.machine].work[middle] == Work.CUTTING
    assert cut.any()
    factors = {
        FaultKind.BEARING: (VIBRATION, 2.5**fault.size),
        FaultKind.CHIP_PACKING: (LOAD, 1.5**fault.size),
        FaultKind.FEED_MISMATCH: (FEED, 1.0 / (1.0 + fault.size)),
    }
    if kind is FaultKind.SPINDLE_HEAT:
        assert float(np.median(rows[:, TEMP] - healthy[:, TEMP])) == pytest.approx(12.0 * fault.size, abs=0.2)
    elif kind in factors:
        signal, factor = factors[kind]
        loud = cut & (healthy[:, signal] >= np.median(healthy[cut, signal]))
        assert float(np.median(rows[loud, signal] / healthy[loud, signal])) == pytest.approx(factor, rel=0.15)
    else:
        assert fault.bursts_s
        assert all(30.0 <= end - start <= 60.0 for start, end in fault.bursts_s)


def test_a_disturbance_is_felt_by_all_each_with_its_own_strength(cell: Cell) -> None:
    for one in cell.disturbances:
        assert len(one.gains) == len(one.delays_s) == 4
        assert 1.0 < max(one.gains) / min(one.gains) < 30.0


def test_a_slice_of_the_benchmark_finds_what_is_big_and_more_with_peers() -> None:
    """Two days each to learn, to calibrate and to be judged, three machines, two alerts a day asked for."""
    frames = scoring.framed(draw_cell(2, 3, 6, 4), (2, 2, 2))
    found = {}
    for method in ("features", "gate", "random"):
        parts = scoring.judged(frames, method, alerts_per_week=14.0)
        found[method] = scoring.recall(scoring.of_faults(parts, lambda fault: fault.size == 2.0)).value
        assert all(part.has_threshold for part in parts)
    assert found["features"] >= 0.6
    assert found["features"] > found["gate"]
    assert found["features"] > found["random"]
