"""The same way in two languages makes the same moves: contours beside which the tool goes, frames, cycles."""

import random

import pytest

from tests.twin.programs.fanuc.contours import contour
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Move, OutsideCorner, Rapid, Settings, ToolOffset
from twin.programs.fanuc.interpreter import interpret as fanuc
from twin.programs.sinumerik.interpreter import interpret as sinumerik


def figures(moves: list[Move]) -> list[tuple[object, ...]]:
    """Motions to a nanometre, with their line; of an arc its centre and sweep."""
    found: list[tuple[object, ...]] = []
    for move in moves:
        if isinstance(move, Rapid | Linear | Arc):
            end = [round(figure, 6) + 0.0 for figure in move.end_mm]
            extra = [round(figure, 6) + 0.0 for figure in (*move.centre_mm, move.sweep_rad)] if isinstance(move, Arc) else []
            found.append((type(move), move.line, *end, *extra))
    return found


@pytest.mark.parametrize("seed", range(30))
def test_a_compensated_contour_is_the_same_on_both_controls(seed: int) -> None:
    """FANUC with arcs at outside corners (CCC = 1) goes as SINUMERIK with G450 and NORM."""
    text = contour(random.Random(seed))
    number = 1 if " D1" in text else 2
    radii = {1: ToolOffset(0.0, 2.0), 2: ToolOffset(0.0, 4.0)}
    own = text.replace("G21 ", "").replace(f" D{number}", "").replace(" R", " CR=")
    table = Settings(tool_offsets=radii, outside_corner=OutsideCorner.ARC)
    own_table = Settings(tool_offsets={1: radii[number]})
    try:
        expected = figures(fanuc(text, table))
    except PartProgramError as refused:
        with pytest.raises(PartProgramError) as caught:
            sinumerik(own, own_table)
        assert (caught.value.line, caught.value.reason) == (refused.line, refused.reason)
        return
    assert figures(sinumerik(own, own_table)) == expected


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        ("G1 X10. F100.\nG3 X20. Y10. R10.\nG2 X30. Y20. I10.", "G1 X10 F100\nG3 X20 Y10 CR=10\nG2 X30 Y20 I10"),
        ("G52 X5. Y6.\nG1 X10. Y1. F100.", "TRANS X5 Y6\nG1 X10 Y1 F100"),
        ("G68 X0 Y0 R30.\nG1 X10. F100.\nG2 X0 Y0 R8.", "ROT RPL=30\nG1 X10 F100\nG2 X0 Y0 CR=8"),
        ("G51 X0 Y0 Z0 I2. J2. K1.\nG1 X10. F100.\nG2 X0 Y0 R8.", "SCALE X2 Y2\nG1 X10 F100\nG2 X0 Y0 CR=8"),
        ("G51 X0 Y0 Z0 I-1. J1. K1.\nG1 X10. F100.\nG2 X0 Y0 R8.", "MIRROR X0\nG1 X10 F100\nG2 X0 Y0 CR=8"),
        ("G1 X10. ,R2. F100.\nY10. ,C1.\nX0", "G1 X10 RND=2 F100\nY10 CHR=1\nX0"),
        ("G16\nG0 X10. Y30.\nY60.", "\nG0 RP=10 AP=30\nAP=60"),
        ("S500 M3\nG95 G1 X10. F.2\nG4 P500", "S500 M3\nG95 G1 X10 F0.2\nG4 F0.5"),
        (
            "S500 M3\nG98 G81 X5. Y6. Z-5. R2. F100.\nX15.\nG80",
            "S500 M3 F100\nMCALL CYCLE81(10,0,2,-5)\nX5 Y6\nX15",
        ),
        ("S500 M3 F100.\nG98 G83 X5. Z-9. R2. Q5.\n", "S500 M3 F100\nMCALL CYCLE83(10,2,0,-9,,,5,0,0,0,1,1,,,,,1)\nX5"),
    ],
)
def test_what_both_controls_have_is_the_same_move(theirs: str, ours: str) -> None:
    before, now = (
        figures(fanuc("G90 G17 G0 Z10.\n" + theirs, Settings())),
        figures(sinumerik("G90 G17 G0 Z10\n" + ours, Settings())),
    )
    assert [one[2:] for one in now] == [one[2:] for one in before]
    assert [one[0] for one in now] == [one[0] for one in before]
