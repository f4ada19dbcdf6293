"""The examples that Siemens publishes, transcribed as facts: the call, and where it drills or mills.

Source: SINUMERIK 840D/840Di/810D Programming Guide Cycles, edition 11.02 (6FC5298-6AB40-0BP2), the example in each cycle's own
section: 2.1 drilling cycles, 2.3 drilling patterns, 3 milling cycles; Programming Guide Fundamentals, edition 10.04, for arcs,
frames and the pole. They are written down from knowledge of these manuals, without the printed page beside them: a figure of a
call may differ from it; what such a call means does not. Edges beyond D1 are written D1, since the table has one edge a tool.
"""

import math

import pytest

from tests.twin.programs.sinumerik.reading import cuts, ends, heights, run
from twin.programs import Arc, Dwell, Linear, Move, Settings, Spindle, ToolOffset


def tools(radius: float) -> Settings:
    return Settings(tool_offsets={number: ToolOffset(0.0, radius) for number in range(1, 60)})


def drilled(moves: list[Move]) -> list[tuple[float, float, float]]:
    """The deepest point of each hole."""
    found: list[tuple[float, float, float]] = []
    for move in moves:
        if isinstance(move, Linear):
            x, y, z = (round(figure, 4) + 0.0 for figure in move.end_mm)
            if not found or found[-1][:2] != (x, y):
                found.append((x, y, z))
            elif z < found[-1][2]:
                found[-1] = (x, y, z)
    return found


def test_drilling_and_centering_with_cycle81() -> None:
    """Three holes from the same block of parameters, the retraction plane 110, the depth 35."""
    moves = run(
        "N10 G0 G17 G90 F200 S300 M3\nN20 D1 T3 Z110\nN30 X40 Y120\nN40 CYCLE81(110, 100, 2, 35)\nN50 Y30\n"
        "N60 CYCLE81(110, 102, , 35)\nN70 G0 G90 F180 S300 M03\nN80 X90\nN90 CYCLE81(110, 100, 2, , 65)\nN100 M30"
    )
    assert drilled(moves) == [(40.0, 120.0, 35.0), (40.0, 30.0, 35.0), (90.0, 30.0, 35.0)]
    assert [height for letter, height in heights(moves) if letter == "R"] == [
        110.0,
        110.0,
        102.0,
        110.0,
        110.0,
        102.0,
        110.0,
        110.0,
        102.0,
        110.0,
    ]


def test_counterboring_with_cycle82() -> None:
    moves = run("N10 G0 G17 G90 F200 S300 M3\nN20 D1 T10 Z110\nN30 X24 Y15\nN40 CYCLE82(110, 102, 4, 75, , 2)\nN50 M30")
    assert drilled(moves) == [(24.0, 15.0, 75.0)]
    assert ("R", 106.0) in heights(moves)
    assert [move.seconds for move in moves if isinstance(move, Dwell)] == [2.0]


def test_deep_hole_drilling_with_cycle83() -> None:
    """145 mm deep from 150, the first stroke to 100, each further one 20 mm less, the last two equal."""
    moves = run(
        "N10 G0 G17 G90 F50 S500 M4\nN20 D1 T42 Z155\nN30 X80 Y120\n"
        "N40 CYCLE83(155, 150, 1, 5, 0 , 100, , 20, 0, 0, 1, 0)\nN50 M30"
    )
    assert [height for letter, height in heights(moves) if letter == "L"] == [
        *(100.0, 101.0, 70.0, 71.0, 50.0, 51.0, 30.0, 31.0, 17.5, 18.5, 5.0)
    ]


def test_rigid_tapping_with_cycle84() -> None:
    """M5 right-hand, 0.8 mm a revolution, in at 200 and out at 500 rev/min."""
    moves = run("N10 G0 G90 T11 D1\nN20 G17 X30 Y35 Z40\nN30 CYCLE84(40, 36, 2, , 30, , 3, 5, , 90, 200, 500)\nN40 M30")
    down, up = [move for move in moves if isinstance(move, Linear)]
    assert (down.end_mm, down.feed_mm_min, down.feed_per_rev_mm) == ((30.0, 35.0, 6.0), 160.0, 0.8)
    assert (up.end_mm, up.feed_mm_min, up.feed_per_rev_mm) == ((30.0, 35.0, 38.0), 400.0, 0.8)


