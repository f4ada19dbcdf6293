"""Where a search begins: the closed form of each line, the program as it is, common speeds, and the best sequence of speeds.

The sequence is found by dynamic programming (Viterbi): lines in the order of their first execution, a few speeds for each, a
change costs what the spindle takes to ramp and the axes to stop and start. It is the optimum of that simplified problem, and
as a rule close to that of the whole.
"""

import numpy as np
from numpy.typing import NDArray

from twin.motion.timeline import effort
from twin.optimisation.answer import Objective
from twin.optimisation.closed_form import Worth, best_alone
from twin.optimisation.problem import Problem

Floats = NDArray[np.float64]
COMMON = 12
SPEEDS_MAX = 48
SWEEP = 24


def worth_of(problem: Problem, objective: Objective, per_second_more: float = 0.0) -> Worth:
    """What the closed form is to weigh: seconds, or cost; `per_second_more` on top, for the points of a front."""
    if objective is Objective.TIME or problem.economy is None:
        return problem.worth(1.0, 0.0)
    return problem.worth(problem.economy.per_second + per_second_more, problem.economy.per_tool)


def closed_form(problem: Problem, objective: Objective, per_second_more: float = 0.0) -> tuple[Floats, Floats]:
    """Feed word and speed of each line by itself, (lines,). For time alone the cheapest of the fastest, or the nearest."""
    allowed = problem.allowed
    near = np.array([problem.program.lines[int(k)].rpm for k in allowed.index], dtype=np.float64)
    tie = None
    if objective is Objective.TIME and problem.economy is not None:
        tie = problem.worth(problem.economy.per_second, problem.economy.per_tool)
    return best_alone(allowed, worth_of(problem, objective, per_second_more), tie, near)


def seeds(problem: Problem, objective: Objective) -> Floats:
    """Genes (candidates, p) to begin with, the closed form first."""
    single = Objective.COST if objective is Objective.PARETO else objective
    weights = (0.0,)
    if objective is Objective.PARETO and problem.economy is not None:
        weights = (0.0, *np.geomspace(0.05, 2e3, SWEEP).tolist())
    found = []
    for more in weights:
        feed, rpm = closed_form(problem, single, more * (problem.economy.per_second if problem.economy is not None else 0.0))
        found.append(problem.encoded(feed, rpm))
        if len(problem.cutting) > 1:
            found.append(problem.encoded(feed, sequence(problem, worth_of(problem, single, more), rpm)))
    if objective is Objective.PARETO:  # both ends first: a small population takes no more
        found.insert(0, problem.encoded(*closed_form(problem, Objective.TIME)))
    lines = [problem.program.lines[int(k)] for k in problem.allowed.index]
    as_is = np.array([line.feed_mm_min for line in lines]), np.array([line.rpm for line in lines])
    found.append(problem.encoded(*as_is))
    if len(problem.cutting):
        low = min(a for row in problem.cutting for a, _ in problem.allowed.spans[row])
        high = max(b for row in problem.cutting for _, b in problem.allowed.spans[row])
        for common in np.geomspace(low, high, COMMON):
            genes = problem.encoded(as_is[0], np.full(len(lines), common))
            genes[: len(lines)] = 1.0
            found.append(genes)
    return np.array(found)


def sequence(problem: Problem, worth: Worth, alone: Floats) -> Floats:
    """The speeds (lines,) of the best sequence among a few speeds for each line; a line in air keeps 0."""
    allowed, rows = problem.allowed, problem.cutting.tolist()
    first = [problem.program.lines[int(allowed.index[row])].executions[0][0] for row in rows]
    rows = [row for _, row in sorted(zip(first, rows, strict=True))]
    speeds = _some_speeds(problem, alone, rows)
    at = np.repeat(speeds[:, None], len(allowed), axis=1)
    feed = allowed.feed_max(at)
    value = np.full((len(rows), len(speeds)), np.inf)
    for place, row in enumerate(rows):
        fits = np.array([any(a - 1e-9 <= n <= b + 1e-9 for a, b in allowed.spans[row]) for n in speeds])
        value[place, fits] = worth.of_line(row, feed[fits, row] * allowed.feed_ratio, speeds[fits])
    change = _change(problem, worth, speeds)
    come = np.zeros(value.shape, dtype=np.int64)
    total = value[0]
    for place in range(1, len(rows)):
        through = total[:, None] + change
        come[place] = np.argmin(through, axis=0)
        total = through[come[place], np.arange(len(speeds))] + value[place]
    out, k = np.zeros(len(allowed)), int(np.argmin(total))
    for place in range(len(rows) - 1, -1, -1):
        out[rows[place]] = speeds[k]
        k = int(come[place, k])
    return out


def _some_speeds(problem: Problem, alone: Floats, rows: list[int]) -> Floats:
    """Speeds to choose from: those that lines have by themselves and ends of their spans, thinned out where there are many."""
    spans = [edge for row in rows for span in problem.allowed.spans[row] for edge in span]
    speeds = np.unique(np.round(np.concatenate([alone[rows], spans]), 6))
    if len(speeds) > SPEEDS_MAX:
        speeds = speeds[np.unique(np.linspace(0, len(speeds) - 1, SPEEDS_MAX).round().astype(np.int64))]
    return speeds


def _change(problem: Problem, worth: Worth, speeds: Floats) -> Floats:
    """What a change from one speed to another is worth, (speeds, speeds): the ramp, and a stop of the axes."""
    limits = problem.limits()
    base = limits.spindle_base_rpm
    tau = np.array([effort(float(n), base) for n in speeds])
    up = tau[None, :] - tau[:, None]
    down_rate = limits.spindle_deceleration_rpm_s
    rate = np.where(
        up > 0.0, limits.spindle_acceleration_rpm_s, down_rate if down_rate is not None else limits.spindle_acceleration_rpm_s
    )
    slowest = np.min(np.asarray(limits.acceleration_mm_s2))
    stop = float(problem.allowed.feed_high / 60.0 / slowest) + limits.in_position_s
    return np.where(up == 0.0, 0.0, worth.per_second * (np.abs(up) / rate + stop))
