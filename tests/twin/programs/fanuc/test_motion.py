"""Lines, arcs, units, feeds, dwells, corners: figures worked out by hand."""

import math

import pytest

from twin.errors import PartProgramError
from twin.programs import (
    Arc,
    Coolant,
    Dwell,
    DwellUnit,
    ExactStop,
    IntegerWords,
    Linear,
    LookAhead,
    Move,
    ProgramEnd,
    ProgramStop,
    Rapid,
    Settings,
    Spindle,
    SpindleOrient,
    ToolChange,
)
from twin.programs.fanuc.interpreter import interpret


def ends(moves: list[Move]) -> list[tuple[float, ...]]:
    """Return where each motion ends, to a nanometre."""
    return [tuple(round(a, 6) + 0.0 for a in move.end_mm) for move in moves if isinstance(move, Rapid | Linear | Arc)]


def arc_of(text: str) -> Arc:
    return next(move for move in interpret(text) if isinstance(move, Arc))


def test_each_move_keeps_its_line_and_modes_carry_over() -> None:
    assert interpret("%\nO1 (PART)\nN10 G21 G90\nG0 X1.\nY2.\n\nG1 Z-3. F250.\nX5.\nM30\n%\nG0 X99.") == [
        Rapid(3, (1.0, 0.0, 0.0)),
        Rapid(4, (1.0, 2.0, 0.0)),
        Linear(6, (1.0, 2.0, -3.0), 250.0),
        Linear(7, (5.0, 2.0, -3.0), 250.0),
        ProgramEnd(8),
    ]


def test_inches_become_millimetres_in_lengths_and_feeds() -> None:
    assert interpret("G20 G1 X1. F10.\nG91 X.25") == [Linear(0, (25.4, 0.0, 0.0), 254.0), Linear(1, (31.75, 0.0, 0.0), 254.0)]


@pytest.mark.parametrize(
    ("text", "end", "feed"),
    [
        ("G21 G1 X100 F100", 0.1, 100.0),
        ("G21 G1 X100. F100.", 100.0, 100.0),
        ("G20 G1 X10000 F1000", 25.4, 254.0),
        ("G21\nG1 X-1500 F50", -1.5, 50.0),
    ],
)
def test_words_without_a_point_count_increments_where_the_control_is_set_so(text: str, end: float, feed: float) -> None:
    (move,) = interpret(text, Settings(integer_words=IntegerWords.INCREMENTS))
    assert isinstance(move, Linear)
    assert move.end_mm[0] == pytest.approx(end, abs=1e-12)
    assert move.feed_mm_min == pytest.approx(feed)


def test_words_without_a_point_are_units_by_default() -> None:
    assert ends(interpret("G0 X100")) == [(100.0, 0.0, 0.0)]


def test_a_short_arc_and_a_long_arc_of_one_chord_have_their_centres_on_either_side() -> None:
    # Chord 6 along x, radius 5: the centre is 4 away from the chord. Counter-clockwise and short: to the left, y = +4.
    short, long = arc_of("G3 X6. R5. F100."), arc_of("G3 X6. R-5. F100.")
    assert short.centre_mm == pytest.approx((3.0, 4.0, 0.0))
    assert long.centre_mm == pytest.approx((3.0, -4.0, 0.0))
    half = math.asin(3 / 5)
    assert short.sweep_rad == pytest.approx(2 * half)
    assert long.sweep_rad == pytest.approx(math.tau - 2 * half)
    assert arc_of("G2 X6. R5. F100.").centre_mm == pytest.approx((3.0, -4.0, 0.0))


def test_a_full_circle_keeps_its_centre_and_a_helix_its_start_height() -> None:
    assert arc_of("G1 X1. Y2. Z3. F100.\nG2 I4. J-3.") == Arc(1, (1.0, 2.0, 3.0), (5.0, -1.0, 3.0), 17, -math.tau, 100.0)
    helix = arc_of("G1 X10. F100.\nG3 X0 Y10. Z5. I-10.")
    assert helix.centre_mm == (0.0, 0.0, 0.0)
    assert helix.end_mm == (0.0, 10.0, 5.0)
    assert helix.sweep_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("plane", "words", "centre"),
    [
        (17, "X10. Y10. I10.", (10.0, 0.0, 0.0)),
        (18, "Z10. X10. K10.", (0.0, 0.0, 10.0)),
        (19, "Y10. Z10. J10.", (0.0, 10.0, 0.0)),
    ],
)
def test_an_arc_turns_about_the_normal_of_its_plane(plane: int, words: str, centre: tuple[float, ...]) -> None:
    # From the first axis' negative side to the top of the second axis: clockwise, a quarter.
    arc = arc_of(f"G{plane} G2 {words} F100.")
    assert (arc.plane, arc.centre_mm) == (plane, centre)
    assert arc.sweep_rad == pytest.approx(-math.pi / 2)