def test_tapping_with_a_chuck_with_cycle840() -> None:
    """Without an encoder: the lead is that of F and S, 200/500."""
    moves = run("N10 G90 G0 T11 D1 S500 M3\nN20 G17 X35 Y35 Z60\nN30 G1 F200\nN40 CYCLE840(59, 56, , 15, 0, 1, 4, 3, 1)\nN50 M30")
    assert [round(move.end_mm[2], 6) for move in moves if isinstance(move, Linear)] == [15.0, 56.0]
    assert {move.feed_per_rev_mm for move in moves if isinstance(move, Linear)} == {0.4}
    assert [move.direction for move in moves if isinstance(move, Spindle)] == [1, -1, 1]


def test_boring_with_cycle85_in_the_zx_plane() -> None:
    """The boring axis is y: in with 300, out with 450 mm/min."""
    moves = run(
        "DEF REAL FFR, RFF, RFP=102, DPR=25, SDIS=2\nN10 FFR=300 RFF=1.5*FFR S500 M4\nN20 G0 G18 Z70 X50 Y105\n"
        "N30 CYCLE85(RFP+3, RFP, SDIS, , DPR, , FFR, RFF)\nN40 M30"
    )
    assert [(move.end_mm[1], move.feed_mm_min) for move in moves if isinstance(move, Linear)] == [(77.0, 300.0), (104.0, 450.0)]
    assert ends(moves)[-1] == (50.0, 105.0, 70.0)


def test_boring_with_cycle86() -> None:
    moves = run(
        "DEF REAL DP, DTB, POSS\nN10 DP=77 DTB=2 POSS=45\nN20 G0 G17 G90 F200 S300 M3\nN30 T11 D1 Z112\nN40 X70 Y50\n"
        "N50 CYCLE86(112, 110, , DP, , DTB, 3, -1, -1, 1, POSS)\nN60 M30"
    )
    assert ends(moves)[-4:] == [(70.0, 50.0, 77.0), (69.0, 49.0, 78.0), (69.0, 49.0, 110.0), (70.0, 50.0, 112.0)]


def test_boring_with_cycle89() -> None:
    moves = run(
        "DEF REAL RFP, RTP, DP, DTB\nRFP=102 RTP=107 DP=72 DTB=3\nN10 G90 G17 F100 S450 M4\nN20 G0 X80 Y90 Z107\n"
        "N30 CYCLE89(RTP, RFP, 5, DP, , DTB)\nN40 M30"
    )
    assert heights(moves) == [("R", 107.0), ("L", 72.0), ("L", 107.0)]


def test_a_grid_of_holes_with_holes1_in_a_loop_of_labels() -> None:
    """Five rows of five holes, 20 mm apart, the first 10 mm beside the reference point; the rows are run to and fro."""
    moves = run(
        "DEF REAL RFP=102, DP=75, RTP=105, SDIS=3\nDEF REAL SPCA=10, SPCO=10, STA1=0, DBH=20, FDIS=10\n"
        "DEF INT NUM=5, LINENUM=5, COUNT=0\nDEF REAL LINEDIST\nN10 LINEDIST=DBH\nN20 G90 F300 S500 M3 T10 D1\n"
        "N30 G17 G0 X=SPCA-10 Y=SPCO Z105\nN40 MCALL CYCLE81(RTP, RFP, SDIS, DP)\nLABEL1:\n"
        "N41 HOLES1(SPCA, SPCO, STA1, FDIS, DBH, NUM)\nN50 SPCO=SPCO+LINEDIST\nN60 COUNT=COUNT+1\n"
        "N70 IF COUNT<LINENUM GOTOB LABEL1\nN80 MCALL\nN90 G90 G0 X30 Y20 Z105\nN100 M30"
    )
    rows = [[20.0 + 20.0 * hole for hole in range(5)] for _ in range(5)]
    expected = [(x, 10.0 + 20.0 * row, 75.0) for row, line in enumerate(rows) for x in (line if row % 2 == 0 else line[::-1])]
    assert drilled(moves) == expected


def test_a_circle_of_holes_with_holes2() -> None:
    """Four holes on 42 mm about (70, 60), the first at 33°, 30 mm deep."""
    moves = run(
        "DEF REAL CPA=70,CPO=60,RAD=42,STA1=33\nDEF INT NUM=4\nN10 G90 F140 S170 M3 T10 D1\nN20 G17 G0 X50 Y45 Z2\n"
        "N30 MCALL CYCLE82(2, 0, 2, , 30)\nN40 HOLES2(CPA, CPO, RAD, STA1, , NUM)\nN50 MCALL\nN60 M30"
    )
    places = [
        (70 + 42 * math.cos(math.radians(33 + 90 * hole)), 60 + 42 * math.sin(math.radians(33 + 90 * hole))) for hole in range(4)
    ]
    assert drilled(moves) == [(round(x, 4), round(y, 4), -30.0) for x, y in places]


