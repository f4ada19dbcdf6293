"""Lines, arcs, units, feeds, pauses, corners, spindle and tools: figures worked out by hand."""

import math

import pytest

from tests.twin.programs.sinumerik.reading import TOOLS, cuts, ends, only_arc, run
from twin.errors import PartProgramError
from twin.programs import (
    Arc,
    Coolant,
    Dwell,
    ExactStop,
    FeedForward,
    JerkLimit,
    Linear,
    ProgramEnd,
    ProgramStop,
    Rapid,
    Settings,
    Spindle,
    SpindleOrient,
    Tolerance,
    ToolChange,
    ToolLength,
    ToolOffset,
)

HALF = math.asin(3 / 5)


def test_each_move_keeps_its_line_and_modes_carry_over() -> None:
    assert run("N10 G90 G17 ;START\nG0 X1\nY2\n\nN50 G1 Z-3 F250\nX=5\nM30\nG0 X99") == [
        Rapid(1, (1.0, 0.0, 0.0)),
        Rapid(2, (1.0, 2.0, 0.0)),
        Linear(4, (1.0, 2.0, -3.0), 250.0),
        Linear(5, (5.0, 2.0, -3.0), 250.0),
        ProgramEnd(6),
    ]


def test_a_control_begins_in_g1_and_mm_and_refuses_a_cut_without_feed() -> None:
    assert run("X5 F100") == [Linear(0, (5.0, 0.0, 0.0), 100.0)]
    with pytest.raises(PartProgramError, match="line 1: this cut has no feed"):
        run("X5")


@pytest.mark.parametrize(
    ("text", "end", "feed"),
    [
        ("G70 G1 X1 F100", 25.4, 100.0),  # G70 converts lengths, G700 feeds as well.
        ("G700 G1 X1 F10", 25.4, 254.0),
        ("G71 G1 X1 F100", 1.0, 100.0),
        ("G710 G1 X1 F100", 1.0, 100.0),
    ],
)
def test_inches_are_of_lengths_or_of_feeds_too(text: str, end: float, feed: float) -> None:
    (move,) = run(text)
    assert isinstance(move, Linear)
    assert (move.end_mm[0], move.feed_mm_min) == pytest.approx((end, feed))


def test_absolute_and_incremental_words_stand_side_by_side() -> None:
    assert ends(run("G0 X10 Y10\nX=IC(5) Y=AC(3)\nG91 X1 Y=AC(7)\nG90 X=IC(-2)")) == [
        (10.0, 10.0, 0.0),
        (15.0, 3.0, 0.0),
        (16.0, 7.0, 0.0),
        (14.0, 7.0, 0.0),
    ]


@pytest.mark.parametrize(
    ("word", "end"), [("A=DC(350)", -10.0), ("A=ACP(350)", 350.0), ("A=ACN(90)", -270.0), ("A=IC(30)", 30.0), ("A90", 90.0)]
)
def test_a_rotary_axis_turns_the_way_that_is_said(word: str, end: float) -> None:
    assert ends(run(f"G0 {word}", Settings(axes=("x", "y", "z", "a")))) == [(0.0, 0.0, 0.0, end)]


@pytest.mark.parametrize(
    ("text", "centre", "sweep"),
    [
        ("G3 X6 CR=5 F100", (3.0, 4.0), 2 * HALF),  # Chord 6, radius 5: the centre is 4 beside it.
        ("G3 X6 CR=-5 F100", (3.0, -4.0), math.tau - 2 * HALF),
        ("G2 X6 CR=5 F100", (3.0, -4.0), -2 * HALF),
        ("G3 X6 I3 J4 F100", (3.0, 4.0), 2 * HALF),
        ("G3 X6 I=AC(3) J=AC(4) F100", (3.0, 4.0), 2 * HALF),
        ("G3 X10 Y10 AR=90 F100", (0.0, 10.0), math.pi / 2),
        ("G2 X10 Y10 AR=270 F100", (0.0, 10.0), -1.5 * math.pi),
        ("G3 I0 J10 AR=90 F100", (0.0, 10.0), math.pi / 2),
        ("G2 I5 J0 TURN=2 F100", (5.0, 0.0), -3 * math.tau),
        ("CIP X10 Y0 I1=5 J1=5 F100", (5.0, 0.0), -math.pi),
        ("CIP X10 Y0 I1=5 J1=-5 F100", (5.0, 0.0), math.pi),
        ("G111 X0 Y5\nG3 AP=90 RP=5 F100", (0.0, 5.0), math.pi),  # From (0, 0), which is at -90°, radius 5, about the pole.
    ],
)
def test_an_arc_is_given_in_every_way_that_the_manual_has(text: str, centre: tuple[float, float], sweep: float) -> None:
    found = only_arc(text)
    assert found.centre_mm[:2] == pytest.approx(centre, abs=1e-9)
    assert found.sweep_rad == pytest.approx(sweep)