def test_feed_per_revolution_hangs_on_the_spindle() -> None:
    assert interpret("S2000 M3\nG95 G1 X10. F.1\nG94 G1 X20. F300.") == [
        Spindle(0, 2000.0, 1),
        Linear(1, (10.0, 0.0, 0.0), 200.0, 0.1),
        Linear(2, (20.0, 0.0, 0.0), 300.0),
    ]


def test_inverse_time_is_length_times_f() -> None:
    # 30 mm in 1/4 min, and a half circle of radius 10 in 1/2 min.
    line, arc = interpret("G93 G1 X30. F4.\nG3 X10. I-10. F2.")
    assert isinstance(line, Linear)
    assert line.feed_mm_min == pytest.approx(120.0)
    assert isinstance(arc, Arc)
    assert arc.feed_mm_min == pytest.approx(2 * 10 * math.pi)


def test_surface_speed_sets_the_speed_at_the_end_of_each_block() -> None:
    moves = interpret("G0 X50.\nG96 S314.159265 M3\nG1 X25. F100.\nG97 S1000\nX10.")
    speeds = [(move.line, round(move.rpm, 3)) for move in moves if isinstance(move, Spindle)]
    # V = 314.159 m/min over 2π · 50 mm is 1000 rev/min; at 25 mm twice that.
    assert speeds == [(1, 1000.0), (2, 2000.0), (3, 1000.0)]


def test_a_dwell_is_in_milliseconds_by_p_and_in_seconds_by_x() -> None:
    assert interpret("G4 P400\nG4 X1.5\nG4 U2.") == [Dwell(0, 0.4), Dwell(1, 1.5), Dwell(2, 2.0)]
    assert interpret("G4 P0.4", Settings(dwell_unit=DwellUnit.SECONDS)) == [Dwell(0, 0.4)]


def test_machine_functions_come_out_in_the_order_of_a_control() -> None:
    text = "N1 T7 M6\nS3000 M3 G4 P400\nM8\nS3500\nG61\nG9 G1 X1. F10.\nG64\nG5.1 Q1\nG8 P0\nM19\nM5\nM9\nM1\nM0\nM30"
    assert interpret(text, Settings(optional_stop=True)) == [
        ToolChange(0, 7),
        *(Spindle(1, 3000.0, 1), Dwell(1, 0.4), Coolant(2, True), Spindle(3, 3500.0, 1), ExactStop(4, True)),
        *(Linear(5, (1.0, 0.0, 0.0), 10.0), ExactStop(6, False), LookAhead(7, True), LookAhead(8, False)),
        *(SpindleOrient(9), Spindle(10, 0.0, 0), Coolant(11, False)),
        *(ProgramStop(12, True), ProgramStop(13, False), ProgramEnd(14)),
    ]
    assert ProgramStop(0, True) not in interpret("M1")


def test_a_single_exact_stop_goes_on_and_off_about_its_move() -> None:
    assert interpret("G9 G0 X1.") == [ExactStop(0, True), Rapid(0, (1.0, 0.0, 0.0)), ExactStop(0, False)]


def test_a_tool_may_be_chosen_long_before_it_is_changed() -> None:
    assert interpret("T4\nG0 X1.\nM6 T5\nM6") == [Rapid(1, (1.0, 0.0, 0.0)), ToolChange(2, 5), ToolChange(3, 5)]


def test_block_skip_takes_the_block_or_its_rest_by_its_switch() -> None:
    text = "/G0 X1.\n/2 G0 Y2.\nG0 Z3. /3 X9."
    assert ends(interpret(text)) == [(1, 0, 0), (1, 2, 0), (9, 2, 3)]
    assert ends(interpret(text, Settings(block_skip=frozenset({1, 3})))) == [(0, 2, 0), (0, 2, 3)]


def test_skip_and_thread_are_cuts() -> None:
    moves = interpret("S100 M3\nG31 X5. F50.\n#1=#5061\nG33 Z-10. F1.5\nG0 X[#1*2]")
    assert moves[1:] == [
        Linear(1, (5.0, 0.0, 0.0), 50.0),
        Linear(3, (5.0, 0.0, -10.0), 150.0, 1.5),
        Rapid(4, (10.0, 0.0, -10.0)),
    ]


