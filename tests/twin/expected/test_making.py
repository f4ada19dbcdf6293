"""An expectation is the simulator's own course, by line: one physics."""

import math
from functools import cache

import numpy as np
import pytest

from tests.twin.expected.machines import BOX, PLATE, machine, plate
from twin.expected.expectation import Expectation
from twin.expected.lines import Numbering
from twin.expected.making import expectation_of
from twin.machine import AddedEffect, MachineFile
from twin.simulator.simulation import Simulation, simulate

WINDOW_TICKS = 50
"""The meter shows a mean over 0.1 s: its middle is so many ticks ago."""
EDGE = AddedEffect(effect="edge_force", parameters={"tangential_n_per_mm": 12.0, "radial_n_per_mm": 8.0})


def load_of(made: Expectation, line: int, run: int) -> float:
    found = made.at(line, run=run)
    assert found is not None
    return found.load_pct


@cache
def simulated(*effects: str) -> tuple[MachineFile, Simulation]:
    described = machine(effects=(EDGE,) if effects else ())
    return described, simulate(described, PLATE)


@pytest.mark.parametrize("effects", [(), ("edge_force",)])
def test_the_load_of_a_program_is_that_of_its_simulation(effects: tuple[str, ...]) -> None:
    described, run = simulated(*effects)
    made = expectation_of(described, PLATE)
    expected = sum(load_of(made, one.line, k) * one.time_s for k, one in enumerate(made.runs)) / made.time_s
    assert made.time_s == pytest.approx(run.seconds, rel=1e-9)
    assert expected == pytest.approx(float(run.run["spindle_load_pct"].mean()), rel=0.01)


@pytest.mark.parametrize("effects", [(), ("edge_force",)])
def test_so_is_the_load_of_each_line_that_takes_a_second(effects: tuple[str, ...]) -> None:
    described, run = simulated(*effects)
    made = expectation_of(described, PLATE)
    load = np.roll(run.run["spindle_load_pct"], -WINDOW_TICKS)
    judged = 0
    for one in made.runs:
        own = run.run["line"] == one.line
        expected = made.at(one.line)
        assert expected is not None
        if own.sum() > 1000 and expected.cut_load_pct:
            assert expected.load_pct == pytest.approx(float(load[own].mean()), rel=0.01), one.line
            judged += 1
    assert judged == 3


def test_a_programs_other_feeds_are_what_is_expected_of_a_program_with_them() -> None:
    made, slow = expectation_of(machine(), PLATE), expectation_of(machine(), plate(feed=600))
    for line in made.runs_of_line:
        other = slow.at(line)
        assert other is not None
        scaled = made.at(line, other.feed_mm_min, other.spindle_rpm)
        assert scaled is not None
        assert scaled.load_pct == pytest.approx(other.load_pct, abs=1e-3)


def test_another_feed_with_an_edge_force_is_as_one_worked_out_for_it() -> None:
    described = machine(effects=(EDGE,))
    made, slow = expectation_of(described, PLATE), expectation_of(described, plate(feed=800))
    for line in made.runs_of_line:
        other = slow.at(line)
        assert other is not None
        scaled = made.at(line, other.feed_mm_min, other.spindle_rpm)
        assert scaled is not None
        assert scaled.cut_load_pct == pytest.approx(other.cut_load_pct, rel=0.01, abs=0.02)


def test_a_line_that_enters_the_stock_has_air_before_the_cut() -> None:
    made = expectation_of(machine(), PLATE)
    line = PLATE.splitlines().index("G1 X60. F1200.")
    least, most = made.cut_load_between(line) or (1.0, 0.0)
    assert least == 0.0 < most
    early, late = made.at(line, along_mm=1.0), made.at(line, along_mm=35.0)
    assert early is not None and early.cut_load_pct == 0.0
    assert late is not None and late.cut_load_pct == pytest.approx(most)


def test_n_words_number_the_lines_where_most_blocks_have_one() -> None:
    numbered = "\n".join(f"N{10 * k} {line}" for k, line in enumerate(PLATE.splitlines(), start=1))
    by_words, by_place = expectation_of(machine(), numbered), expectation_of(machine(), PLATE)
    assert by_words.numbering is Numbering.N_WORDS
    assert [run.line for run in by_words.runs] == [10 * (run.line + 1) for run in by_place.runs]
    assert [run[1:] for run in by_words.runs] == [run[1:] for run in by_place.runs]


@pytest.mark.parametrize(
    ("left_out", "why"),
    [
        ({"stock": None}, "no [stock]: what a line cuts is not known"),
        ({"tool": None}, "no tool of the program is described: write [tool] or [tools.N]"),
        ({"spindle": None}, "no [spindle]: no load is expected"),
    ],
)
def test_feed_and_time_are_expected_where_no_load_is_and_the_basis_says_why(left_out: dict[str, None], why: str) -> None:
    made, whole = expectation_of(machine().model_copy(update=left_out), PLATE), expectation_of(machine(), PLATE)
    line = PLATE.splitlines().index("G1 X60. F1200.")
    expected, known = made.at(line), whole.at(line)
    assert expected is not None and known is not None
    assert math.isnan(expected.load_pct) and math.isnan(expected.cut_load_pct)
    assert (expected.feed_mm_min, expected.time_s) == (known.feed_mm_min, known.time_s)
    assert why in made.basis


def test_a_plunge_into_material_has_no_load_and_other_lines_have() -> None:
    text = PLATE.replace("G1 Z-2. F400.", "G0 X30. Y20.\nG1 Z-2. F400.")
    made = expectation_of(machine(), text)
    line = text.splitlines().index("G1 Z-2. F400.")
    expected = made.at(line)
    assert expected is not None and math.isnan(expected.load_pct)
    assert any("down into material" in sentence and f"({line})" in sentence for sentence in made.basis)
    assert made.cut_load_between(line) is None


def test_each_tool_of_a_table_cuts_with_its_own_diameter() -> None:
    text = PLATE.replace("S4000 M3", "T2 M6\nS4000 M3")
    thin = machine().tool
    assert thin is not None
    other = expectation_of(machine(), text, tools={"2": thin.model_copy(update={"diameter_mm": 5.0})})
    assert {run.diameter_mm for run in other.runs if run.diameter_mm} == {5.0}
    unknown = expectation_of(machine(), text.replace("Y18.", "Y18.\nT3 M6"), tools={"2": thin})
    assert any("tool 3 is not described: write [tools.3] if it is an end mill; a drill" in sentence for sentence in unknown.basis)


def test_a_pass_that_runs_again_cuts_air_the_second_time() -> None:
    text = BOX
    made = expectation_of(machine(), text)
    first, again = made.runs_of_line[text.splitlines().index("G1 X50.")]
    assert made.at(0, run=first) != made.at(0, run=again)
    air = made.at(0, run=again)
    assert air is not None and air.cut_load_pct == pytest.approx(0.0, abs=1e-6)
    assert made.followed(first, text.splitlines().index("G1 X-10.")) == first + 1
    assert made.followed(first + 1, text.splitlines().index("G1 X50.")) == again
