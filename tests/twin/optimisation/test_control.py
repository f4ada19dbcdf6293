"""What the control makes of a program beside its text: [control] of machine.toml."""

import pytest

from tests.twin.optimisation.benchmark import machine_with, second, text
from twin.errors import PartProgramError
from twin.optimisation.optimise import optimise
from twin.optimisation.problem import Problem
from twin.optimisation.question import problem

OFFSETS = {"1": {"length_mm": 100.0, "radius_mm": 3.0}}
PROGRAM = "G21 G90\nM13\nS8000 M3\nG0 G43 H1 Z10.\nG41 D1 X-10. Y23.\nZ-0.4\nG1 X60. F400\nG40 X70. Y26.\nG0 Z10.\nM30\n"
BY_ITSELF = PROGRAM.replace("M13", "G10 L10 P1 R100.\nG10 L12 P1 R3.")


def read(program: str, **control: object) -> Problem:
    toml = machine_with(text("second.toml"), control=control)
    return problem(second(program_text=program, machine_toml=toml))


def test_offsets_of_the_table_count_as_those_of_the_program_do() -> None:
    by_table = read(PROGRAM, tool_offsets=OFFSETS, builder_m_codes=(13,))
    by_program = read(BY_ITSELF)
    assert [line.cut_mm for line in by_table.program.lines] == [line.cut_mm for line in by_program.program.lines]
    assert by_table.program.cuts.axial_depth_mm.max() == pytest.approx(0.4)
    assert by_table.program.path.end_mm[:, 2].max() == 110.0


def test_what_is_not_told_is_refused_and_the_way_out_is_a_key_of_the_file() -> None:
    with pytest.raises(PartProgramError, match=r"M13: is not known.*\[control\] builder_m_codes"):
        read(PROGRAM)
    with pytest.raises(PartProgramError, match=r"D1.*no number 1.*\[control\] tool_offsets"):
        read(PROGRAM.replace("H1", ""), builder_m_codes=(13,))


def test_the_rewritten_program_is_read_by_the_same_control() -> None:
    """In inches from the start, without G20 in the text: F15.748 is 400 mm/min, and what is written is inches too."""
    inch = "G90\nS8000 M3\nG0 Z0.4\nX-0.4 Y0.787402\nZ-0.0157480\nG1 X2.4 F15.748\nG0 Z0.4\nM30\n"
    toml = machine_with(text("second.toml"), control={"inch": True})
    answer = optimise(second(program_text=inch, machine_toml=toml, evolutions=2, islands=1, population=8))
    assert answer.before.seconds > answer.after.seconds
    assert "F68." in answer.program  # 1745 mm/min, as in millimetres
    assert answer.after.force_n == pytest.approx(60.0, abs=0.1)


def test_a_path_begins_where_the_axes_are() -> None:
    made = read(PROGRAM, tool_offsets=OFFSETS, builder_m_codes=(13,), start_mm=(5.0, 6.0, 7.0))
    assert made.program.path.start_mm[0].tolist() == [5.0, 6.0, 7.0]
