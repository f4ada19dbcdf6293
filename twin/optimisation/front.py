"""The search for the front of time and cost: NSGA-II (Deb et al. 2002, IEEE Trans. Evol. Comput. 6(2)) of pymoo, in batches.

It begins with the closed form of each line for a sweep of what a second is worth: where lines do not depend on each other,
those are points of the exact front. Every few evolutions the population is put down and taken up again, so that a search that
was stopped there goes on as if it had not been.
"""

import importlib.util
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from twin.errors import OptimisationError
from twin.optimisation.answer import Objective
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem
from twin.optimisation.seeds import seeds

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def evolve_front(question: Question, island: int, state: Mapping[str, Any] | None, evolutions: int) -> dict[str, Any]:
    """The population some evolutions on: {"genes", "values": seconds and cost, "evaluations", "history": hypervolumes, "epoch"}.

    Raises OptimisationError where pymoo is not installed.
    """
    if importlib.util.find_spec("pymoo") is None:
        raise OptimisationError("a front needs pymoo; install cnctwin[optimise]")
    made = problem(question)
    if state is None:
        chance = np.random.default_rng([question.seed, island])
        genes = chance.random((question.population, made.genes))
        known = seeds(made, Objective.PARETO)[: question.population]
        genes[: len(known)] = known
        epoch, evaluations, history = 0, 0, []
    else:
        genes = np.array(state["genes"], dtype=np.float64)
        epoch, evaluations, history = int(state["epoch"]), int(state["evaluations"]), list(state["history"])
    genes, values, more, volumes = _nsga2(made, genes, evolutions, [question.seed, island, epoch])
    return {
        "genes": genes.tolist(),
        "values": values.tolist(),
        "evaluations": evaluations + more,
        "history": history + volumes,
        "epoch": epoch + 1,
    }


def _nsga2(made: Problem, genes: Floats, evolutions: int, chance: list[int]) -> tuple[Floats, Floats, int, list[float]]:
    from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: PLC0415 - an extra, and slow to import
    from pymoo.core.problem import Problem as Vectorised  # noqa: PLC0415
    from pymoo.operators.crossover.sbx import SBX  # noqa: PLC0415
    from pymoo.operators.mutation.pm import PM  # noqa: PLC0415
    from pymoo.optimize import minimize  # noqa: PLC0415

    count = made.genes
    volumes: list[float] = []

    class Program(Vectorised):  # type: ignore[misc]
        """Seconds and cost of a whole population at once."""

        def __init__(self) -> None:
            super().__init__(n_var=count, n_obj=2, xl=np.zeros(count), xu=np.ones(count))

        def _evaluate(self, x: Floats, out: dict[str, Any], *_args: object, **_named: object) -> None:
            out["F"] = np.column_stack(made.evaluate(x))

    reference = np.array([*made.as_programmed()]).ravel() * 1.5

    def note(algorithm: Any) -> None:
        volumes.append(hypervolume(algorithm.pop.get("F"), reference))

    seed = int(np.random.SeedSequence(chance).generate_state(1)[0])
    algorithm = NSGA2(
        pop_size=len(genes),
        sampling=genes,
        crossover=SBX(eta=20, prob=0.9),
        mutation=PM(eta=20),
        eliminate_duplicates=True,
    )
    found = minimize(
        Program(), algorithm, ("n_gen", evolutions + 1), seed=seed, callback=note, verbose=False, copy_algorithm=False
    )
    population = found.pop
    return population.get("X"), population.get("F"), int(found.algorithm.evaluator.n_eval), volumes


def not_dominated(values: Floats) -> Ints:
    """Numbers of the points (n, 2) that no other is better than, by their first figure.

    >>> not_dominated(np.array([[1.0, 5.0], [2.0, 5.0], [3.0, 1.0], [1.0, 5.0]])).tolist()
    [0, 2]
    """
    order = np.lexsort((values[:, 1], values[:, 0]))
    kept, least = [], np.inf
    for k in order.tolist():
        if values[k, 1] < least:
            kept.append(k)
            least = values[k, 1]
    return np.array(kept, dtype=np.int64)


def hypervolume(values: Floats, reference: Floats) -> float:
    """The area that points (n, 2) dominate below a reference point.

    >>> hypervolume(np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([3.0, 3.0]))
    3.0
    """
    points = values[not_dominated(values)]
    points = points[np.all(points < reference, axis=1)]
    right = np.append(points[1:, 0], reference[0])
    return float(np.sum((right - points[:, 0]) * (reference[1] - points[:, 1])))


def knee(values: Floats) -> int:
    """The point of a front (n, 2), in its order, that is farthest from the line between its ends; both figures scaled to 1.

    >>> knee(np.array([[1.0, 10.0], [2.0, 3.0], [9.0, 1.0]]))
    1
    """
    low, high = values.min(axis=0), values.max(axis=0)
    if len(values) < 3 or np.any(high <= low):
        return 0
    scaled = (values - low) / (high - low)
    return int(np.argmin(scaled.sum(axis=1)))
