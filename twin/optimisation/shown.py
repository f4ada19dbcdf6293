"""Lines and totals of a program as they are cut: force, power, torque, chip of the worst cut of each line."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.machine import Limits
from twin.motion.path import Kind, Path
from twin.optimisation.answer import Cutting, SpeedChanges, Totals
from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem

Floats = NDArray[np.float64]
HAIR = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class ShownLines:
    """The figures of each feed line of the program, (lines,); the worst of its cuts, zeros in air.

    waits_s: the part of its seconds in which the axes stand for the spindle
    """

    feed_mm_min: Floats
    rpm: Floats
    force_n: Floats
    power_kw: Floats
    torque_nm: Floats
    chip_mm: Floats
    surface_speed_m_min: Floats
    seconds: Floats
    waits_s: Floats
    cost: Floats | None

    def line(self, k: int) -> Cutting:
        """One of them."""
        return Cutting(
            feed_mm_min=float(self.feed_mm_min[k]),
            spindle_rpm=float(self.rpm[k]),
            force_n=float(self.force_n[k]),
            power_kw=float(self.power_kw[k]),
            torque_nm=float(self.torque_nm[k]),
            chip_mm=float(self.chip_mm[k]),
            surface_speed_m_min=float(self.surface_speed_m_min[k]),
            seconds=float(self.seconds[k]),
            cost=None if self.cost is None else float(self.cost[k]),
        )


def shown_lines(problem: Problem, forces: CutForces, path: Path) -> ShownLines:
    """The lines as a path has them: feeds and speeds are read off it, whoever wrote them."""
    program = problem.program
    first = np.array([line.executions[0] for line in program.lines], dtype=np.int64).reshape(-1, 2)
    feeding = np.array([_feed_segment(path, a, b) for a, b in first.tolist()], dtype=np.int64)
    speed = path.commanded_rpm()
    feed, rpm = path.feed_mm_min[feeding], np.abs(speed[feeding])
    diameter = np.array([program.tools[line.tool][1].diameter_mm if line.tool >= 0 else 0.0 for line in program.lines])
    force, power, torque, chip = _cut(problem, forces, feed, rpm)
    made = problem.control.plan(path)
    seconds, waits = (
        np.array([by_line[line.line] if line.line < len(by_line) else 0.0 for line in program.lines])
        for by_line in (made.seconds_by_line(), made.waits_by_line())
    )
    cost = None
    if problem.economy is not None:
        share = np.array([line.cut_mm / max(line.length_mm, 1e-12) for line in program.lines])
        wears = share if problem.economy.wears_in_cut else np.ones(len(share))
        cost = seconds * (
            problem.economy.per_second + problem.economy.per_tool * wears * problem.economy.lives_per_s(diameter, rpm)
        )
    return ShownLines(feed, rpm, force, power, torque, chip, np.pi * diameter * rpm / 1000.0, seconds, waits, cost)


def advances(problem: Problem, feed: Floats, rpm: Floats, teeth: Floats) -> Floats:
    """Advance a tooth period of each line, mm."""
    with np.errstate(divide="ignore", invalid="ignore"):
        advance = feed * problem.control.feed_ratio / (teeth * rpm)
    return np.where((rpm > 0.0) & (teeth > 0.0), advance, 0.0)


def advance_of_cuts(problem: Problem, path: Path) -> Floats:
    """Advance a tooth period of each cut of the program, as a path has its feeds and speeds, (cuts,)."""
    program = problem.program
    feeding = np.array([_feed_segment(path, *line.executions[0]) for line in program.lines], dtype=np.int64)
    teeth = np.array([program.tools[line.tool][1].teeth if line.tool >= 0 else 0 for line in program.lines], dtype=np.float64)
    each = advances(problem, path.feed_mm_min[feeding], np.abs(path.commanded_rpm())[feeding], teeth)
    return np.asarray(each[program.cuts.line])


def _feed_segment(path: Path, a: int, b: int) -> int:
    return next((k for k in range(a, b) if path.kind[k] != Kind.RAPID), a)


def _cut(problem: Problem, forces: CutForces, feed: Floats, rpm: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Force, power, torque and chip of the worst cut of each line."""
    program = problem.program
    out = [np.zeros(len(program.lines)) for _ in range(4)]
    cuts = len(forces.cuts)
    if cuts:
        owner = program.cuts.line
        advance = advances(problem, feed[owner], rpm[owner], forces.teeth.astype(np.float64))
        tangential = forces.tangential_n(advance)
        cutting_w = tangential * np.pi * forces.diameter_mm * rpm[owner] / 60_000.0
        spindle = problem.allowed.spindle
        power = spindle.electrical_kw(cutting_w, rpm[owner]) if spindle is not None else cutting_w / 1000.0
        each = (forces.peak_n(advance), power, tangential * forces.diameter_mm / 2000.0, advance * forces.chip_ratio())
        for values, row in zip(each, out, strict=True):
            np.maximum.at(row, owner, values)
    return out[0], out[1], out[2], out[3]