def test_a_dot_matrix_with_cycle801() -> None:
    """Five columns at 10 mm and three rows at 15 mm from (30, 20), 22 mm deep."""
    moves = run(
        "N10 G90 G17 F900 S4000 M3 T3 D1\nN15 MCALL CYCLE82(10,0,1,-22,0,0)\nN20 CYCLE801(30,20,0,10,15,5,3)\nN25 MCALL\nN30 M30"
    )
    assert {place[:2] for place in drilled(moves)} == {
        (30.0 + 10 * column, 20.0 + 15 * row) for column in range(5) for row in range(3)
    }
    assert len(drilled(moves)) == 15


def test_four_long_holes_with_longhole_in_the_yz_plane() -> None:
    """30 mm long, 23 mm deep, on 20 mm about y = 40, z = 45, at 45° and every 90°."""
    moves = run(
        "N10 G19 G90 D1 T10 S600 M3\nN20 M6\nN30 G0 Y50 Z25 X5\n"
        "N40 LONGHOLE(5, 0, 1, , 23, 4, 30, 40, 45, 20, 45, 90, 100, 320, 6)\nN50 M30",
        tools(4.0),
    )
    down = sorted({round(move.end_mm[0], 6) for move in moves if isinstance(move, Linear)})
    assert down == [-23.0, -17.25, -11.5, -5.75]
    assert {move.feed_mm_min for move in moves if isinstance(move, Linear)} == {100.0, 320.0}
    reach = {round(math.hypot(move.end_mm[1] - 40.0, move.end_mm[2] - 45.0), 6) for move in moves if isinstance(move, Linear)}
    assert reach == {24.0, 46.0}


def test_four_slots_with_slot1() -> None:
    """30 mm long, 15 mm wide, 23 mm deep, finishing allowance 0.5, infeed 6."""
    moves = run(
        "N10 G17 G90 T1 D1 S600 M3\nN20 M6\nN30 G0 X20 Y50 Z5\n"
        "N40 SLOT1(5, 0, 1, -23, , 4, 30, 15, 40, 45, 20, 45, 90, 100, 320, 6, 2, 0.5, 0, , 0, )\nN50 M30",
        tools(5.0),
    )
    arcs = [move for move in moves if isinstance(move, Arc)]
    assert {round(math.dist(move.centre_mm[:2], move.end_mm[:2]), 6) for move in arcs} == {2.0, 2.5}
    assert all(move.sweep_rad < 0.0 for move in arcs), "CDIR = 2 is G2"
    assert sorted({round(move.end_mm[2], 6) for move in arcs}) == [-23.0, -17.25, -11.5, -5.75]
    assert {round(math.dist(move.centre_mm[:2], (40.0, 45.0)), 6) for move in arcs} == {27.5, 42.5}


def test_three_circumferential_slots_with_slot2() -> None:
    """70° long, 15 mm wide on a circle of 42 mm about (60, 60), every 120°."""
    moves = run(
        "N10 G17 G90 T1 D1 S600 M3\nN20 M6\nN30 G0 X60 Y60 Z5\n"
        "N40 SLOT2(2, 0, 2, -23, , 3, 70, 15, 60, 60, 42, , 120, 100, 300, 6, 2, 0.5, 0, , 0, )\nN50 M30",
        tools(5.0),
    )
    about = [move for move in moves if isinstance(move, Arc) and math.dist(move.centre_mm[:2], (60.0, 60.0)) < 1e-6]
    assert {round(math.degrees(abs(move.sweep_rad)), 6) for move in about} == {70.0}
    assert {round(math.dist(move.end_mm[:2], (60.0, 60.0)), 6) for move in about} == {42.0, 40.0, 44.0, 39.5, 44.5}


def test_a_rectangular_pocket_with_pocket3() -> None:
    """60 × 40 mm about (60, 40), corners 8 mm, 17.5 mm deep: rough, with vertical insertion."""
    moves = run(
        "N10 G90 T20 D1 S600 M4\nN20 M6\nN30 G17 G0 X60 Y40 Z5\n"
        "N40 POCKET3(5, 0, 0.5, -17.5, 60, 40, 8, 60, 40, 0, 4, 0.75, 0.2, 1000, 750, 0, 11, 5, , , , , )\nN50 M30",
        tools(5.0),
    )
    places = [end for letter, end in cuts(moves) if letter != "R"]
    assert (max(x for x, _, _ in places), max(y for _, y, _ in places)) == pytest.approx((84.25, 54.25))
    assert min(z for _, _, z in places) == pytest.approx(-17.3)
    assert all(move.sweep_rad < 0.0 for move in moves if isinstance(move, Arc)), "climb milling inside is clockwise with M4"