def test_an_opening_angle_with_the_centre_gives_the_end() -> None:
    assert only_arc("G3 I0 J10 AR=90 F100").end_mm == pytest.approx((10.0, 10.0, 0.0))


def test_a_tangential_arc_goes_on_as_the_line_before_it() -> None:
    found = next(move for move in run("G1 X10 F100\nCT X20 Y10") if isinstance(move, Arc))
    assert found.centre_mm == pytest.approx((10.0, 10.0, 0.0))
    assert found.sweep_rad == pytest.approx(math.pi / 2)
    second = [move for move in run("G1 X10 F100\nCT X20 Y10\nCT X30 Y20") if isinstance(move, Arc)][1]
    assert second.centre_mm == pytest.approx((30.0, 10.0, 0.0))
    assert second.sweep_rad == pytest.approx(-math.pi / 2)


def test_an_arc_in_g18_and_g19_turns_about_their_normals() -> None:
    in_zx, in_yz = only_arc("G18 G3 Z10 X10 K0 I10 F100"), only_arc("G19 G2 Y10 Z10 J10 K0 F100")
    assert (in_zx.plane, in_zx.centre_mm) == (18, (10.0, 0.0, 0.0))
    assert in_zx.sweep_rad == pytest.approx(math.pi / 2)
    assert (in_yz.plane, in_yz.centre_mm) == (19, (0.0, 10.0, 0.0))
    assert in_yz.sweep_rad == pytest.approx(-math.pi / 2)


def test_a_helix_climbs_over_all_its_turns() -> None:
    found = only_arc("G2 X0 Y0 Z-6 I10 J0 TURN=2 F100")
    assert found.end_mm == (0.0, 0.0, -6.0)
    assert found.sweep_rad == pytest.approx(-3 * math.tau)


@pytest.mark.parametrize(
    ("text", "end"),
    [
        ("G111 X10 Y10\nG0 AP=90 RP=5", (10.0, 15.0, 0.0)),
        ("G0 X10 Y10\nG110 X5 Y0\nAP=180 RP=5", (10.0, 10.0, 0.0)),
        ("G111 X10 Y10\nG112 X5 Y5\nG0 AP=0 RP=1", (16.0, 15.0, 0.0)),
        ("G111 AP=90 RP=10\nG0 AP=0 RP=5", (5.0, 10.0, 0.0)),
        ("G111 X0 Y0\nG0 AP=30 RP=10\nAP=IC(60)", (0.0, 10.0, 0.0)),
        ("G111 X0 Y0\nG0 AP=30 RP=10\nRP=20", (17.320508, 10.0, 0.0)),
        ("G111 X0 Y0\nG0 AP=0 RP=10 Z5", (10.0, 0.0, 5.0)),
        ("G18 G111 Z0 X0\nG0 AP=90 RP=5", (5.0, 0.0, 0.0)),
    ],
)
def test_polar_words_go_about_the_pole(text: str, end: tuple[float, ...]) -> None:
    assert ends(run(text))[-1] == end


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G1 X10 ANG=45 F100", [(10.0, 10.0, 0.0)]),
        ("G1 Y10 ANG=45 F100", [(10.0, 10.0, 0.0)]),
        # Up at 45°, then down at -45° to (20, 0): they cross at (10, 10).
        ("G1 ANG=45 F100\nX20 Y0 ANG=-45", [(10.0, 10.0, 0.0), (20.0, 0.0, 0.0)]),
        ("G1 X10 ANG=0 RND=2 F100\nY10", [(8.0, 0.0, 0.0), (10.0, 2.0, 0.0), (10.0, 10.0, 0.0)]),
    ],
)
def test_a_line_by_its_angle_ends_where_it_has_to(text: str, expected: list[tuple[float, ...]]) -> None:
    assert ends(run(text)) == expected


@pytest.mark.parametrize(
    ("corner", "first", "second"),
    [
        ("CHR=2", (8.0, 0.0), (10.0, 2.0)),
        ("CHF=2.828427", (8.0, 0.0), (10.0, 2.0)),  # The chamfer's own length: √2 times the side at 90°.
        ("RND=2", (8.0, 0.0), (10.0, 2.0)),
    ],
)
def test_a_corner_lies_between_its_block_and_the_next(
    corner: str, first: tuple[float, float], second: tuple[float, float]
) -> None:
    found = ends(run(f"G1 X10 {corner} F100\nY10"))
    assert [point[:2] for point in found] == [first, pytest.approx(second, abs=1e-6), (10.0, 10.0)]


