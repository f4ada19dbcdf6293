"""The lines of a program in the order in which they are executed."""

import numpy as np
import pytest

from twin.motion.path import Path, path_from_moves
from twin.programs import interpret
from twin.recording.visits import by_visit, visits

TWICE = "G21 G90 F1000\nG1 X10\nM98 P7\nG1 X20\nM98 P7\nM30\nO7\nG91 G1 Y5\nG1 Y-5\nG90\nM99\n"


def path_of(text: str) -> Path:
    return path_from_moves(interpret(text))


def test_lines_that_ascend_are_their_own_visits() -> None:
    path, told = path_of("G21 G90\nG1 X10 F1000\nG1 X20\nM30\n"), np.array([-1, 0, 1, 2, 3])
    same, seen, source = by_visit(path, told, 4)
    assert same is path and seen is told and source.tolist() == [0, 1, 2, 3]


def test_a_subprogram_that_is_called_twice_is_visited_twice() -> None:
    path = path_of(TWICE)
    assert visits(path).tolist() == [1, 7, 8, 3, 7, 8, 5]
    numbered, _, source = by_visit(path, np.array([1]), 11)
    assert numbered.line.tolist() == [0, 1, 2, 3, 4, 5] and numbered.events[-1].line == 6
    assert source[numbered.line].tolist() == path.line.tolist()


@pytest.mark.parametrize(
    ("told", "seen"),
    [
        ([1, 7, 8, 3, 7, 8, 5], [0, 1, 2, 3, 4, 5, 6]),
        ([1, 1, 8, 3, 7, 5], [0, 0, 2, 3, 4, 6]),
        ([-1, 1, 2, 7, 9, 3], [-1, 0, 0, 1, 1, 3]),
        ([1, 7, 12], [0, 1, 8]),
    ],
    ids=["each line", "lines missed", "lines without a move", "a line of another program"],
)
def test_a_recorded_line_is_its_next_visit(told: list[int], seen: list[int]) -> None:
    assert by_visit(path_of(TWICE), np.array(told), 11)[1].tolist() == seen
