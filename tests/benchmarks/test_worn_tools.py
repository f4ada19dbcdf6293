"""The machine of the tool wear benchmark, and a slice of the benchmark."""

import pytest

from benchmarks.worn_tools.parts_left import matched, played
from benchmarks.worn_tools.world import World, wear_at
from twin.wear.terms import Terms


def test_a_seed_is_a_history() -> None:
    first, again = (list(World(1).parts(0.2)) for _ in range(2))
    assert first == again
    assert first != list(World(2).parts(0.2))


def test_the_load_rises_over_a_life_and_falls_at_its_end() -> None:
    loads: dict[int, list[float]] = {}
    for part in World(3).parts(3.0):
        for cut, truth in zip(part.cuts, part.tools, strict=True):
            if truth.life == 1 and cut.program == "O1" and cut.load_ratio is not None:
                loads.setdefault(cut.tool, []).append(cut.load_ratio)
    whole = [values for values in loads.values() if len(values) > 60]
    assert whole
    assert all(sum(values[-20:]) > 1.1 * sum(values[:20]) for values in whole)


def test_wear_is_none_at_first_and_whole_at_the_end_of_a_usual_life() -> None:
    assert wear_at(0.0, (0.2, 0.2)) == 0.0
    assert wear_at(1.0, (0.2, 0.2)) == pytest.approx(1.0, abs=1e-6)


def test_replacements_are_matched_one_by_one() -> None:
    assert matched({"1": [100, 400]}, {"1": [110, 900]}) == (2, 1, 1)


def test_a_slice_of_the_benchmark() -> None:
    result = played(3, 5.0, 0.0, Terms())
    there, found, made_up = result.replacements
    assert there > 15
    assert found / there > 0.8
    assert made_up <= 2
    given = [one for one in result.forecasts if one.low is not None]
    assert given
    assert sum((one.low or 0.0) - 1.0 <= one.left <= one.high + 1.0 for one in given) / len(given) > 0.6
