"""The search for one objective: populations that evolve beside each other, and what of them travels to a worker.

`evolve_piece` takes a text and gives a text, so that a piece can be worked out anywhere, or again where a worker was lost: a
population carries the state of its chance, and takes the same course wherever it is taken on.
"""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.genetic import GeneticSettings, Population, first_population, step
from twin.genetic import Objective as Fitness
from twin.optimisation.answer import Objective
from twin.optimisation.front import evolve_front
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem
from twin.optimisation.seeds import seeds

Floats = NDArray[np.float64]
TIE = 1e-7
POLISHINGS_MAX, POLISHED_MAX = 30, 400
POLISH = 40.0
"""Distribution index of crossover and mutation: the population begins close to the optimum, so that children stay close."""


def evolve_piece(text: str) -> str:
    """One island, some evolutions on. text: {"question", "island", "state": null = from the start, "evolutions"} → the state."""
    piece: dict[str, Any] = json.loads(text)
    question = Question.from_json(piece["question"])
    if question.objective is Objective.PARETO:
        return json.dumps(evolve_front(question, int(piece["island"]), piece["state"], int(piece["evolutions"])))
    made = problem(question)
    fitness = fitness_of(made, question.objective)
    settings = GeneticSettings(
        evolutions_max=question.evolutions,
        fitness_limit=-np.inf,
        population=question.population,
        crossover_index=POLISH,
        mutation_index=POLISH,
    )
    low, high = np.zeros(made.genes), np.ones(made.genes)
    if piece["state"] is None:
        chance = [question.seed, int(piece["island"])]
        now = first_population(fitness, low, high, settings, chance, seeds(made, question.objective))
    else:
        now = Population.from_json(piece["state"])
    for _ in range(int(piece["evolutions"])):
        now = step(now, fitness, low, high, settings)
    return json.dumps(now.to_json())


def fitness_of(made: Problem, objective: Objective) -> Fitness:
    """Return the fitness that is made small: cost; or seconds, of those that are equally fast the cheapest."""
    at_first = made.as_programmed()

    def fitness(genes: Floats) -> Floats:
        seconds, cost = made.evaluate(genes)
        if objective is not Objective.TIME:
            return cost
        return seconds if made.economy is None else seconds * (1.0 + TIE * cost / at_first.cost[0])

    return fitness


def polished(made: Problem, genes: Floats, fitness: Fitness) -> tuple[Floats, int]:
    """The candidate (p,) with every feed at its highest, and single groups at the speed of a neighbour, where that is better.

    Also says how many evaluations that took.
    """
    lines, groups, places = len(made.allowed), made.groups, len(made.groups)
    full = genes.copy()
    full[:lines] = 1.0
    value = fitness(np.array([genes, full]))
    best, least = (full, value[1]) if value[1] <= value[0] else (genes, value[0])
    evaluations = 2
    for _ in range(POLISHINGS_MAX if 1 < places <= POLISHED_MAX else 0):
        _, rpm = made.decoded(best[None])
        tried = []
        for place in range(places):
            for other in (place - 1, place + 1):
                if 0 <= other < places:
                    changed = rpm[0].copy()
                    changed[groups.rows[place]] = rpm[0, groups.lead[other]]
                    one = best.copy()
                    one[lines + place] = made.encoded(made.allowed.feed_max(changed[None])[0], changed)[lines + place]
                    tried.append(one)
        values = fitness(np.array(tried))
        evaluations += len(tried)
        k = int(np.argmin(values))
        if values[k] >= least:
            break
        best, least = tried[k], values[k]
    return best, evaluations
