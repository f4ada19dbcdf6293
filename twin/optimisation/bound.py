"""What no program within the limits can be better than, so that an answer states its distance to it and not only its gain.

Time: every line at the highest feed of any speed it may have, on axes with their limits, while speeds change for nothing; but a
spindle that starts from rest has to ramp up to the speed of the line that it starts for, which may then choose a lower one. Cost:
the sum of what each line costs by itself at its best, or what that time costs by labour and the tools of each line at their best,
whichever is more. Where the control is ideal (length over feed, speeds that change for nothing) a program reaches it.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.motion.path import EventKind, Kind
from twin.motion.plan import Plan
from twin.motion.timeline import effort
from twin.optimisation.answer import Bound, Objective
from twin.optimisation.closed_form import Worth
from twin.optimisation.problem import Problem
from twin.optimisation.seeds import closed_form

Floats = NDArray[np.float64]
REACHED = 1e-9
CELLS = 1024


class Ramp(NamedTuple):
    """The spindle starts from rest for line `row` of `Allowed`; `meanwhile_s` passes before that needs it."""

    row: int
    meanwhile_s: float


def bound_of(problem: Problem, objective: Objective, value: float) -> Bound:
    """The bound of seconds or cost, and the distance of `value` to it."""
    ideal = _ideal_plan(problem)
    ramps = _ramps(problem, ideal)
    seconds = _least_seconds(problem, ideal, ramps)
    feed, rpm = closed_form(problem, objective)
    reached = problem.evaluate_words(feed[None], rpm[None])
    if objective is Objective.TIME:
        least, here = seconds, float(reached.seconds[0])
    else:
        least, here = _least_cost(problem, feed, rpm, seconds, ramps), float(reached.cost[0])
    exact = here <= least * (1.0 + REACHED)
    least = min(least, here)  # a program is there, so it is no bound that is above it
    how = (
        "each line at its own best, which a program reaches: the control is ideal, and speeds change for nothing"
        if exact
        else "each line at its own best while speeds change for nothing; changes and corners take a program more"
    )
    return Bound(value=least, distance=max(value / least - 1.0, 0.0), exact=exact, how=how)


def _ideal_plan(problem: Problem) -> Plan:
    """The program at the highest feeds, with a spindle that is always at speed."""
    path, rows = problem.program.path, problem.row_of_segment
    feed, _ = closed_form(problem, Objective.TIME)
    own = np.where(path.kind == Kind.RAPID, 1.0, path.feed_mm_min)
    feeds = np.where(rows >= 0, feed[np.maximum(rows, 0)], own) if len(problem.allowed) else own
    return problem.ideal_control().plan_with(path, feeds)


def _ramps(problem: Problem, ideal: Plan) -> tuple[Ramp, ...]:
    """The starts from rest; none where the spindle takes no time."""
    limits, path = problem.limits(), problem.program.path
    if not np.isfinite(limits.spindle_acceleration_rpm_s):
        return ()
    made, found, rpm, at = problem.speeds, [], 0.0, 0
    for e, event in enumerate(made.candidates.events):
        if made.candidates.is_optional[e]:
            continue
        begun = float(ideal.event_start_s[at])
        at += 1
        if event.kind in (EventKind.TOOL_CHANGE, EventKind.ORIENT):
            rpm = 0.0
        elif event.kind == EventKind.SPINDLE:
            if rpm == 0.0 and event.value != 0.0 and made.owner[e] >= 0:
                waits = np.flatnonzero((path.kind[event.segment :] != Kind.RAPID) | limits.rapid_waits_for_spindle)
                if len(waits):
                    meanwhile = float(ideal.start_s[event.segment + waits[0]]) - begun
                    found.append(Ramp(int(made.owner[e]), meanwhile))
            rpm = event.value
    return tuple(found)


def _waits_s(problem: Problem, ramps: tuple[Ramp, ...], row: int, rpm: Floats) -> Floats:
    """For how long the starts of a line keep the axes waiting, at these speeds."""
    limits = problem.limits()
    ramp_s = np.array([effort(float(n), limits.spindle_base_rpm) for n in rpm]) / limits.spindle_acceleration_rpm_s
    waits = np.zeros(len(rpm))
    for ramp in ramps:
        if ramp.row == row:
            waits += np.maximum(ramp_s - ramp.meanwhile_s, 0.0)
    return waits


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Pieces of the speeds of a line, each (cells,): no speed in a piece allows more real feed than `feed`, nor is below `rpm`.

    Where f / n does not grow (a greatest advance, a constant feed or power), f ≤ f(n₀) n₁ / n₀ in [n₀, n₁]; where it
    grows (a power that grows with the speed), f grows too, and f ≤ f(n₁).
    """

    rpm: Floats
    feed: Floats

    @classmethod
    def of(cls, problem: Problem, row: int) -> Self:
        """Of one line."""
        allowed, rpm, feed = problem.allowed, [], []
        for a, b in allowed.spans[row]:
            edges = np.geomspace(a, b, CELLS + 1) if b > a else np.array([a, a])
            at = allowed.line(row).feed_max(edges[:, None])[:, 0] * allowed.feed_ratio
            rpm.append(edges[:-1])
            most = np.maximum(at[:-1] * edges[1:] / edges[:-1], at[1:])
            feed.append(np.minimum(most, allowed.feed_high * allowed.feed_ratio))
        return cls(np.concatenate(rpm), np.concatenate(feed))


def _least_seconds(problem: Problem, ideal: Plan, ramps: tuple[Ramp, ...]) -> float:
    """No line is faster than in the ideal plan, nor than its length over its feed; and its starts take their ramps."""
    seconds = ideal.total_s
    for row in sorted({ramp.row for ramp in ramps}):
        line = problem.program.lines[int(problem.allowed.index[row])]
        at_best = sum(float(ideal.duration_s[a:b].sum()) for a, b in line.executions)
        cells = Cells.of(problem, row)
        slower = np.maximum(60.0 * line.length_mm / cells.feed - at_best, 0.0)
        seconds += float((slower + _waits_s(problem, ramps, row, cells.rpm)).min())
    return seconds


def _least_cost(problem: Problem, feed: Floats, rpm: Floats, seconds: float, ramps: tuple[Ramp, ...]) -> float:
    economy = problem.economy
    assert economy is not None
    worth, beside = problem.worth(economy.per_second, economy.per_tool), problem.beside
    wear = Worth(worth.length_mm, worth.beside_s, worth.wear, worth.wear_beside, 0.0, worth.exponent)
    starting = {ramp.row for ramp in ramps}
    own, tools, real = 0.0, 0.0, feed * problem.allowed.feed_ratio
    for row in problem.cutting.tolist():
        cells = Cells.of(problem, row)
        tools += float(wear.of_line(row, cells.feed, cells.rpm).min())
        alone = float(worth.of_line(row, real[row : row + 1], rpm[row : row + 1])[0])
        if row in starting:
            waits = economy.per_second * _waits_s(problem, ramps, row, cells.rpm)
            alone = max(alone, float((worth.of_line(row, cells.feed, cells.rpm) + waits).min()))
        own += alone
    separate = own + beside.nobody_s * economy.per_second + beside.nobody_worn * economy.per_tool
    together = seconds * economy.per_second + tools + beside.nobody_worn * economy.per_tool
    return max(separate, together)
