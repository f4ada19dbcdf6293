"""The words for what keeps a line from being better."""

import numpy as np

from twin.optimisation.answer import Binds, Cutting, Objective
from twin.optimisation.problem import Problem

NEAR = 2e-3
SLOW = 1.25
EDGE_RPM = 1.5


def what_binds(made: Problem, row: int, line: Cutting, waits_s: float, objective: Objective, own_rpm: float) -> str:
    """The limits that a line is at, joined by `and`; where none holds the speed, what else does.

    waits_s: the part of its seconds in which it waits for the spindle; own_rpm: best by itself
    """
    allowed = made.allowed
    reasons: list[Binds] = []
    full = line.feed_mm_min >= (1.0 - NEAR) * allowed.feed_high
    if allowed.cutting[row] and line.spindle_rpm > 0.0:
        advance = line.feed_mm_min * allowed.feed_ratio / (allowed.teeth[row] * line.spindle_rpm)
        at = np.full(len(allowed), line.spindle_rpm)
        if advance >= (1.0 - NEAR) * allowed.advance_max_mm[row] and not (full and objective is Objective.TIME):
            reasons.append(allowed.reason[row])
        elif advance >= (1.0 - NEAR) * allowed.advance_by_power_mm(at)[row]:
            reasons.append(Binds.POWER)
        if not full:
            reasons += _why_no_faster(made, row, line.spindle_rpm, objective, own_rpm)
    if full:
        reasons.append(Binds.FEED)
    source = made.program.lines[int(allowed.index[row])]
    feeding_s = 60.0 * source.length_mm / (line.feed_mm_min * allowed.feed_ratio)
    if line.seconds - waits_s > SLOW * feeding_s:
        reasons.append(Binds.DYNAMICS)
    if waits_s > (SLOW - 1.0) * feeding_s or (waits_s > 0.0 and _is_slower(line.spindle_rpm, own_rpm)):
        reasons.append(Binds.RUN_UP)
    return " and ".join(dict.fromkeys(reasons))


def _why_no_faster(made: Problem, row: int, rpm: float, objective: Objective, own_rpm: float) -> list[Binds]:
    """Why the spindle does not turn faster, which would allow more feed."""
    spans = made.groups.own_spans[row]
    program = made.program
    limits = program.machine.limits
    assert limits is not None
    if any(abs(rpm - high) <= EDGE_RPM for _, high in spans):
        if abs(rpm - limits.spindle_rpm[1]) <= EDGE_RPM:
            return [Binds.SPEED]
        surface = np.pi * made.allowed.diameter_mm[row] * rpm / 1000.0
        if limits.surface_speed_m_min is not None and surface >= (1.0 - NEAR) * limits.surface_speed_m_min[1]:
            return [Binds.SURFACE_SPEED]
        return [Binds.CHATTER] if program.tools[program.lines[int(made.allowed.index[row])].tool][1].modes else [Binds.POWER]
    group = made.groups.of_row[row]
    shares = len(made.groups.rows[group]) > 1 or made.groups.kept[group] is not None
    if shares and abs(rpm - own_rpm) > max(EDGE_RPM, NEAR * own_rpm):
        return [Binds.SHARED_SPEED]
    return [Binds.TOOL_LIFE] if objective is not Objective.TIME else [Binds.SPEED_CHANGE]


def _is_slower(rpm: float, own_rpm: float) -> bool:
    """Return True where a line turns slower than would be best for it by itself."""
    return rpm < own_rpm - max(EDGE_RPM, NEAR * own_rpm)
