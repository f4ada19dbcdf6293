"""What a run log says of each line, whichever way it counts lines."""

import numpy as np
import pytest

from twin.errors import RunLogError
from twin.optimisation.planned import planned_cuts
from twin.programs import Settings
from twin.runlog import RunLog, run_log

DEPTHS = [0.2, 0.2, 2.0]


def program(first: int, step: int) -> str:
    numbers = [first + step * k for k in range(6)]
    words = ["S6000 M3", "G0 Z1", "G1 X10 F400", "X20", "X30", "G0 Z9"]
    return "%\nO1 (PART)\n" + "".join(f"N{n} {word}\n" for n, word in zip(numbers, words, strict=True)) + "M30\n%\n"


def recorded(lines: list[int], depths: list[float]) -> RunLog:
    """Two rows a line."""
    twice = np.repeat(np.array([lines, depths]), 2, axis=1)
    zero = np.zeros(len(twice[0]))
    return run_log({
        "t_s": np.arange(len(zero)) * 0.1, "line": twice[0], "axial_depth_mm": twice[1], "entry_angle_rad": zero,
        "exit_angle_rad": zero + np.pi,
    }, "run.csv")  # fmt: skip


@pytest.mark.parametrize(("first", "step"), [(1, 1), (3, 1), (10, 10), (1000, 1)])
def test_n_words_and_indices_say_the_same(first: int, step: int) -> None:
    text = program(first, step)
    depths = [0.0, 0.0, *DEPTHS, 0.0]
    by_index = planned_cuts(recorded([2, 3, 4, 5, 6, 7], depths), text, Settings())
    by_word = planned_cuts(recorded([first + step * k for k in range(6)], depths), text, Settings())
    assert by_index == by_word == {4: [[0.2, 0.0, np.pi]], 5: [[0.2, 0.0, np.pi]], 6: [[2.0, 0.0, np.pi]]}


def test_a_run_of_another_program_is_refused_by_the_line_that_it_has_not_got() -> None:
    with pytest.raises(RunLogError, match=r"run.csv: line 1000 cuts, and the program has no such feed line"):
        planned_cuts(recorded([1000, 1010], [0.5, 0.5]), program(1, 1), Settings())


def test_what_can_be_read_both_ways_is_refused() -> None:
    text = "".join(f"N{n} G1 X{n} F400\n" for n in range(2, 12)) + "M30\n"
    with pytest.raises(RunLogError, match="its lines can be N words of the program or line numbers from 0"):
        planned_cuts(recorded([4, 5], [0.5, 0.5]), text, Settings())


def test_where_nothing_cuts_nothing_is_found() -> None:
    assert planned_cuts(recorded([2, 3], [0.0, 0.0]), program(1, 1), Settings()) == {}
