"""The place within a line: when it began, from where the machine was in the line before."""

import random
from itertools import pairwise

import pytest

from processors.expected.place import BLOCK_S_MAX, Extra, Place, began, placed, window_mm
from twin.expected.expectation import Expectation
from twin.expected.expected import Run, Stretch
from twin.expected.lines import Numbering

LENGTH_MM, FEED_MM_MIN, MM_S, LINES = 113.0, 1200.0, 20.0, 120


def program(lines: int = LINES) -> Expectation:
    """A program of lines that are alike, one after another."""
    once = LENGTH_MM / MM_S
    runs = tuple(
        Run(line, 1, FEED_MM_MIN, 4000.0, 10.0, LENGTH_MM, once, (Stretch(LENGTH_MM, (100.0,)),)) for line in range(1, lines + 1)
    )
    return Expectation("O1", "m", Numbering.N_WORDS, runs, None, ())


def followed(block_s: float, *, every_s: float = 1.0, hold_in: int = 0, seed: int = 1) -> list[tuple[Place, float, float]]:
    """The places of a machine that takes block_s more for each line; beside each its true way, and its line's begin."""
    given, chance, place, found = program(), random.Random(seed), Place(), []
    at_s, lasts_s, begins = chance.random(), LENGTH_MM / MM_S + block_s, [0.0]
    for line in range(1, LINES + 1):
        begins.append(begins[-1] + lasts_s + (7.3 if line == hold_in else 0.0))
    while at_s < begins[-1] - 1e-6:
        line = max(k for k, begin in enumerate(begins[:-1]) if begin <= at_s) + 1
        since_s = at_s - begins[line - 1]
        held_s = min(max(since_s - 2.0, 0.0), 7.3) if line == hold_in else 0.0
        feed = 0.0 if 0.0 < held_s < 7.3 else FEED_MM_MIN
        where = ("O1", line, 1)
        begun = began(given, place, where, at_s, 1.0) if line != place.line else None
        place = placed(place, where, at_s, feed, FEED_MM_MIN, begins=begun)
        found.append((place, min(LENGTH_MM, MM_S * (since_s - held_s)), begins[line - 1]))
        at_s += every_s
    return found


@pytest.mark.parametrize("block_s", [0.0, 0.03, 0.12, -0.04])
def test_the_machine_is_within_the_window_and_the_doubt_shrinks(block_s: float) -> None:
    told = followed(block_s)[8:]
    for place, way_mm, _ in told:
        window = window_mm(place)
        assert window is not None and window[0] <= way_mm <= window[1] + 1e-6
    doubts = sorted(place.doubt_mm / MM_S for place, *_ in told[len(told) // 2 :])
    assert doubts[len(doubts) // 2] < 0.7


def test_what_a_line_takes_beyond_the_plan_is_learned() -> None:
    assert followed(0.12)[-1][0].extra.block_s == pytest.approx(0.12, abs=0.04)


def test_a_hold_in_a_line_moves_nothing() -> None:
    told = followed(0.0, hold_in=60)
    assert all(place.along_mm - 0.5 * MM_S <= way <= place.along_mm + place.doubt_mm + 1.0 * MM_S for place, way, _ in told[8:])
    assert told[-1][0].extra.block_s == pytest.approx(0.0, abs=0.05)


def test_another_program_or_a_jump_leaves_the_samples_alone() -> None:
    given, place = program(), followed(0.0)[50][0]
    told_s = place.at_s + 1.0
    for where in (("O2", 3, 1), ("O1", 1, 1), ("O1", LINES, 1)):
        found = began(given, place, where, told_s, 1.0)
        assert (found.from_s, found.to_s) == (place.at_s, told_s), where


def test_an_expectation_with_fewer_lines_than_the_place_is_in_is_none_to_follow() -> None:
    place = followed(0.0)[-1][0]
    assert began(program(2), place, ("O1", 1, 1), place.at_s + 1.0, 1.0).from_s == place.at_s


def test_a_block_is_bounded() -> None:
    found = Extra()
    for _ in range(1000):
        found = found.after(1.9, 1)
    assert found.block_s == BLOCK_S_MAX
    assert found.after(5.0, 1) == found


def test_along_never_goes_back_within_a_line() -> None:
    told = [place for place, *_ in followed(0.05)]
    assert all(after.along_mm >= before.along_mm for before, after in pairwise(told) if before.line == after.line)
