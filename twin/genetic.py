"""A plain genetic algorithm with real genes, as the reference paper searches with; every generation is one batch.

Tournament selection, simulated binary crossover (Deb, Agrawal 1995, Complex Systems 9, 115), polynomial mutation (Deb, Goyal
1996, Computer Science and Informatics 26(4), 30), both in their forms that keep to the bounds; a part of the population is
replaced at each evolution (generation gap: De Jong 1975), and the best of the rest stay, so the best is never lost.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from twin.errors import TwinError

Floats = NDArray[np.float64]
Objective = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True)
class GeneticSettings:
    """The settings of a search.

    evolutions_max, fitness_limit: it ends after so many evolutions, or when the best objective is not above the limit
    population: candidates; generation_gap: part of them that is replaced at each evolution
    tournament: candidates of which the best becomes a parent
    crossover_rate: of a pair; mutation_rate: of a gene, None = one gene a child on average
    crossover_index, mutation_index: the greater, the closer children are to their parents
    """

    evolutions_max: int
    fitness_limit: float
    population: int = 64
    generation_gap: float = 0.9
    tournament: int = 2
    crossover_rate: float = 0.9
    mutation_rate: float | None = None
    crossover_index: float = 15.0
    mutation_index: float = 20.0

    def __post_init__(self) -> None:
        if self.population < 4 or self.population % 2:
            raise TwinError(f"the population is {self.population}; it has to be an even number from 4 on")
        if not 0.0 < self.generation_gap <= 1.0:
            raise TwinError(f"the generation gap is {self.generation_gap}; it has to be more than 0 and at most 1")

    @property
    def children(self) -> int:
        """Candidates that an evolution replaces: even, and never all of them.

        >>> GeneticSettings(evolutions_max=10, fitness_limit=0.0).children
        56
        """
        return min(max(2, int(self.population * self.generation_gap) // 2 * 2), self.population - 2)


@dataclass(frozen=True, slots=True, eq=False)
class Population:
    """The state of a search: candidates with their objectives, and the random generator's. `step` takes it on.

    genes: (population, p); fitness: (population,); history: best objective after each evolution, that of the start first
    """

    genes: Floats
    fitness: Floats
    history: tuple[float, ...]
    evaluations: int
    chance: dict[str, Any]

    @property
    def best(self) -> int:
        """Number of the best candidate."""
        return int(np.argmin(self.fitness))

    def to_json(self) -> dict[str, Any]:
        """Everything, exactly: a population that was read back takes the same course."""
        return {
            "genes": self.genes.tolist(),
            "fitness": [value if math.isfinite(value) else None for value in self.fitness.tolist()],
            "history": list(self.history),
            "evaluations": self.evaluations,
            "chance": self.chance,
        }

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The population that `to_json` wrote."""
        fitness = np.array([math.inf if value is None else value for value in values["fitness"]], dtype=np.float64)
        genes = np.array(values["genes"], dtype=np.float64)
        return cls(genes, fitness, tuple(values["history"]), int(values["evaluations"]), dict(values["chance"]))


@dataclass(frozen=True, slots=True, eq=False)
class Evolved:
    """The result: genes (p,) and objective of the best; history: (evolutions + 1,) best objective after each evolution."""

    genes: Floats
    objective: float
    history: Floats
    evaluations: int


def evolve(objective: Objective, low: Floats, high: Floats, settings: GeneticSettings, seed: int) -> Evolved:
    """Searches the least `objective` within the bounds; the same seed takes the same course.

    objective: genes (candidates, p) → (candidates,), NaN = no candidate; low, high: (p,)

    >>> settings = GeneticSettings(evolutions_max=200, fitness_limit=1e-6)
    >>> found = evolve(lambda x: ((x - 3.0) ** 2).sum(axis=1), np.zeros(2), np.full(2, 10.0), settings, seed=1)
    >>> found.objective <= 1e-6, found.genes.round(2).tolist()
    (True, [3.0, 3.0])

    Raises TwinError where the bounds leave nothing between them.
    """
    now = first_population(objective, low, high, settings, seed)
    while len(now.history) <= settings.evolutions_max and now.history[-1] > settings.fitness_limit:
        now = step(now, objective, low, high, settings)
    return Evolved(now.genes[now.best], float(now.fitness[now.best]), np.array(now.history), now.evaluations)