def test_a_chamfer_is_as_long_as_it_is_said_at_any_angle() -> None:
    # Back at 60° to the way it came: from (10, 0) towards (5, 5 √3).
    end_y = 10.0 * math.sin(math.radians(60))
    found = ends(run(f"G1 X10 CHF=2 F100\nX5 Y{end_y:.6f}"))
    assert math.dist(found[0], found[1]) == pytest.approx(2.0, abs=1e-5)


def test_modal_rounding_stays_until_it_is_0_and_is_left_out_where_nothing_fits() -> None:
    moves = run("G1 X10 RNDM=2 F100\nY10\nX0 RNDM=0\nY0")
    assert [letter for letter, _ in cuts(moves)] == ["L", "A", "L", "A", "L", "L"]
    assert [letter for letter, _ in cuts(run("G1 X10 RNDM=2 F100\nZ5\nY10\nRNDM=0"))] == ["L", "L", "L"]


def test_a_corner_has_a_feed_of_its_own() -> None:
    feeds = [
        move.feed_mm_min for move in run("G1 X10 RND=2 FRC=50 F100\nY10 CHR=1 FRCM=70\nX0") if isinstance(move, Linear | Arc)
    ]
    assert feeds == [100.0, 50.0, 100.0, 70.0, 100.0]


def test_a_corner_that_does_not_fit_or_has_no_cut_behind_it_is_refused() -> None:
    with pytest.raises(PartProgramError, match="line 2: RND=12: 12 mm do not fit"):
        run("G1 X10 RND=12 F100\nY10")
    with pytest.raises(PartProgramError, match="RND=2: the next motion has to be a cut"):
        run("G1 X10 RND=2 F100\nG0 Z5")
    for behind in ("M30", "G18\nX20", "Z5", "TRANS X5", "CYCLE81(10,0,1,-5)"):
        with pytest.raises(PartProgramError, match=r"RND=2|TRANS|CYCLE81"):
            run(f"G1 X10 RND=2 F100\n{behind}")
    assert [letter for letter, _ in cuts(run("G1 X10 RNDM=2 F100\nG18\nX20 Z5\nRNDM=0"))] == ["L", "L"]


@pytest.mark.parametrize(
    ("text", "feed", "per_rev"),
    [
        ("S500 M3\nG95 G1 X10 F0.2", 100.0, 0.2),
        ("G93 G1 X10 F2", 20.0, None),
        ("G1 FB=30 X10 F100", 30.0, None),
        ("S500 M3\nG33 Z-10 K1.5", 750.0, 1.5),
        ("S500 M3 F250\nG63 Z-10", 250.0, None),
    ],
)
def test_a_feed_is_what_its_mode_makes_of_it(text: str, feed: float, per_rev: float | None) -> None:
    move = next(move for move in run(text) if isinstance(move, Linear))
    assert move.feed_mm_min == pytest.approx(feed)
    assert move.feed_per_rev_mm == per_rev


def test_a_change_of_the_kind_of_feed_needs_a_new_f() -> None:
    with pytest.raises(PartProgramError, match="no feed"):
        run("S500 M3\nG94 G1 X1 F100\nG95 X2")


def test_rigid_tapping_turns_the_spindle_with_the_thread_and_back() -> None:
    assert run("S500\nG331 Z-10 K1.25\nG332 Z2 K1.25") == [
        Spindle(1, 500.0, 1),
        Linear(1, (0.0, 0.0, -10.0), 625.0, 1.25),
        Spindle(1, 0.0, 0),
        Spindle(2, 500.0, -1),
        Linear(2, (0.0, 0.0, 2.0), 625.0, 1.25),
        Spindle(2, 0.0, 0),
    ]


