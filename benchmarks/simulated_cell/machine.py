"""A machine of the cell: what it states, and what it truly is, which the reference machine makes a few percent off.

    power of a pass = m · P_chip(g) + e · P_edge(g)        force² = m² V_cc + 2 m e V_ce + e² V_ee        g: feed over programmed

m: material and wear on the coefficient; e: wear on the edge. The force of the reference machine is linear in both, so its kernel
runs once for each pass of a program and each of the feeds of GRID, for four turns of the tool.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_cell.part_program import Cut, Operation, PartProgram
from benchmarks.simulated_cell.tooling import EndMill
from cnctwin.standins.reference_machine import axis, milling, stated
from cnctwin.standins.reference_machine.heat import HeatPhysics
from cnctwin.standins.reference_machine.milling import CutPhysics
from cnctwin.standins.reference_machine.physics import physics_of
from cnctwin.standins.reference_machine.spindle import MeterPhysics

Floats = NDArray[np.float64]
GRID_STEP = 0.2
GRID = np.arange(0.0, 1.61, GRID_STEP)
TURNS = 4.0
RATED_KW = (5.5, 7.5)
EDGE_N_PER_MM, EDGE_RADIAL_N_PER_MM = 14.0, 11.0
THINNING, RUNOUT_MM = 0.12, 0.004
DROP, TURNING_KW = 0.2, 0.15
COOLANT, CONVECTION, COLUMN_W_PER_K = 0.5, 0.25, 2.0
"""Things that the machine does and its statement leaves out."""
RAPID_MM_MIN, ACCELERATION_MM_S2 = 24000.0, 2500.0
VIBRATION_G_PER_N = 6e-4
CHIPS = 0.2
"""The share of the mean force that varies as chips break, whatever the angle of the tool."""


@dataclass(frozen=True, slots=True)
class Machine:
    """The traits of one machine. The last program is the new one, which it runs only in the judged days.

    label_late_s: how long after the spindle's stop its control tells of a tool change; 0: when it begins, as with M06
    tools, cutting: as stated, and as they are; vibration_g_per_n: by tool, how strongly the machine answers to its force
    """

    programs: tuple[PartProgram, ...]
    label_late_s: float
    ambient_offset_k: float
    figures: stated.MachineFigures
    tools: Mapping[int, EndMill]
    cutting: Mapping[int, CutPhysics]
    meter: MeterPhysics
    heat: HeatPhysics
    vibration_g_per_n: Mapping[int, float]

    def toml(self, program: PartProgram, name: str) -> str:
        """Return the machine.toml that the twin is given: the statement, with the stock of a program."""
        lines = [stated.machine_toml(self.figures, name)]
        low, high = (", ".join(f"{at:.3f}" for at in place) for place in (program.stock_min_mm, program.stock_max_mm))
        lines += ["[stock]", f"min_mm = [{low}]", f"max_mm = [{high}]"]
        lines += ["[program]", f"rapid_mm_min = {RAPID_MM_MIN}", f"acceleration_mm_s2 = {ACCELERATION_MM_S2}"]
        lines += ["[control]", "start_mm = [0.0, 0.0, 100.0]"]
        for number, tool in self.tools.items():
            lines += [f"[tools.{number}]", f"diameter_mm = {tool.diameter_mm}", f"teeth = {tool.teeth}"]
            lines += [f"tangential_coefficient_n_per_mm2 = {tool.tangential_n_per_mm2}", f"radial_ratio = {tool.radial_ratio}"]
        return "\n".join(lines) + "\n"


def draw_machine(
    programs: tuple[PartProgram, ...], tools: Mapping[int, EndMill], rng: np.random.Generator, *, is_late: bool
) -> Machine:
    """A machine that runs these programs: its statement, and its truth."""
    label_late_s = float(rng.uniform(5.0, 13.0)) if is_late else 0.0
    ambient_offset_k = float(rng.normal(0.0, 1.0))
    drawn = stated.drawn_machine(rng)
    figures = replace(drawn, spindle=replace(drawn.spindle, rated_power_kw=float(rng.choice(RATED_KW)), idle_power_kw=0.2))
    truth = physics_of(stated.scattered(figures, rng))
    cutting, answers = {}, {}
    for number, tool in tools.items():
        off = 1.0 + stated.UNCERTAINTY * np.clip(rng.standard_normal(3), -2.0, 2.0)
        cutting[number] = CutPhysics(
            tool.diameter_mm,
            tool.teeth,
            tool.tangential_n_per_mm2 * float(off[0]),
            tool.radial_ratio * float(off[1]),
            EDGE_N_PER_MM * float(rng.uniform(0.8, 1.2)),
            EDGE_RADIAL_N_PER_MM * float(rng.uniform(0.8, 1.2)),
            thinning=THINNING,
            runout_mm=RUNOUT_MM,
            runout_rad=float(rng.uniform(0.0, 6.28)),
        )
        answers[number] = VIBRATION_G_PER_N * float(np.exp(rng.normal(0.0, 0.3)))
    meter = replace(truth.meter, drop=DROP, turning_kw=TURNING_KW)
    heat = truth.heat._replace(turning=CONVECTION, coolant=COOLANT, column_w_per_k=COLUMN_W_PER_K)
    return Machine(programs, label_late_s, ambient_offset_k, figures, tools, cutting, meter, heat, answers)


@dataclass(frozen=True, slots=True)
class Passes:
    """The cuts of operations one after another: (C, G) at the feeds of GRID.

    chip_w, edge_w: power; chip2, both, edge2: (co)variances of the force, N²; first: place of each operation's first cut
    """

    chip_w: Floats
    edge_w: Floats
    chip2: Floats
    both: Floats
    edge2: Floats
    first: tuple[int, ...]


def passes_of(machine: Machine, operations: tuple[Operation, ...], chipped: tuple[int, float] = (0, 0.0)) -> Passes:
    """Power and force of each pass of the operations. chipped: a tool, and by how much its first tooth is shorter, mm."""
    rows, first = [np.zeros((5, len(GRID)))], []
    for one in operations:
        first.append(len(rows))
        by_cut = {line.cut: line.feed_mm_min for line in one.lines if line.cut >= 0}
        tool = machine.cutting.get(one.tool)
        if tool is not None and one.tool == chipped[0]:
            tool = tool._replace(chipped_mm=chipped[1])
        rows += [
            of_pass(tool, cut, one.rpm, by_cut[place]) if tool is not None and place in by_cut else np.zeros((5, len(GRID)))
            for place, cut in enumerate(one.cuts)
        ]
    table = np.stack(rows, axis=1)
    return Passes(*table, first=tuple(first))


@lru_cache(maxsize=4096)
def of_pass(p: CutPhysics, cut: Cut, rpm: float, feed_mm_min: float) -> Floats:
    """(5, G) of one pass: mean power of chip and edge, variances of the force."""
    chip, edge = p._replace(edge_n_per_mm=0.0, edge_radial_n_per_mm=0.0), p._replace(tangential=0.0)
    found = np.zeros((5, len(GRID)))
    for place, share in enumerate(GRID[1:], start=1):
        chip_w, chip_n = _milled(chip, cut, rpm, feed_mm_min * share)
        edge_w, edge_n = _milled(edge, cut, rpm, feed_mm_min * share)
        a, b = (force - force.mean(axis=1, keepdims=True) for force in (chip_n, edge_n))
        pairs = ((a, chip_n, a, chip_n), (a, chip_n, b, edge_n), (b, edge_n, b, edge_n))
        found[:, place] = chip_w, edge_w, *(_varying(*pair) for pair in pairs)
    return found


def _varying(a: Floats, one: Floats, b: Floats, other: Floats) -> float:
    """Covariance over the turn, with the share of the means that varies at random."""
    alike = CHIPS**2 * float((one.mean(axis=1) * other.mean(axis=1)).sum())
    return float((a * b).sum(axis=0).mean()) + alike


def _milled(p: CutPhysics, cut: Cut, rpm: float, feed_mm_min: float) -> tuple[float, Floats]:
    """Mean power, W, and the force in between the ticks, (2, n), N, of some turns along x."""
    count = max(8, round(TURNS * 60_000.0 / rpm))
    angle = np.arange(count) * (rpm * 2.0 * np.pi / 60_000.0)
    velocity = np.zeros((2, count))
    velocity[0] = feed_mm_min / 60.0
    arc = np.repeat(np.array(cut.arc_rad(p.diameter_mm))[:, None], count, axis=1)
    sampled, held, power = np.zeros((2, count)), np.zeros((2, count * axis.STEPS)), np.zeros(count)
    speeds, depths = np.full(count, rpm), np.full(count, cut.depth_mm)
    milling.forces(p, angle, speeds, np.zeros((2, count)), velocity, depths, arc, sampled, held, power)
    return float(power.mean()), held