def first_population(
    objective: Objective,
    low: Floats,
    high: Floats,
    settings: GeneticSettings,
    seed: int | Sequence[int],
    known: Floats | None = None,
) -> Population:
    """The population to begin with: drawn evenly within the bounds, the first of them replaced by `known` candidates (k, p).

    Raises TwinError where the bounds leave nothing between them.
    """
    if not np.all(low < high):
        k = int(np.argmin(high - low))
        raise TwinError(f"gene {k} has nothing between its bounds {low[k]:g} and {high[k]:g}")
    chance = np.random.default_rng(seed)
    genes = low + (high - low) * chance.random((settings.population, len(low)))
    if known is not None:
        seeds = np.clip(known[: settings.population], low, high)
        genes[: len(seeds)] = seeds
    fitness = _fitness(objective, genes)
    return Population(genes, fitness, (float(fitness.min()),), len(genes), dict(chance.bit_generator.state))


def step(now: Population, objective: Objective, low: Floats, high: Floats, settings: GeneticSettings) -> Population:
    """One evolution: `settings.children` of the candidates are replaced, the best of the rest stay."""
    chance = np.random.default_rng()
    chance.bit_generator.state = now.chance
    parents = now.genes[_tournaments(now.fitness, settings, chance)]
    children = _mutated(_crossed(parents, low, high, settings, chance), low, high, settings, chance)
    best = np.argsort(now.fitness, kind="stable")[: settings.population - settings.children]
    genes = np.concatenate([now.genes[best], children])
    fitness = np.concatenate([now.fitness[best], _fitness(objective, children)])
    history = (*now.history, float(fitness.min()))
    return Population(genes, fitness, history, now.evaluations + len(children), dict(chance.bit_generator.state))


def _fitness(objective: Objective, genes: Floats) -> Floats:
    value = np.asarray(objective(genes), dtype=np.float64)
    return np.where(np.isfinite(value), value, np.inf)


def _tournaments(fitness: Floats, settings: GeneticSettings, chance: np.random.Generator) -> NDArray[np.intp]:
    """Numbers of the parents, (children,)."""
    drawn = chance.integers(len(fitness), size=(settings.children, settings.tournament))
    return np.asarray(drawn[np.arange(len(drawn)), np.argmin(fitness[drawn], axis=1)])


def _crossed(parents: Floats, low: Floats, high: Floats, settings: GeneticSettings, chance: np.random.Generator) -> Floats:
    """Children of neighbouring parents: spread about their mean as far as the parents are apart, less towards a bound."""
    first, second = parents[0::2], parents[1::2]
    near, far = np.minimum(first, second), np.maximum(first, second)
    apart = np.maximum(far - near, 1e-14 * (high - low))
    drawn = chance.random(near.shape)
    power = 1.0 / (settings.crossover_index + 1.0)
    sides = []
    for margin in (near - low, high - far):
        widest = 2.0 - (1.0 + 2.0 * margin / apart) ** -(settings.crossover_index + 1.0)
        inner = drawn * widest
        sides.append(np.where(inner <= 1.0, inner**power, (1.0 / np.maximum(2.0 - inner, 1e-300)) ** power))
    middle = 0.5 * (near + far)
    below, above = middle - 0.5 * sides[0] * apart, middle + 0.5 * sides[1] * apart
    swapped = chance.random(near.shape) < 0.5
    one, other = np.where(swapped, above, below), np.where(swapped, below, above)
    pairs = chance.random((len(near), 1)) < settings.crossover_rate
    genes = pairs & (chance.random(near.shape) < 0.5)
    children = np.empty_like(parents)
    children[0::2], children[1::2] = np.where(genes, one, first), np.where(genes, other, second)
    return np.clip(children, low, high)


def _mutated(genes: Floats, low: Floats, high: Floats, settings: GeneticSettings, chance: np.random.Generator) -> Floats:
    """Some genes moved by a polynomial of a drawn number, less towards a bound."""
    rate = 1.0 / genes.shape[1] if settings.mutation_rate is None else settings.mutation_rate
    chosen = chance.random(genes.shape) < rate
    drawn = chance.random(genes.shape)
    power = settings.mutation_index + 1.0
    width = high - low
    to_low, to_high = 1.0 - (genes - low) / width, 1.0 - (high - genes) / width
    down = (2.0 * drawn + (1.0 - 2.0 * drawn) * to_low**power) ** (1.0 / power) - 1.0
    up = 1.0 - (2.0 * (1.0 - drawn) + (2.0 * drawn - 1.0) * to_high**power) ** (1.0 / power)
    with np.errstate(invalid="ignore"):
        moved = genes + np.where(drawn < 0.5, down, up) * width
    return np.clip(np.where(chosen, moved, genes), low, high)
