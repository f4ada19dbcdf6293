"""The bound that no program within the limits can beat, so that an answer states its distance to it and not only its gain.

Time: every line at the highest feed of any speed it may have, on axes with their limits, a change of speed taking no time; but
lines that share a speed have one, and a spindle that starts from rest has to ramp up to that of the line it starts for. Cost:
the sum of what each group of lines costs by itself at its best, or what that time costs by labour and the tools of each group at
their best, whichever is more. Where the control is ideal (length over feed, no time for a change of speed) a program reaches it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from twin.motion.path import EventKind, Kind
from twin.motion.plan import Plan
from twin.motion.timeline import effort
from twin.optimisation.allowed import Allowed
from twin.optimisation.answer import Bound, Objective
from twin.optimisation.closed_form import Worth, best_together
from twin.optimisation.problem import Problem
from twin.optimisation.seeds import closed_form

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
REACHED = 1e-7
"""Nearer than this is there: length over feed is an acceleration that is very high, not endless."""
CELLS, BLOCK = 1024, 256
"""Pieces of a span, and lines that are worked out at a time."""


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
    each = "each line" if all(len(rows) == 1 for rows in problem.groups.rows) else "each group of lines that share a speed"
    how = (
        f"{each} at its own optimum, which a program reaches: the control is ideal, and changes of speed take no time"
        if exact
        else f"{each} at its own optimum, without the time that changes of speed and corners take"
    )
    return Bound(value=least, distance=max(value / least - 1.0, 0.0), exact=exact, how=how)


def _ideal_plan(problem: Problem) -> Plan:
    """The program with every line at the highest feed of any speed it may have, and a spindle that is always at speed."""
    path, rows, allowed = problem.program.path, problem.row_of_segment, problem.allowed
    feed, _ = best_together(allowed, problem.groups.apart(), problem.worth(1.0, 0.0))
    own = np.where(path.kind == Kind.RAPID, 1.0, path.feed_mm_min)
    feeds = np.where(rows >= 0, feed[np.maximum(rows, 0)], own) if len(allowed) else own
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


def _waits_s(problem: Problem, ramps: tuple[Ramp, ...], group: int, rpm: Floats) -> Floats:
    """For how long the starts of a group keep the axes waiting, at these speeds."""
    limits, waits = problem.limits(), np.zeros(len(rpm))
    mine = [ramp for ramp in ramps if problem.groups.of_row[ramp.row] == group]
    if not mine:
        return waits
    ramp_s = np.array([effort(float(n), limits.spindle_base_rpm) for n in rpm]) / limits.spindle_acceleration_rpm_s
    for ramp in mine:
        waits += np.maximum(ramp_s - ramp.meanwhile_s, 0.0)
    return waits


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Pieces of the speeds of a group, (cells,): no speed in a piece is below `rpm`, nor allows a line more than `feed_of`.

    Where f / n does not grow (a greatest advance, a constant feed or power), f ≤ f(n₀) n₁ / n₀ in [n₀, n₁]; where it
    grows (a power that grows with the speed), f grows too, and f ≤ f(n₁).
    """

    allowed: Allowed
    rpm: Floats
    until: Floats

    @classmethod
    def of(cls, problem: Problem, group: int) -> Self:
        """Return the cells of one group."""
        edges = [np.geomspace(a, b, CELLS + 1) if b > a else np.array([a, a]) for a, b in problem.spans[group]]
        return cls(problem.allowed, np.concatenate([e[:-1] for e in edges]), np.concatenate([e[1:] for e in edges]))

    def feed_of(self, rows: Ints) -> Floats:
        """Real feeds of some lines of the group, (cells, rows)."""
        one = self.allowed.lines(rows)
        first, last = (one.feed_max(np.repeat(n[:, None], len(rows), axis=1)) * one.feed_ratio for n in (self.rpm, self.until))
        most = np.maximum(first * (self.until / self.rpm)[:, None], last)
        return np.minimum(most, one.feed_high * one.feed_ratio)

    def sums(self, rows: Ints, of: Callable[[Ints, Floats], Floats]) -> Floats:
        """The sum over the lines of the group of what `of` makes of some rows and their feeds (cells, rows) → (cells,)."""
        parts = [rows[k : k + BLOCK] for k in range(0, len(rows), BLOCK)]
        return np.asarray(sum(of(part, self.feed_of(part)) for part in parts))


def _least_seconds(problem: Problem, ideal: Plan, ramps: tuple[Ramp, ...]) -> float:
    """No line is faster than in the ideal plan, nor than its length over its feed at the speed of its group; and starts ramp."""
    lines = [problem.program.lines[int(k)] for k in problem.allowed.index]
    at_best = np.array([sum(float(ideal.duration_s[a:b].sum()) for a, b in line.executions) for line in lines])
    length = np.array([line.length_mm for line in lines])
    feed, _ = closed_form(problem, Objective.TIME)
    together = 60.0 * length / (feed * problem.allowed.feed_ratio)
    starting = {int(problem.groups.of_row[ramp.row]) for ramp in ramps}

    def slower(rows: Ints, most: Floats) -> Floats:
        return np.asarray(np.maximum(60.0 * length[rows] / most - at_best[rows], 0.0).sum(axis=1))

    seconds = ideal.total_s
    for group, rows in enumerate(problem.groups.rows):
        if len(rows) == 1 and group not in starting:
            continue  # the ideal plan has it at its best
        cells = Cells.of(problem, group)
        least = float((cells.sums(rows, slower) + _waits_s(problem, ramps, group, cells.rpm)).min())
        seconds += max(least, float((together[rows] - at_best[rows]).sum()))
    return seconds


def _weighed(worth: Worth, rpm: Floats, rows: Ints, most: Floats) -> Floats:
    return worth.of(rows, most, rpm)


def _least_cost(problem: Problem, feed: Floats, rpm: Floats, seconds: float, ramps: tuple[Ramp, ...]) -> float:
    economy = problem.economy
    assert economy is not None
    worth, fixed = problem.worth(economy.per_second, economy.per_tool), problem.fixed_time
    wear = Worth(worth.length_mm, worth.fixed_s, worth.wear, worth.wear_fixed, 0.0, worth.exponent)
    starting = {int(problem.groups.of_row[ramp.row]) for ramp in ramps}
    own, tools, real = 0.0, 0.0, feed * problem.allowed.feed_ratio
    for group, rows in enumerate(problem.groups.rows):
        cells = Cells.of(problem, group)
        tools += float(cells.sums(rows, partial(_weighed, wear, cells.rpm)).min())
        alone = float(worth.of(rows, real[rows], rpm[rows[0]]))
        if group in starting:
            waits = economy.per_second * _waits_s(problem, ramps, group, cells.rpm)
            alone = max(alone, float((cells.sums(rows, partial(_weighed, worth, cells.rpm)) + waits).min()))
        own += alone
    separate = own + fixed.unshared_s * economy.per_second + fixed.unshared_worn * economy.per_tool
    together = seconds * economy.per_second + tools + fixed.unshared_worn * economy.per_tool
    return max(separate, together)
