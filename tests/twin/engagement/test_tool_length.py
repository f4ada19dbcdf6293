"""The length of a tool lifts the axes, and not the tip: what is cut does not depend on it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from twin.engagement.along_path import PathRows, Section, engaged_along
from twin.machine import Stock
from twin.motion.path import Path, path_from_moves
from twin.programs import Rapid, ToolLength, interpret

STOCK = Stock(min_mm=(0.0, 0.0, -10.0), max_mm=(60.0, 40.0, 0.0))
SLOT = "G0 X-10. Y20.\nG1 Z-0.4 F500\nX70.\nG0 Z10.\n"


def path(text: str) -> Path:
    return path_from_moves(interpret("G21 G90 G17\n" + text + "M30\n"))


def cut(text: str) -> PathRows:
    made = path(text)
    return engaged_along(made, STOCK, [Section(0, len(made), 6.0)])


@given(length_mm=st.floats(-300.0, 300.0), way=st.sampled_from(["G43", "G44"]))
@settings(max_examples=examples(20, 4), deadline=None)
def test_a_slot_is_as_deep_with_any_length(length_mm: float, way: str) -> None:
    plain = cut("G0 Z10.\n" + SLOT)
    long = cut(f"G10 L10 P1 R{length_mm:.6f}\n{way} H1 G0 Z10.\n" + SLOT)
    assert not long.collisions
    np.testing.assert_allclose(long.axial_depth_mm, plain.axial_depth_mm, atol=1e-9)
    np.testing.assert_allclose(long.length_mm, plain.length_mm, atol=1e-9)


def test_axes_go_where_they_have_to_and_the_tip_where_it_was_told() -> None:
    made = path("G10 L10 P1 R100.\nG43 H1\nG0 X5.\nZ10.\nG2 X15. I5. J0. Z4. F100\nG0 G49 Z30.\n")
    assert made.end_mm[:, 2].tolist() == [0.0, 110.0, 104.0, 30.0]
    assert made.tip_ends_mm(np.arange(4))[1].tolist() == [[5.0, 0.0, 0.0], [5.0, 0.0, 10.0], [15.0, 0.0, 4.0], [15.0, 0.0, 30.0]]
    half = made.tip_at(np.arange(4), made.length_mm / 2.0)
    assert half[:, 2] == pytest.approx([0.0, 5.0, 7.0, 17.0])  # a tip is never where nobody sent it


def test_a_wear_offset_counts_and_a_length_that_moves_nothing_counts_too() -> None:
    deeper = cut("G10 L10 P1 R100.\nG43 H1 G0 Z10.\nG10 L11 P1 R-0.1\n" + SLOT)
    assert deeper.axial_depth_mm.max() == pytest.approx(0.4)  # the control takes the wear up as well: the tip is where it is told
    made = path("G0 Z100.\nG10 L10 P1 R100.\nG43 H1 G0 X9. Z0.\nG1 X20. F100\n")  # the axes stand at 100 already
    assert made.tip_ends_mm(np.arange(3))[0][:, 2].tolist() == [0.0, 100.0, 0.0]


@pytest.mark.parametrize(
    ("text", "before"),
    [
        ("G43 H1\nG0 X1.\nZ5.\n", (1.0, 0.0, 105.0)),
        ("G43 H1 G0 Z5.\n", (0.0, 0.0, 105.0)),
        ("G43 H1\nG53 G0 X2.\nG53 Z7.\n", (2.0, 0.0, 7.0)),
        ("G43 H1\nG91 G28 Z0.\n", (0.0, 0.0, 0.0)),
    ],
    ids=["later", "at once", "G53", "G28"],
)
def test_the_length_is_said_before_the_move_that_is_told_where_z_goes(text: str, before: tuple[float, ...]) -> None:
    moves = interpret("G10 L10 P1 R100.\n" + text)
    (at,) = [k for k, move in enumerate(moves) if isinstance(move, ToolLength)]
    assert moves[at] == ToolLength(moves[at].line, 100.0)
    assert moves[at + 1] == Rapid(moves[at].line, before)


def test_without_a_length_nothing_is_said() -> None:
    assert interpret("G43 H1 G0 Z5.") == [Rapid(0, (0.0, 0.0, 5.0))]