def totals(shown: ShownLines, seconds: float, cost: float | None, limits: Limits, problem: Problem) -> Totals:
    """Return the figures of the whole program; `over` counts lines above a limit."""
    over = np.zeros(len(shown.rpm), dtype=np.bool_)
    cutting = shown.force_n > 0.0
    kept = np.array([line.needs_speed for line in problem.program.lines], dtype=np.bool_)
    for values, limit in ((shown.force_n, limits.force_n), (shown.torque_nm, limits.torque_nm)):
        if limit is not None:
            over |= values > limit * (1.0 + HAIR)
    if limits.chip_mm is not None:
        over |= shown.chip_mm > limits.chip_mm[1] * (1.0 + HAIR)
    if problem.allowed.spindle is not None:
        over |= cutting & (shown.power_kw > problem.allowed.spindle.allowed_kw(shown.rpm) * (1.0 + HAIR))
    for values, pair in (
        (shown.feed_mm_min, limits.feed_mm_min),
        (shown.rpm, limits.spindle_rpm),
        (shown.surface_speed_m_min, limits.surface_speed_m_min),
    ):
        if pair is not None:
            over |= (cutting | kept) & (values > pair[1] * (1.0 + HAIR))
    return Totals(
        seconds=seconds,
        cost=cost,
        force_n=float(shown.force_n.max(initial=0.0)),
        power_kw=float(shown.power_kw.max(initial=0.0)),
        torque_nm=float(shown.torque_nm.max(initial=0.0)),
        chip_mm=float(shown.chip_mm.max(initial=0.0)),
        over=int(over.sum()),
    )


def limits_shown(problem: Problem, limits: Limits) -> dict[str, str]:
    """The limits that were kept, with their units."""
    shown = {
        "feed": f"{limits.feed_mm_min[0]:g} to {limits.feed_mm_min[1]:g} mm/min",
        "spindle speed": f"{limits.spindle_rpm[0]:g} to {limits.spindle_rpm[1]:g} rev/min",
    }
    if limits.force_n is not None:
        shown["cutting force"] = f"{limits.force_n:g} N"
    if problem.allowed.spindle is not None:
        base = problem.allowed.spindle.base_rpm
        shown["spindle power"] = f"{problem.allowed.spindle.limit_kw:g} kW" + (f", less below {base:g} rev/min" if base else "")
    if limits.torque_nm is not None:
        shown["spindle torque"] = f"{limits.torque_nm:g} N·m"
    if limits.chip_mm is not None:
        shown["chip thickness"] = f"{1000 * limits.chip_mm[0]:g} to {1000 * limits.chip_mm[1]:g} µm"
    if limits.surface_speed_m_min is not None:
        shown["surface speed"] = "{:g} to {:g} m/min".format(*limits.surface_speed_m_min)
    if problem.groups.changes is not SpeedChanges.ANYWHERE:
        in_air = problem.groups.changes is SpeedChanges.IN_AIR
        shown["changes of speed"] = "only where the tool is clear of the material" if in_air else "one speed for each tool number"
    if any(tool.modes for _, tool in problem.program.tools):
        shown["chatter"] = "stability lobes, zero order"
    return shown