def test_surface_speed_follows_the_radius_up_to_its_limit() -> None:
    moves = run("G0 X50\nG96 S100 LIMS=2000 M3\nG1 X10 F0.2\nX5\nG97 X50")
    speeds = [move.rpm for move in moves if isinstance(move, Spindle)]
    assert speeds == pytest.approx([100_000 / math.tau / 50, 100_000 / math.tau / 10, 2000.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("G4 F2.5", [Dwell(0, 2.5)]),
        ("S300 M3\nG4 S10", [Spindle(0, 300.0, 1), Dwell(1, 2.0)]),
        ("S1=300 M1=4", [Spindle(0, 300.0, -1)]),
        ("S300 M3\nS400", [Spindle(0, 300.0, 1), Spindle(1, 400.0, 1)]),
        ("S300 M3\nG26 S200\nS300", [Spindle(0, 300.0, 1), Spindle(2, 200.0, 1)]),
        ("SPOS=90", [SpindleOrient(0)]),
        ("M19", [SpindleOrient(0)]),
        ("M8\nM9", [Coolant(0, True), Coolant(1, False)]),
        ("M0\nM1\nM2", [ProgramStop(0, False), ProgramEnd(2)]),
        ('M41 H5\nMSG("A")\nSTOPRE\nFGROUP(X,Y)\nCOMPCAD\nG601 CFC CUT2D', []),
        ("G60\nG64", [ExactStop(0, True), ExactStop(1, False)]),
        ("G9 G0 X1", [ExactStop(0, True), Rapid(0, (1.0, 0.0, 0.0)), ExactStop(0, False)]),
        ("G641 ADIS=0.5\nG60", [Tolerance(0, 0.5), ExactStop(1, True), Tolerance(1, None)]),
        ("G642\nCTOL=0.02 OTOL=0.1\nCTOL=-1", [Tolerance(1, 0.02, 0.1), Tolerance(2, None, 0.1)]),
        ("CYCLE832(0.05,1,1)\nCYCLE832()", [Tolerance(0, 0.05), Tolerance(1, None)]),
        ("CYCLE832(0.05,13,0.2)\nCYCLE832(0.1,0)", [Tolerance(0, 0.05, 0.2), Tolerance(1, None)]),
        ("SOFT\nBRISK\nFFWON\nFFWOF", [JerkLimit(0, True), JerkLimit(1, False), FeedForward(2, True), FeedForward(3, False)]),
        ("M13", []),
        ('CYCLE800()\nCYCLE800(0,"TC1",100000,57,0,0,0,0,0,0,0,0,0,-1)\nTRAFOOF', []),
        ("CYCLE832(0.02,_ROUGH,1)", [Tolerance(0, 0.02)]),
    ],
)
def test_what_is_not_a_motion_is_put_out_as_it_is(text: str, expected: list[object]) -> None:
    assert run(text, Settings(builder_m_codes=frozenset({13}))) == expected


def test_an_optional_stop_stops_where_its_switch_is_on() -> None:
    assert run("M1", Settings(optional_stop=True)) == [ProgramStop(0, True)]


def test_a_tool_is_called_by_number_or_name_and_brings_its_length() -> None:
    table = Settings(tool_offsets={7: ToolOffset(120.0, 5.0)}, tool_numbers={"MILL 10": 7})
    for word in ("T7", 'T="mill 10"', 'T="7"', "T=3+4"):
        assert run(f"{word} M6\nG0 X1\nZ5\nD0 Z5\nD1 X2\nZ5", table) == [
            ToolChange(0, 7),
            Rapid(1, (1.0, 0.0, 0.0)),
            ToolLength(2, 120.0),
            Rapid(2, (1.0, 0.0, 125.0)),
            ToolLength(3, 0.0),
            Rapid(3, (1.0, 0.0, 5.0)),
            Rapid(4, (2.0, 0.0, 5.0)),
            ToolLength(5, 120.0),
            Rapid(5, (2.0, 0.0, 125.0)),
        ]


def test_the_length_of_a_tool_acts_along_z_in_every_plane() -> None:
    text = "T2 M6\nG0 X0 Y0 Z5\nG19 G3 Y2 Z3 J2 K0 F100\nG17 G1 X1"
    assert ends(run(text, TOOLS)) == [(0.0, 0.0, 105.0), (0.0, 2.0, 103.0), (1.0, 2.0, 103.0)]


def test_a_plain_block_and_the_same_one_the_long_way_make_the_same_move() -> None:
    plain = "G17 G90 G54\nG1 X1 Y2 F100\nG2 X3 Y2 I1 J0\nG91 X5\nG90 G3 X0 Y0 I-4 J-1\nG0 Z5\nCT X9 Y9"
    long = "G17 G90 G54\nG1 X=1 Y=2 F=100\nG2 X=3 Y=2 I=1 J=0\nG91 G2 X=5 I=2.5\nG90 G3 X=0 Y=0 I=-4 J=-1\nG0 Z=5\nCT X=9 Y=9"
    plain = plain.replace("G91 X5", "G91 X5 I2.5")
    offsets = Settings(work_offsets_mm={"G54": (10.0, 20.0, 30.0)}, arc_radius_error_mm_max=5.0)
    assert run(plain, offsets) == run(long, offsets)
