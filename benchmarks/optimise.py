#!/usr/bin/env python3
"""The optimiser beside the exact optimum, an exhaustive search, the reference paper's own search, and other optimisers.

    .venv/bin/python benchmarks/optimise.py [--json] [--case FOLDER]

* paper: the reference paper's benchmark by reconstruction constants (they are not the authors' values): answer, exact
optimum, and
  the paper's own settings from a random start, medians of 8 seeds
* front: three slots for which time and cost disagree, with a spindle that takes time to change; the front beside all speeds
of a grid
* speed: evaluations a second of one batch, and of pymoo, DEAP and scipy that ask the same simulator for one candidate at a time
* case: a case whose machine has an edge force, diagnosed, and optimised on the twin before and after (CNCTWIN_CASES, or
../shared/cases)

How the search spreads over processes and a Dask cluster, one worker of which is killed: benchmarks/spread.py.
"""

import argparse
import json
import os
import random
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.batch.diagnosis import in_threads
from twin.case import read_case
from twin.genetic import GeneticSettings, evolve
from twin.machine import Limits
from twin.machine_toml import machine_to_toml
from twin.optimisation.answer import Objective
from twin.optimisation.front import hypervolume, not_dominated
from twin.optimisation.islands import fitness_of
from twin.optimisation.optimise import Hooks, optimise
from twin.optimisation.paper import paper_search
from twin.optimisation.planned import planned_cuts
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem
from twin.runlog import read_run

Floats = NDArray[np.float64]
HERE = Path(__file__).resolve().parent
SEEDS = range(8)
STEP_RPM = 100.0
POPULATION, EVOLUTIONS = 64, 20


def question(name: str, **changes: Any) -> Question:
    """One of the two benchmarks."""
    files = [(HERE / f"optimise_{name}.{ending}").read_text() for ending in ("nc", "toml")]
    return Question(files[0], files[1], name=name).with_(**changes)


def paper() -> list[dict[str, Any]]:
    """Ours and the paper's search on the reconstruction, by both objectives."""
    rows = []
    for objective in (Objective.TIME, Objective.COST):
        asked = question("paper", objective=objective)
        optimise(asked.with_(evolutions=1))  # compiles
        began = time.perf_counter()
        ours = optimise(asked, Hooks(clock=time.perf_counter))
        took_s = time.perf_counter() - began
        theirs = [paper_search(asked.with_(seed=seed), time.perf_counter) for seed in SEEDS]
        value = [(one.seconds if objective is Objective.TIME else one.cost) for one in theirs]
        rows.append(
            {
                "objective": str(objective),
                "before": [ours.before.seconds, ours.before.cost],
                "after": [ours.after.seconds, ours.after.cost],
                "change_pct": [
                    100 * (a / b - 1) for a, b in ((ours.after.seconds, ours.before.seconds), (ours.after.cost, ours.before.cost))
                ],
                "force_n": ours.after.force_n,
                "optimum": ours.bound.value,
                "distance_pct": 100 * ours.bound.distance,
                "exact": ours.bound.exact,
                "seconds": took_s,
                "paper_median": statistics.median(value),
                "paper_distance_pct": 100 * statistics.median(one.distance for one in theirs),
                "paper_force_n": max(one.force_n for one in theirs),
            }
        )
    return rows


def front() -> dict[str, Any]:
    """The front beside all combinations of speeds on a grid, each line at the highest feed that its speed allows."""
    asked = question("second", objective=Objective.PARETO, evolutions=60)
    made = problem(asked)
    began = time.perf_counter()
    answer = optimise(asked)
    took_s = time.perf_counter() - began
    grid = np.arange(3000.0, 8000.0 + 1.0, STEP_RPM)
    speeds = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    began = time.perf_counter()
    every = np.column_stack(made.evaluate_words(made.allowed.feed_max(speeds), speeds))
    exhaustive_s = time.perf_counter() - began
    best, found = every[not_dominated(every)], np.array([[point.seconds, point.cost] for point in answer.front])
    corner = every.max(axis=0)
    return {
        "points": len(found),
        "evaluations": answer.search.evaluations,
        "seconds": took_s,
        "grid": len(every),
        "grid_points": len(best),
        "grid_seconds": exhaustive_s,
        "hypervolume_ratio": hypervolume(found, corner) / hypervolume(best, corner),
        "least_seconds": [float(found[:, 0].min()), float(best[:, 0].min())],
        "least_cost": [float(found[:, 1].min()), float(best[:, 1].min())],
        "ends": [found[0].tolist(), found[-1].tolist()],
    }