def test_a_rounding_touches_both_lines_and_a_chamfer_cuts_equal_lengths() -> None:
    assert interpret("G1 X20.,R5. F100.\nY20.,C3.\nX0") == [
        Linear(0, (15.0, 0.0, 0.0), 100.0),
        Arc(0, (20.0, 5.0, 0.0), (15.0, 5.0, 0.0), 17, pytest.approx(math.pi / 2), 100.0),
        Linear(1, (20.0, 17.0, 0.0), 100.0),
        Linear(1, (17.0, 20.0, 0.0), 100.0),
        Linear(2, (0.0, 20.0, 0.0), 100.0),
    ]


def test_a_rounding_between_a_line_and_an_arc_touches_both() -> None:
    # A line up to (20, 0), then an arc about (20, 10) that turns back over the line's end: the rounding is inside of both.
    line, corner, arc = interpret("G1 X20. F100. ,R2.\nG3 X10. Y-10. R20.")[:3]
    assert isinstance(line, Linear) and isinstance(corner, Arc) and isinstance(arc, Arc)
    assert math.dist(corner.centre_mm, line.end_mm) == pytest.approx(2.0)
    assert corner.centre_mm[0] == pytest.approx(line.end_mm[0])
    far = math.dist(corner.centre_mm, arc.centre_mm)
    assert min(abs(far - 22.0), abs(far - 18.0)) < 1e-9
    assert math.dist(corner.end_mm, arc.centre_mm) == pytest.approx(20.0)


def test_a_dwell_between_the_sides_of_a_corner_comes_after_it() -> None:
    moves = interpret("G1 X10.,C1. F100.\nG4 P100\nY10.")
    assert [type(move).__name__ for move in moves] == ["Linear", "Linear", "Dwell", "Linear"]


def test_rotary_axes_follow_in_degrees_whatever_the_unit() -> None:
    assert ends(interpret("G20 G0 X1. A90.\nG91 A-45.", Settings(axes=("x", "y", "z", "a")))) == [
        (25.4, 0, 0, 90),
        (25.4, 0, 0, 45),
    ]


@pytest.mark.parametrize(
    ("text", "line", "word", "reason"),
    [
        ("G0 X1\nG1 X2", 2, "", "no feed"),
        ("G1 X1 F10 Q\n", 1, "Q", "ends inside"),
        ("G1 X1O. F10\n", 1, "X1O.", "the letter O is no 0"),
        ("g0 x1 g77", 1, "g77", "not known"),
        ("G0 X1 X2", 1, "X2", "twice"),
        ("G0 A1", 1, "A1", "no axis A"),
        ("G0 X1 E3", 1, "E3", "no meaning"),
        ("G1 X1 R2 F10", 1, "R2", ",R"),
        ("G2 X10 R2 F10", 1, "R2", "diameter"),
        ("G2 R2 F10", 1, "R2", "one point"),
        ("G2 X10 F10", 1, "", "needs R"),
        ("G2 X10 I3 F10", 1, "", "correct I, J, K"),
        ("G0 X1234567890", 1, "X1234567890", "nine digits"),
        ("M6", 1, "M6", "write T"),
        ("M77", 1, "M77", "builder_m_codes"),
        ("G28", 1, "G28", "intermediate"),
        ("G4", 1, "G4", "P in ms"),
        ("G91 G53 X1", 1, "G53", "G90"),
        ("G95 G1 X1 F.1", 1, "", "turning spindle"),
        ("G93 G1 X1 F1\nX2", 2, "", "its own F"),
        ("G96 M3", 1, "G96", "write S"),
        ("G0 X1 (NOTE", 1, "(NOTE", "no end"),
        ("G0 X1 ~", 1, "~", "no meaning"),
        ("G1 X5,R2 F10\nG0 Y5", 2, ",R2", "G1, G2 or G3"),
        ("G1 X5,R2 F10\nM8\nY5", 2, ",R2", "dwell"),
        ("G1 X5,R20 F10\nY5", 2, ",R20", "do not fit"),
        ("G1 X5,C2 F10", 1, ",C2", "the program ends"),
        ("G0 X1,C2", 1, ",C", "block of G1"),
        ("G10 X1", 1, "G10", "needs L"),
        ("G41 D9 G1 X1 F10", 1, "D9", "offset table"),
        ("G54.1 P49 X0", 1, "P49", "from 1 to 48"),
    ],
)
def test_a_wrong_block_is_named_with_its_line_its_word_and_a_way_out(text: str, line: int, word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        interpret(text)
    assert (caught.value.line, caught.value.word) == (line, word)
    assert reason in caught.value.reason


def test_a_builders_m_code_is_passed_over_where_it_is_named() -> None:
    assert interpret("M77", Settings(builder_m_codes=frozenset({77}))) == []