def test_a_round_pocket_with_pocket4_on_a_helix() -> None:
    """Radius 25 mm about (60, 40), 20 mm deep, in on a helix of 2 mm radius and 3 mm a turn."""
    moves = run(
        "N10 G17 G90 G0 S650 M3 T20 D1\nN20 M6\nN30 X50 Y50 Z5\n"
        "N40 POCKET4(3, 0, 0.5, -20, 25, 60, 40, 6, 0, 0, 200, 100, 1, 21, 0, 0, 0, 2, 3)\nN50 M30",
        tools(10.0),
    )
    arcs = [move for move in moves if isinstance(move, Arc)]
    assert max(round(math.dist(move.centre_mm[:2], move.end_mm[:2]), 6) for move in arcs) == 15.0
    assert sorted({round(move.end_mm[2], 6) for move in arcs if move.feed_mm_min == 200.0}) == [-20.0, -15.0, -10.0, -5.0]


ARC_START = "N10 G0 G90 X133 Y44.48 S800 M3\nN20 G17 G1 Z-5 F1000\n"


@pytest.mark.parametrize(
    "block",
    [
        "N30 G2 X115 Y113.3 I-43 J25.52",
        "N30 G2 X115 Y113.3 I=AC(90) J=AC(70)",
        "N30 G2 X115 Y113.3 CR=-50",
        "N30 G2 AR=269.31 I-43 J25.52",
        "N30 G2 AR=269.31 X115 Y113.3",
    ],
)
def test_one_arc_of_the_fundamentals_in_each_way_it_is_programmed(block: str) -> None:
    """Fundamentals, "Circular interpolation": centre (90, 70), radius 50, clockwise by 269.31°."""
    found = next(move for move in run(ARC_START + block) if isinstance(move, Arc))
    assert found.centre_mm[:2] == pytest.approx((90.0, 70.0), abs=0.02)
    assert math.degrees(found.sweep_rad) == pytest.approx(-269.31, abs=0.05)
    assert found.end_mm[:2] == pytest.approx((115.0, 113.3), abs=0.02)


def test_five_holes_about_a_pole_of_the_fundamentals() -> None:
    """Fundamentals, "Polar coordinates": a hole pattern about (43, 38) at 30 mm, from 18° on every 72°."""
    moves = run(
        "N10 G17 G54\nN20 G111 X43 Y38\nN30 G0 RP=30 AP=18 Z5\nN40 CYCLE81(5,0,1,-5)\n".replace("N10 ", "N10 S500 M3 F100 ")
        + "".join(f"N{50 + 20 * hole} AP=IC(72)\nN{60 + 20 * hole} CYCLE81(5,0,1,-5)\n" for hole in range(4))
        + "N200 M30"
    )
    expected = [
        (43 + 30 * math.cos(math.radians(18 + 72 * hole)), 38 + 30 * math.sin(math.radians(18 + 72 * hole))) for hole in range(5)
    ]
    assert drilled(moves) == [(round(x, 4), round(y, 4), -5.0) for x, y in expected]


def test_a_contour_is_milled_at_three_shifted_and_turned_places() -> None:
    """Fundamentals, "ROT": the same subprogram at G54, shifted, and turned by 45° behind the shift."""
    moves = run(
        "N10 G17 G54\nN20 TRANS X20 Y10\nN30 L10\nN40 TRANS X55 Y35\nN50 AROT RPL=45\nN60 L10\nN70 TRANS X20 Y40\n"
        "N80 AROT RPL=60\n"
        "N90 L10\nN100 G0 X100 Y100\nN110 M30",
        Settings(programs={"L10": "N10 G0 X0 Y0\nN20 G1 X10 F100\nM17"}),
    )
    ends_of_cuts = [move.end_mm[:2] for move in moves if isinstance(move, Linear)]
    half = 10.0 * math.sqrt(0.5)
    assert ends_of_cuts[0] == (30.0, 10.0)
    assert ends_of_cuts[1] == pytest.approx((55.0 + half, 35.0 + half))
    assert ends_of_cuts[2] == pytest.approx((25.0, 40.0 + 10.0 * math.sin(math.radians(60))))
