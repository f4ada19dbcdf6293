"""What no program within the limits can be better than, so that an answer states its distance to it and not only its gain.

Time: every line at the highest feed of any speed it may have, the spindle changing its speed for nothing, planned with the
limits of the axes. Cost: the sum of what each line costs by itself at its best, or what that time costs by labour and the
tools of each line at their best, whichever is more. Where the control is ideal (length over feed, speeds that change for
nothing) a program reaches it.
"""

import numpy as np
from numpy.typing import NDArray

from twin.motion.candidates import Candidates
from twin.motion.path import Kind
from twin.optimisation.answer import Bound, Objective
from twin.optimisation.closed_form import Worth
from twin.optimisation.problem import Problem
from twin.optimisation.seeds import closed_form

Floats = NDArray[np.float64]
REACHED = 1e-9
SPEEDS = 513
GRID_IS_SHORT = 0.999
"""The least of a grid is above the least there is; a bound has to be below it."""


def bound_of(problem: Problem, objective: Objective, value: float) -> Bound:
    """The bound of seconds or cost, and the distance of `value` to it."""
    seconds = _least_seconds(problem)
    feed, rpm = closed_form(problem, objective)
    reached = problem.evaluate_words(feed[None], rpm[None])
    if objective is Objective.TIME:
        least, here = seconds, float(reached.seconds[0])
    else:
        least, here = _least_cost(problem, feed, rpm, seconds), float(reached.cost[0])
    exact = here <= least * (1.0 + REACHED)
    how = (
        "each line at its own best, which a program reaches: the control is ideal, and speeds change for nothing"
        if exact
        else "each line at its own best while speeds change for nothing; changes and corners take a program more"
    )
    return Bound(value=least, distance=max(value / least - 1.0, 0.0), exact=exact, how=how)


def _least_seconds(problem: Problem) -> float:
    """The time at the highest feeds, with a spindle that is always at speed."""
    path, allowed = problem.program.path, problem.allowed
    feed, _ = closed_form(problem, Objective.TIME)
    ideal = problem.limits().with_(spindle_acceleration_rpm_s=np.inf, spindle_deceleration_rpm_s=None)
    made = Candidates.of(path, ideal, (), problem.control.feed_ratio, problem.control.rapid_ratio)
    rows = problem.row_of_segment
    own = np.where(path.kind == Kind.RAPID, 1.0, path.feed_mm_min)
    feeds = np.where(rows >= 0, feed[np.maximum(rows, 0)], own) if len(allowed) else own
    values = np.array([[event.value for event in made.events]])
    return float(made.seconds_and_wear(feeds[None], values)[0][0])


def _least_cost(problem: Problem, feed: Floats, rpm: Floats, seconds: float) -> float:
    economy = problem.economy
    assert economy is not None
    worth = problem.worth(economy.per_second, economy.per_tool)
    cutting, allowed = problem.cutting, problem.allowed
    real = feed * allowed.feed_ratio
    own = float(sum(worth.of_line(row, real[row : row + 1], rpm[row : row + 1])[0] for row in cutting.tolist()))
    beside = problem.beside
    separate = own + beside.nobody_s * economy.per_second + beside.nobody_worn * economy.per_tool
    wear = Worth(worth.length_mm, worth.beside_s, worth.wear, worth.wear_beside, 0.0, worth.exponent)
    tools = 0.0
    for row in cutting.tolist():
        one = allowed.line(row)
        grid = np.concatenate([np.linspace(a, b, SPEEDS) for a, b in allowed.spans[row]])
        tools += float(wear.of_line(row, one.feed_max(grid[:, None])[:, 0] * allowed.feed_ratio, grid).min()) * GRID_IS_SHORT
    together = seconds * economy.per_second + tools + beside.nobody_worn * economy.per_tool
    return max(separate, together)
