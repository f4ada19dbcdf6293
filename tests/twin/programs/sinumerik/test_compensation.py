"""G41, G42, G40 with the corner behaviour of the control: figures worked out by hand."""

import math

import pytest

from tests.twin.programs.sinumerik.reading import TOOLS, cuts, ends, run
from twin.errors import PartProgramError
from twin.programs import Arc, Linear

SQUARE = "T1 M6\nF100\nG0 X-20 Y0\n{corner}\n{side} G1 X0 Y0\nY40\nX40\nY0\nX0\nG40 Y-20"
"""Round a square of 40 mm clockwise with a tool of 5 mm, from its corner at the origin."""


def test_an_arc_leads_round_outside_corners_with_g450() -> None:
    moves = cuts(run(SQUARE.format(corner="G450", side="G41"), TOOLS))
    assert [end[:2] for _, end in moves[1:]] == [
        (-5.0, 0.0),  # NORM: square to the first contour block, beside its start.
        (-5.0, 40.0),
        (0.0, 45.0),
        (40.0, 45.0),
        (45.0, 40.0),
        (45.0, 0.0),
        (40.0, -5.0),
        (0.0, -5.0),
        (0.0, -20.0),
    ]
    assert [letter for letter, _ in moves] == ["R", "L", "L", "A", "L", "A", "L", "A", "L", "L"]


def test_g451_goes_to_where_the_parallels_cross() -> None:
    moves = cuts(run(SQUARE.format(corner="G451", side="G41"), TOOLS))
    assert [end[:2] for _, end in moves[1:]] == [
        (-5.0, 0.0),
        (-5.0, 45.0),
        (45.0, 45.0),
        (45.0, -5.0),
        (0.0, -5.0),
        (0.0, -20.0),
    ]


def test_g451_leads_round_a_corner_sharper_than_100_degrees_on_an_arc() -> None:
    text = "T1 M6\nF100\nG451\nG0 X-20\nG41 G1 X0 Y0\nX40 Y40\nX40 Y0\nG40 X60"
    assert "A" in [letter for letter, _ in cuts(run(text, TOOLS))]  # The direction turns by 135°.


def test_g451_lengthens_an_arc_as_an_arc() -> None:
    # Up along x = 0, then a quarter from (0, 40) to (40, 0) about (0, 0): parallels at 5 mm cross at (-5, √(45² - 5²)).
    moves = run("T1 M6\nF100\nG451\nG0 X-20\nG41 G1 X0 Y0\nY40\nG2 X40 Y0 CR=40\nG40 G1 X60", TOOLS)
    crossing = (-5.0, math.sqrt(45.0**2 - 25.0))
    line, arc = [move for move in moves if isinstance(move, Linear | Arc)][1:3]
    assert line.end_mm[:2] == pytest.approx(crossing)
    assert isinstance(arc, Arc)
    assert math.dist(arc.centre_mm[:2], line.end_mm[:2]) == pytest.approx(45.0)
    assert abs(arc.sweep_rad) == pytest.approx(math.pi / 2 + math.asin(5.0 / 45.0))


def test_inside_corners_end_where_the_parallels_cross() -> None:
    moves = cuts(run(SQUARE.format(corner="G450", side="G42").replace("X-20 Y0", "X20 Y20"), TOOLS))
    assert [end[:2] for _, end in moves[1:]] == [(5.0, 0.0), (5.0, 35.0), (35.0, 35.0), (35.0, 5.0), (0.0, 5.0), (0.0, -20.0)]


def test_offn_keeps_further_off_the_contour() -> None:
    moves = cuts(run(SQUARE.format(corner="G451 OFFN=1", side="G41"), TOOLS))
    assert moves[2][1][:2] == (-6.0, 46.0)


def test_a_mirror_keeps_the_tool_on_the_same_side_of_the_part() -> None:
    plain = ends(run(SQUARE.format(corner="G451", side="G41"), TOOLS))
    mirrored = ends(run(SQUARE.format(corner="G451", side="G41").replace("T1 M6\n", "T1 M6\nMIRROR X0\n"), TOOLS))
    assert mirrored == [(-x + 0.0, y, z) for x, y, z in plain]


@pytest.mark.parametrize(
    ("mode", "inside", "outside"),
    [("CFC", 100.0 * 15 / 20, 100.0 * 25 / 20), ("CFTCP", 100.0, 100.0), ("CFIN", 100.0 * 15 / 20, 100.0)],
)
def test_the_feed_on_an_arc_is_that_of_the_contour(mode: str, inside: float, outside: float) -> None:
    for side, feed in (("G41", inside), ("G42", outside)):
        text = f"T1 M6\nF100 {mode}\nG0 X-20 Y-30\n{side} G1 X-20 Y0\nY10\nG3 X-60 Y10 CR=20\nG40 G1 X-80 Y0"
        moves = run(text, TOOLS)
        (arc,) = [move for move in moves if isinstance(move, Arc)]
        assert arc.feed_mm_min == pytest.approx(feed)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("T1 M6\nG41 G2 X10 CR=10 F100", "begins in a straight move"),
        ("T1 M6\nG41 G1 X10 F100\nTRANS X5", "cannot stand between"),
        ("T1 M6\nG41 G1 X10 F100\nG55 X5", "cannot stand between"),
        ("T1 M6\nG41 G1 X10 F100\nG450\nX20\nG451", "cannot stand between"),
        ("T1 M6\nG41 G1 X10 F100\nCYCLE81(10,0,1,-5)", "cannot stand between"),
        ("T1 M6\nG41 G1 X10 F100\nX20\nT2 M6", "cannot stand between"),
        ("T1 M6\nG41 G1 X10 F100\nX20\nY-16\nX10\nG40 X0", "gouge"),
        ("T1 M6\nKONT\nG41 G1 X0 Y0 F100\nX40\nG40 X60", "KONT from behind"),
    ],
)
def test_what_compensation_cannot_do_is_refused(text: str, reason: str) -> None:
    with pytest.raises(PartProgramError, match=reason):
        run("G0 Y-20\n" + text, TOOLS)


def test_kont_from_in_front_is_as_norm() -> None:
    text = SQUARE.format(corner="{approach}", side="G41")
    assert run(text.format(approach="KONT"), TOOLS) == run(text.format(approach="NORM"), TOOLS)


def test_a_radius_without_a_table_is_an_error() -> None:
    with pytest.raises(PartProgramError, match="line 1: G41: needs the radius of the tool"):
        run("G41 G1 X10 F100")
