"""A tool: gains of its operations, and a leap that is its own."""

import pytest

from twin.wear.terms import Terms
from twin.wear.tool import Base, Told, leap, learned, level_of, new_tool, replaced

TOOL = new_tool(Terms())._replace(
    bases={"a": Base(0.1, 10, 1e-4, 50, last=0.3), "b": Base(0.0, 10, 1e-4, 50, 0.5, 0.04, last=0.1)},
    sharp_lives=2, is_whole=True, uses=50,
)  # fmt: skip


def test_a_level_is_taken_over_the_sharp_one_of_each_operation() -> None:
    level = level_of(TOOL, {"a": 0.3}, 0.2)
    assert level is not None
    assert level.level == pytest.approx(0.2)
    assert level_of(TOOL, {"c": 0.3}, 0.2) is None


def test_a_gain_is_learned_from_wear_that_is_known() -> None:
    tool = TOOL
    for _ in range(60):
        tool = learned(tool, Told({"b": 0.16}, {}), 0.0, 0.2)
    assert tool.bases["b"].gain == pytest.approx(0.8, abs=0.05)
    assert learned(TOOL, Told({"a": 0.5}, {}), 0.0, 0.2).bases["a"].gain == 1.0


def test_a_leap_is_that_of_an_operation_against_itself() -> None:
    assert leap(TOOL, Told({"a": 0.05, "b": 0.08}, {}), 0.0) == pytest.approx(-0.25)
    assert leap(TOOL, Told({"c": 0.05}, {}), 0.0) is None
    assert leap(replaced(TOOL, Terms(), 7, 0.2), Told({"a": 0.05}, {}), 0.0) is None
