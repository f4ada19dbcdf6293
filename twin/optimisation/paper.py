"""The reference paper's own search, with its stated settings, beside the exact bound.

    J_mt = T + w Σ max(0, F − F_lim),     J_pc = C_p + w Σ max(0, F − F_lim),     genes: feed and speed of each line

The paper states 10 evolutions and a fitness limit of 10 for the time, which is never reached, and nothing for the cost.
Assumed here: the same for the cost, a population of 64, w = 1 for each newton of each line, a random start, the operators of
`twin.genetic`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.genetic import GeneticSettings, evolve
from twin.optimisation.allowed import limits_of
from twin.optimisation.answer import Objective
from twin.optimisation.bound import bound_of
from twin.optimisation.forces import CutForces
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem, single

Floats = NDArray[np.float64]
EVOLUTIONS, FITNESS_LIMIT, POPULATION = 10, 10.0, 64
PENALTY_PER_N = 1.0


@dataclass(frozen=True, slots=True)
class PaperSearch:
    """The result of a search: seconds, cost, greatest force; distance: of the objective above the exact bound, relative."""

    objective: Objective
    seconds: float
    cost: float | None
    force_n: float
    distance: float
    evaluations: int
    took_s: float


def paper_search(question: Question, clock: Callable[[], float] = lambda: 0.0, evolutions: int = EVOLUTIONS) -> PaperSearch:
    """The search on a question, by the seed of the question. Raises as `twin.optimisation.question.problem`."""
    made, objective = problem(question), single(question.objective)
    forces = CutForces.of(made.program)
    limits = limits_of(made.program.machine, question.force_limit_n)
    limit_n = np.inf if limits.force_n is None else limits.force_n
    lines, groups = len(made.allowed), len(made.groups)
    low = np.concatenate([np.full(lines, limits.feed_mm_min[0]), np.full(groups, limits.spindle_rpm[0])])
    high = np.concatenate([np.full(lines, limits.feed_mm_min[1]), np.full(groups, limits.spindle_rpm[1])])

    def words(genes: Floats) -> tuple[Floats, Floats]:
        return genes[:, :lines], made.each_of(genes[:, lines:])

    def fitness(genes: Floats) -> Floats:
        feed, rpm = words(genes)
        seconds, cost = made.evaluate_words(feed, rpm)
        over = np.maximum(forces_of_lines(made, forces, feed, rpm) - limit_n, 0.0).sum(axis=1)
        return np.asarray((seconds if objective is Objective.TIME else cost) + PENALTY_PER_N * over)

    began = clock()
    settings = GeneticSettings(evolutions_max=evolutions, fitness_limit=FITNESS_LIMIT, population=POPULATION)
    found = evolve(fitness, low, high, settings, question.seed)
    took_s = clock() - began
    feed, rpm = words(found.genes[None])
    seconds, cost = (float(values[0]) for values in made.evaluate_words(feed, rpm))
    value = seconds if objective is Objective.TIME else cost
    return PaperSearch(
        objective=objective,
        seconds=seconds,
        cost=cost if made.economy is not None else None,
        force_n=float(forces_of_lines(made, forces, feed, rpm).max(initial=0.0)),
        distance=value / bound_of(made, objective, value).value - 1.0,
        evaluations=found.evaluations,
        took_s=took_s,
    )


def forces_of_lines(made: Problem, forces: CutForces, feed: Floats, rpm: Floats) -> Floats:
    """Greatest force of each line, (candidates, lines of `Allowed`), N."""
    rows = {int(k): row for row, k in enumerate(made.allowed.index)}
    own = np.array([rows.get(int(line), -1) for line in made.program.cuts.line], dtype=np.int64)
    mine = np.flatnonzero(own >= 0)
    out = np.zeros(feed.shape)
    if len(mine):
        row = own[mine]
        advance = feed[:, row] * made.control.feed_ratio / (forces.teeth[mine] * rpm[:, row])
        peak = forces.peaks_n(mine, advance)
        for place, one in enumerate(row.tolist()):
            out[:, one] = np.maximum(out[:, one], peak[:, place])
    return out
