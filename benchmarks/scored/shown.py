"""The size of the faults beside what healthy parts do: the change by size 1 over the spread of the same pass from part to part.

    shown = median over passes of  |mean of the pass with the fault − without| / robust spread of the mean of the pass

of passes at full feed; bursts count as if they lasted, a dulling tool with a wear of 4. A pass lasts 5 to 20 s.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.cell import Cell, draw_cell, machine_readings
from benchmarks.simulated_cell.fault import ONE_TOOL, PLANTED, Fault, FaultKind, Overlap
from benchmarks.simulated_cell.part_program import Work
from benchmarks.simulated_cell.schedule import DAY_S, Schedule
from benchmarks.simulated_cell.signals import FEATURES

Floats = NDArray[np.float64]
DAYS = 3
PASSES_MIN = 8
FULL_PCT = 100.0
SPREAD_LEAST = 0.005
SHOWN = {
    FaultKind.BEARING: "vibration_rms_g",
    FaultKind.CHIP_PACKING: "spindle_load_pct",
    FaultKind.SPINDLE_HEAT: "spindle_temp_c",
    FaultKind.FEED_MISMATCH: "feed_mm_min",
    FaultKind.INTERMITTENT: "vibration_rms_g",
    FaultKind.BROKEN_INSERT: "vibration_rms_g",
    FaultKind.BROKEN_TOOL: "spindle_load_pct",
    FaultKind.TOOL_TOO_LONG: "spindle_load_pct",
    FaultKind.WRONG_MATERIAL: "spindle_load_pct",
    FaultKind.COOLANT_OFF: "spindle_load_pct",
    FaultKind.DULLING_TOOL: "spindle_load_pct",
}
"""The signal that shows a kind most."""


def sizes_shown(seed: int) -> dict[str, float]:
    """Return how many spreads size 1 of each kind is, on one machine in three days."""
    cell = draw_cell(seed, 1, DAYS, DAYS)
    healthy, own = machine_readings(cell, 0).rows, cell.schedules[0]
    return {kind.value: _shown(cell, own, healthy, kind) for kind in PLANTED}


def _shown(cell: Cell, own: Schedule, healthy: Floats, kind: FaultKind) -> float:
    """A fault of one tool is put on each tool in turn, but that of a tool that is too long, which is on the one it is on."""
    signal, found = FEATURES.index(SHOWN[kind]), []
    for tool in _tools(own, kind):
        fault = Fault(0, kind, 1.0, 0.0, float(DAYS * DAY_S), Overlap.NONE, tool=tool)
        broken = machine_readings(replace(cell, faults=(fault,)), 0).rows
        found += _by_pass(own, healthy[:, signal], broken[:, signal], _operations(own, kind, tool))
    return float(np.median(found)) if found else float("nan")


def _tools(own: Schedule, kind: FaultKind) -> list[int]:
    if kind not in ONE_TOOL:
        return [0]
    cutting = [one for one in own.operations if one.cuts]
    if kind is FaultKind.TOOL_TOO_LONG:
        return [min(cutting, key=lambda one: min(cut.depth_mm for cut in one.cuts)).tool]
    return sorted({one.tool for one in cutting})


def _operations(own: Schedule, kind: FaultKind, tool: int) -> NDArray[np.bool_]:
    """Return the operations that a fault is seen in."""
    needs_coolant = kind is FaultKind.COOLANT_OFF
    return np.array([bool(one.cuts) and tool in (0, one.tool) and (one.is_wet or not needs_coolant) for one in own.operations])


def _by_pass(own: Schedule, healthy: Floats, broken: Floats, operations: NDArray[np.bool_]) -> list[float]:
    """Change over spread of each pass that is repeated."""
    wanted = (own.work == Work.CUTTING) & (own.feed_override_pct == FULL_PCT) & operations[own.operation]
    at = np.flatnonzero(wanted)
    stretches, first, which, count = np.unique(own.stretch[at], return_index=True, return_inverse=True, return_counts=True)
    before, after = (np.bincount(which, weights=values[at]) / count for values in (healthy, broken))
    line = own.line[at][first]
    found = []
    for one in np.unique(line):
        passes = line == one
        if passes.sum() >= PASSES_MIN and len(stretches):
            low, high = np.percentile(before[passes], [25, 75])
            spread = max((high - low) / 1.349, SPREAD_LEAST * abs(float(np.median(before[passes]))), 1e-9)
            found.append(abs(float(np.median(after[passes] - before[passes]))) / spread)
    return found
