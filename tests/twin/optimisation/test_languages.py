"""The plate of `tests/twin/programs/plate.py`, optimised in each language: feeds and speeds change, and nothing else."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.twin.programs import plate
from twin.motion.path import EventKind
from twin.optimisation.answer import Objective, SpeedChanges
from twin.optimisation.problem import Problem
from twin.optimisation.question import Question, problem
from twin.optimisation.rewriting import Rewritten, rewritten
from twin.optimisation.seeds import closed_form
from twin.programs import interpret
from twin.programs.discovery import dialects
from twin.programs.source import source_lines

FOLDER = Path(plate.__file__).parent
every_language = pytest.mark.parametrize("name", list(dialects()))

OFFSETS = "\n".join(
    f"tool_offsets.{number} = {{ length_mm = {tool.length_mm}, radius_mm = {tool.radius_mm} }}"
    for number, tool in plate.TOOLS.items()
)
MACHINE = f"""
[machine]
name = "vmc"
[program]
rapid_mm_min = 30000.0
acceleration_mm_s2 = 2500.0
[control]
work_offsets_mm = {{ G54 = {list(plate.OFFSET_MM)}, "preset 1" = {list(plate.OFFSET_MM)} }}
{OFFSETS}
[stock]
min_mm = [20.0, 30.0, -15.0]
max_mm = [120.0, 90.0, 6.0]
[limits]
feed_mm_min = [100.0, 3000.0]
spindle_rpm = [1000.0, 8000.0]
force_n = 400.0
"""
TOOL = "diameter_mm = {}\nteeth = 3\ntangential_coefficient_n_per_mm2 = 900.0\nradial_ratio = 0.4\n"
TOOLS = "".join(f"[tools.{number}]\n{TOOL.format(2.0 * tool.radius_mm)}" for number, tool in plate.TOOLS.items())


@cache
def done(name: str) -> tuple[Problem, Rewritten]:
    (file,) = (FOLDER / name).glob("plate.*")
    made = problem(Question(file.read_text(encoding="utf-8"), MACHINE + TOOLS, name=file.name))
    feed, rpm = closed_form(made, Objective.TIME)
    return made, rewritten(made, feed, np.round(rpm))


@every_language
def test_the_part_is_the_same_and_every_written_word_is_followed(name: str) -> None:
    made, written = done(name)
    assert written.not_followed == {}
    cuts = plate.cuts(interpret(written.text, made.program.machine.settings))
    assert len(cuts) == len(plate.TRUTH)
    for cut, true in zip(cuts, plate.TRUTH, strict=True):
        same = true._replace(feed_mm_min=cut.feed_mm_min, rpm=cut.rpm)
        assert plate.figures(cut) == pytest.approx(plate.figures(same), abs=plate.SAME_MM, rel=0.0)


@every_language
def test_it_is_faster_by_words_of_feed_that_only_its_language_writes(name: str) -> None:
    made, written = done(name)
    before, after = source_lines(made.program.text), source_lines(written.text)
    changed = [k for k, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]
    words = made.program.words
    assert len(changed) >= 8
    for line in changed:
        assert words.feed_place(after[line]) is not None or words.speed_place(after[line]) is not None
    assert made.evaluate_path(written.path)[0] < 0.8 * made.evaluate_path(made.program.path)[0]


def test_where_the_tool_call_has_the_speed_each_tool_keeps_one() -> None:
    made, written = done("klartext")
    assert made.groups.changes is SpeedChanges.PER_TOOL
    speeds = [event.value for event in written.path.events if event.kind is EventKind.SPINDLE and event.value]
    assert len(dict.fromkeys(speeds)) == len(plate.TOOLS)
