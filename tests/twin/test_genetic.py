"""The genetic algorithm: what holds of any search with it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.errors import TwinError
from twin.genetic import Evolved, GeneticSettings, evolve

LOW, HIGH = np.array([-2.0, 0.0, 5.0]), np.array([3.0, 1.0, 6.0])


def distance(genes: np.ndarray) -> np.ndarray:
    return np.asarray(((genes - [1.0, 0.25, 5.5]) ** 2).sum(axis=1))


def searched(seed: int, evolutions: int = 20, limit: float = -np.inf, population: int = 16) -> tuple[Evolved, list[np.ndarray]]:
    seen: list[np.ndarray] = []

    def objective(genes: np.ndarray) -> np.ndarray:
        seen.append(genes.copy())
        return distance(genes)

    return evolve(objective, LOW, HIGH, GeneticSettings(evolutions, limit, population=population), seed), seen


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([4, 16, 64]))
def test_a_search_keeps_to_its_bounds_and_never_loses_its_best(seed: int, population: int) -> None:
    found, seen = searched(seed, population=population)
    tried = np.concatenate(seen)
    assert (tried >= LOW).all()
    assert (tried <= HIGH).all()
    assert (np.diff(found.history) <= 0.0).all()
    assert found.objective == found.history[-1] == distance(tried).min()
    assert found.evaluations == len(tried)


def test_the_same_seed_takes_the_same_course_and_another_one_another() -> None:
    first, again, other = searched(7)[0], searched(7)[0], searched(8)[0]
    assert np.array_equal(first.history, again.history)
    assert np.array_equal(first.genes, again.genes)
    assert not np.array_equal(first.history, other.history)


def test_a_generation_is_one_batch_and_replaces_the_gap() -> None:
    found, seen = searched(1, evolutions=5)
    assert [len(batch) for batch in seen] == [16, 14, 14, 14, 14, 14]
    assert len(found.history) == 6


def test_it_ends_at_the_fitness_limit_and_was_the_same_search_until_then() -> None:
    whole = searched(3, evolutions=60)[0]
    limit = float(whole.history[10])
    ended = searched(3, evolutions=60, limit=limit)[0]
    assert ended.objective <= limit
    assert len(ended.history) <= 11
    assert np.array_equal(ended.history, whole.history[: len(ended.history)])


@pytest.mark.parametrize("seed", range(5))
def test_it_finds_the_bottom_of_a_valley_and_of_many(seed: int) -> None:
    bowl = evolve(distance, LOW, HIGH, GeneticSettings(150, -np.inf), seed)
    assert bowl.objective < 1e-5

    def ripples(genes: np.ndarray) -> np.ndarray:
        return np.asarray((genes**2 + 10.0 * (1.0 - np.cos(2.0 * np.pi * genes))).sum(axis=1))

    rippled = evolve(ripples, np.full(3, -5.12), np.full(3, 5.12), GeneticSettings(300, -np.inf), seed)
    assert rippled.objective < 1.5  # at most one gene is in the valley beside the deepest one


def test_an_optimum_on_a_bound_is_reached() -> None:
    found = evolve(lambda genes: genes.sum(axis=1), LOW, HIGH, GeneticSettings(200, -np.inf), 1)
    assert found.objective == pytest.approx(LOW.sum(), abs=1e-3)


def test_a_candidate_without_a_figure_never_wins() -> None:
    found = evolve(lambda genes: np.where(genes[:, 0] > 0.5, np.nan, -genes[:, 0]), LOW, HIGH, GeneticSettings(50, -np.inf), 1)
    assert 0.49 < found.genes[0] <= 0.5


@pytest.mark.parametrize("wrong", [{"population": 7}, {"population": 2}, {"generation_gap": 0.0}, {"generation_gap": 1.5}])
def test_settings_that_mean_nothing_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(TwinError, match="has to be"):
        GeneticSettings(10, 0.0, **wrong)  # type: ignore[arg-type]


def test_bounds_with_nothing_between_them_are_refused() -> None:
    with pytest.raises(TwinError, match=r"gene 1 .* 2 and 2"):
        evolve(distance, np.array([0.0, 2.0]), np.array([1.0, 2.0]), GeneticSettings(1, 0.0), 1)