def speed(name: str, asked: Question) -> list[dict[str, Any]]:
    """Evaluations a second, each with an overhead of its own in it: what an optimisation of so many evaluations takes."""
    made = problem(asked)
    fitness = fitness_of(made, asked.objective)
    budget = POPULATION * (EVOLUTIONS + 1)
    drivers: list[tuple[str, Callable[[Problem, Callable[[Floats], Floats], int], int]]] = [
        ("ours, one batch a generation", ours_batch),
        ("pymoo GA, one batch a generation", pymoo_batch),
        ("ours, one at a time", ours_single),
        ("pymoo GA, one at a time", pymoo_single),
        ("DEAP (mu + lambda), one at a time", deap_single),
        ("scipy differential evolution, one at a time", scipy_single),
    ]
    rows = []
    for driver, run in drivers:
        run(made, fitness, POPULATION * 2)  # imports and compiles
        best = 0.0
        for _ in range(3):
            began = time.perf_counter()
            count = run(made, fitness, budget)
            best = max(best, count / (time.perf_counter() - began))
        rows.append({"program": name, "genes": made.genes, "driver": driver, "evaluations_per_s": best})
    return rows


def ours_batch(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """The project's own genetic algorithm."""
    settings = GeneticSettings(evolutions_max=budget // POPULATION - 1, fitness_limit=-np.inf, population=POPULATION)
    return evolve(fitness, np.zeros(made.genes), np.ones(made.genes), settings, 1).evaluations


def ours_single(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """The same, asking for one candidate at a time."""
    return ours_batch(made, lambda genes: np.array([fitness(one[None])[0] for one in genes]), budget)


def _pymoo(made: Problem, budget: int, evaluate: Callable[[Floats], Floats], *, elementwise: bool) -> int:
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415
    from pymoo.core.problem import ElementwiseProblem  # noqa: PLC0415
    from pymoo.core.problem import Problem as Vectorised  # noqa: PLC0415
    from pymoo.optimize import minimize  # noqa: PLC0415

    class Program(ElementwiseProblem if elementwise else Vectorised):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=made.genes, n_obj=1, xl=0.0, xu=1.0)

        def _evaluate(self, x: Floats, out: dict[str, Any], *_: object, **__: object) -> None:
            out["F"] = evaluate(x[None])[0] if elementwise else evaluate(x)[:, None]

    found = minimize(Program(), GA(pop_size=POPULATION), ("n_eval", budget), seed=1, verbose=False)
    return int(found.algorithm.evaluator.n_eval)


def pymoo_batch(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """pymoo, vectorised."""
    return _pymoo(made, budget, fitness, elementwise=False)


def pymoo_single(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """pymoo, elementwise."""
    return _pymoo(made, budget, fitness, elementwise=True)


def deap_single(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """DEAP with simulated binary crossover and polynomial mutation."""
    from deap import algorithms, base, creator, tools  # noqa: PLC0415

    if not hasattr(creator, "Fitness"):
        creator.create("Fitness", base.Fitness, weights=(-1.0,))
        creator.create("Individual", list, fitness=creator.Fitness)
    random.seed(1)
    count = 0

    def evaluate(individual: list[float]) -> tuple[float]:
        nonlocal count
        count += 1
        return (float(fitness(np.array(individual)[None])[0]),)

    box = base.Toolbox()
    box.register("gene", random.random)
    box.register("individual", tools.initRepeat, creator.Individual, box.gene, made.genes)
    box.register("population", tools.initRepeat, list, box.individual)
    box.register("evaluate", evaluate)
    box.register("mate", tools.cxSimulatedBinaryBounded, low=0.0, up=1.0, eta=15.0)
    box.register("mutate", tools.mutPolynomialBounded, low=0.0, up=1.0, eta=20.0, indpb=1.0 / made.genes)
    box.register("select", tools.selTournament, tournsize=2)
    algorithms.eaMuPlusLambda(
        box.population(POPULATION), box, POPULATION, POPULATION, 0.7, 0.3, budget // POPULATION - 1, verbose=False
    )
    return count


def scipy_single(made: Problem, fitness: Callable[[Floats], Floats], budget: int) -> int:
    """scipy, not vectorised, without its polishing."""
    from scipy.optimize import differential_evolution  # noqa: PLC0415

    found = differential_evolution(
        lambda genes: float(fitness(genes[None])[0]),
        [(0.0, 1.0)] * made.genes,
        popsize=max(POPULATION // made.genes, 1),
        maxiter=max(budget // (max(POPULATION // made.genes, 1) * made.genes) - 1, 1),
        tol=0.0,
        polish=False,
        seed=1,
    )
    return int(found.nfev)


def case(folder: Path) -> dict[str, Any]:
    """The program of the case's check run, optimised on the twin as stated and as diagnosed; force on the diagnosed one."""
    read = read_case(folder)
    found = in_threads(read)
    run = next(run for run in read.runs if run.entry.role == "check" and run.entry.program)
    text = (folder / str(run.entry.program)).read_text()
    planned = planned_cuts(read_run(folder / run.entry.file), text, read.machine.settings)
    limits = Limits(feed_mm_min=(50.0, 6000.0), spindle_rpm=(1000.0, 6000.0), force_n=400.0)
    twins = {"as stated": read.machine, "diagnosed": found.twin}
    tomls = {name: machine_to_toml(twin.model_copy(update={"limits": limits})) for name, twin in twins.items()}
    answers = {name: optimise(Question(text, toml, name=name, planned=planned), resimulate=False) for name, toml in tomls.items()}
    blind = optimise(Question(answers["as stated"].program, tomls["diagnosed"], planned=planned), resimulate=False)
    return {
        "case": folder.name,
        "diagnosis": found.diagnosis.sentence,
        "limit_n": limits.force_n,
        "lines": [
            {
                "line": one.text_before,
                "depth_mm": one.axial_depth_mm,
                "as_stated": one.after.feed_mm_min,
                "diagnosed": other.after.feed_mm_min,
            }
            for one, other in zip(answers["as stated"].lines, answers["diagnosed"].lines, strict=True)
        ],
        "seconds": {name: answer.after.seconds for name, answer in answers.items()},
        "force_n_of_the_blind_program": blind.before.force_n,
        "force_n": answers["diagnosed"].after.force_n,
    }


def simulated_program() -> Question:
    """The program of the simulated machine, 50 lines that feed, pockets by macro, five tools."""
    folder = HERE.parent / "cnctwin" / "standins" / "simulated_machine"
    text, toml = (folder / "base_plate.nc").read_text(), (folder / "machine.toml").read_text()
    return Question(text, toml, name="base_plate", force_limit_n=400.0)


def shown(result: dict[str, Any]) -> None:
    """The figures as tables."""
    print("reference paper's benchmark, by reconstruction constants")
    for row in result["paper"]:
        before, after, change = row["before"], row["after"], row["change_pct"]
        optimum = f"{row['distance_pct']:.4f} % above the {'exact optimum' if row['exact'] else 'bound'} {row['optimum']:.3f}"
        print(f"  {row['objective']:5}  {before[0]:.2f} s to {after[0]:.2f} s ({change[0]:+.1f} %)", end=", ")
        cost = f"{before[1]:.1f} to {after[1]:.2f} KRW ({change[1]:+.1f} %)"
        print(f"{cost}, {row['force_n']:.2f} N, {optimum}, in {row['seconds']:.2f} s")
        print(f"         the paper's settings: {row['paper_median']:.2f} (median of {len(SEEDS)} seeds)", end=", ")
        print(f"{row['paper_distance_pct']:.0f} % above the optimum, up to {row['paper_force_n']:.1f} N")
    f = result["front"]
    print(f"front, three slots: {f['points']} programs from {f['evaluations']} evaluations in {f['seconds']:.1f} s", end=", ")
    print(f"beside {f['grid_points']} of {f['grid']} on a grid ({f['grid_seconds']:.1f} s)")
    ours, grid = zip(f["least_seconds"], f["least_cost"], strict=True)
    print(f"  hypervolume over the grid's {f['hypervolume_ratio']:.5f}", end="; ")
    print(f"least time {ours[0]:.3f} s (grid {grid[0]:.3f}), least cost {ours[1]:.3f} (grid {grid[1]:.3f})")
    print("evaluations a second")
    for row in result["speed"]:
        own = next(r for r in result["speed"] if r["program"] == row["program"])
        ratio = own["evaluations_per_s"] / row["evaluations_per_s"]
        print(f"  {row['program']:11} {row['genes']:3} genes  {row['driver']:45} {row['evaluations_per_s']:9.0f}  {ratio:5.1f} ×")
    if (found := result["case"]) is not None:
        print(f"{found['case']}: {found['diagnosis']}")
        for line in found["lines"]:
            feeds = f"{line['as_stated']:6.0f} mm/min as stated, {line['diagnosed']:6.0f} as diagnosed"
            print(f"  {line['line']:28} {line['depth_mm']:.1f} mm  {feeds}")
        print(
            f"  the program of the stated twin reaches {found['force_n_of_the_blind_program']:.0f} N on the diagnosed one",
            end=", ",
        )
        print(f"limit {found['limit_n']:.0f} N; its own program {found['force_n']:.1f} N")


def main() -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--case", type=Path, default=None)
    options = parser.parse_args()
    cases = Path(os.environ.get("CNCTWIN_CASES") or HERE.parent.parent / "shared" / "cases")
    folder = options.case or cases / "case_08"
    result = {
        "paper": paper(),
        "front": front(),
        "speed": speed("paper", question("paper", objective=Objective.COST)) + speed("base_plate", simulated_program()),
        "case": case(folder) if folder.exists() else None,
    }
    if options.json:
        print(json.dumps(result))
    else:
        shown(result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
