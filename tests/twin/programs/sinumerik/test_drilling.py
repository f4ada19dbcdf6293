"""The drilling cycles: every height, feed, pause and turn of the spindle, as the manual describes them."""

import pytest

from tests.twin.programs.sinumerik.reading import ends, heights, run
from twin.programs import Dwell, Linear, Move, ProgramStop, Rapid, Settings, Spindle, SpindleOrient

BEFORE = "G17 G90 S500 M3 F200\nG0 Z20\n"


def at_hole(cycle: str, before: str = BEFORE) -> list[Move]:
    """Return what a cycle makes, without what stands before it."""
    line = before.count("\n")
    return [move for move in run(before + cycle) if move.line == line]


def steps(moves: list[Move]) -> list[object]:
    """Heights of motions, and the rest by its figure: pauses in s, the spindle with its sign."""
    found: list[object] = []
    for move in moves:
        if isinstance(move, Dwell):
            found.append(("pause", move.seconds))
        elif isinstance(move, Spindle):
            found.append(("spindle", move.rpm * move.direction))
        elif isinstance(move, Rapid):
            found.append(("R", round(move.end_mm[2], 6)))
        elif isinstance(move, Linear):
            found.append(("L", round(move.end_mm[2], 6)))
        else:
            found.append(type(move).__name__)
    return found


@pytest.mark.parametrize(
    ("cycle", "expected"),
    [
        ("CYCLE81(10,0,2,-15)", [("R", 2.0), ("L", -15.0), ("R", 10.0)]),
        ("CYCLE81(10,0,2,,15)", [("R", 2.0), ("L", -15.0), ("R", 10.0)]),
        ("CYCLE81(10,0,2,-99,15)", [("R", 2.0), ("L", -15.0), ("R", 10.0)]),  # The relative depth goes first.
        ("CYCLE81(10,3,,-15)", [("R", 3.0), ("L", -15.0), ("R", 10.0)]),
        ("CYCLE82(10,0,2,-15,,1.5)", [("R", 2.0), ("L", -15.0), ("pause", 1.5), ("R", 10.0)]),
        ("CYCLE82(10,0,2,-15,,-5)", [("R", 2.0), ("L", -15.0), ("pause", 0.6), ("R", 10.0)]),  # 5 turns at 500/min
        ("CYCLE82(10,0,2,,15,5,0,1,21)", [("R", 2.0), ("L", -15.0), ("pause", 0.6), ("R", 10.0)]),
        ("CYCLE85(10,0,2,-15,,1,100,300)", [("R", 2.0), ("L", -15.0), ("pause", 1.0), ("L", 2.0), ("R", 10.0)]),
        (
            "CYCLE86(10,0,2,-15,,1,4,-1,-2,1,90)",
            [
                ("spindle", -500.0),
                ("R", 2.0),
                ("L", -15.0),
                ("pause", 1.0),
                "SpindleOrient",
                ("R", -14.0),
                ("R", 2.0),
                ("R", 10.0),
            ],
        ),
        ("CYCLE87(10,0,2,-15,,3)", [("R", 2.0), ("L", -15.0), ("spindle", 0.0), "ProgramStop", ("R", 10.0)]),
        ("CYCLE88(10,0,2,-15,,1,3)", [("R", 2.0), ("L", -15.0), ("pause", 1.0), ("spindle", 0.0), "ProgramStop", ("R", 10.0)]),
        ("CYCLE89(10,0,2,-15,,1)", [("R", 2.0), ("L", -15.0), ("pause", 1.0), ("L", 2.0), ("R", 10.0)]),
        # Chip removal: out to the start, back to 0.6 mm above the last depth (30 mm of depth and less).
        (
            "CYCLE83(10,0,2,-25,,,10,0,0.5,0.2,0.5,1)",
            [
                *(
                    ("R", 2.0),
                    ("L", -10.0),
                    ("pause", 0.5),
                    ("R", 2.0),
                    ("pause", 0.2),
                    ("R", -9.4),
                    ("L", -20.0),
                    ("pause", 0.5),
                ),
                *(("R", 2.0), ("pause", 0.2), ("R", -19.4), ("L", -25.0), ("pause", 0.5), ("R", 10.0)),
            ],
        ),
        # Chip breaking: back by 1 mm with feed; or by _VRT.
        (
            "CYCLE83(10,0,2,-25,,-10)",
            [("R", 2.0), ("L", -10.0), ("L", -9.0), ("L", -20.0), ("L", -19.0), ("L", -25.0), ("R", 10.0)],
        ),
        (
            "CYCLE83(10,0,2,-25,,-10,,,,,,0,3,,2)",
            [("R", 2.0), ("L", -10.0), ("L", -8.0), ("L", -20.0), ("L", -18.0), ("L", -25.0), ("R", 10.0)],
        ),
        (
            "CYCLE84(10,0,2,-15,,1,5,,1.25,0,400,800)",
            [
                *(("R", 2.0), "SpindleOrient", ("spindle", 400.0), ("L", -15.0), ("pause", 1.0), ("spindle", -800.0), ("L", 2.0)),
                *(("spindle", 0.0), ("R", 10.0), ("spindle", 0.0)),
            ],
        ),
        (
            "CYCLE840(10,0,2,-15,,1,0,3,0,,1.25)",
            [
                *(("R", 2.0), ("L", -15.0), ("pause", 1.0), ("spindle", -500.0), ("L", 2.0), ("R", 10.0), ("spindle", 500.0)),
            ],
        ),
    ],
)
def test_a_cycle_does_step_by_step_what_the_manual_says(cycle: str, expected: list[object]) -> None:
    assert steps(at_hole(cycle)) == expected


def test_a_reamer_goes_in_and_out_by_its_own_feeds_and_the_feed_before_holds_again() -> None:
    moves = run(BEFORE + "CYCLE85(10,0,2,-15,,,100,300)\nG1 X5")
    assert [move.feed_mm_min for move in moves if isinstance(move, Linear)] == [100.0, 300.0, 200.0]


def test_the_first_stroke_has_a_factor_on_its_feed() -> None:
    for factor in ("0.5", "50"):
        feeds = [move.feed_mm_min for move in at_hole(f"CYCLE83(10,0,2,-25,,-10,,0,0,0,{factor},1)") if isinstance(move, Linear)]
        assert feeds == [100.0, 200.0, 200.0]


@pytest.mark.parametrize(
    ("degression", "depths"),
    [
        ("", [-20.0, -40.0, -60.0, -80.0, -100.0]),
        ("5", [-20.0, -35.0, -45.0, -50.0, -55.0, -60.0, -65.0, -70.0, -75.0, -80.0, -85.0, -90.0, -95.0, -100.0]),
        ("-0.5,,,,,,10", [-20.0, -30.0, -40.0, -50.0, -60.0, -70.0, -80.0, -90.0, -100.0]),
    ],
)
def test_strokes_grow_shorter_as_the_degression_says(degression: str, depths: list[float]) -> None:
    moves = at_hole(f"CYCLE83(10,0,2,-100,,-20,,{degression})")
    down = [height for letter, height in heights(moves) if letter == "L" and height in depths]
    assert down == depths


def test_the_lead_of_a_tap_is_that_of_its_metric_size_and_its_sign_the_hand() -> None:
    right, left = at_hole("CYCLE84(10,0,2,-15,,,3,8,,0,400)"), at_hole("CYCLE84(10,0,2,-15,,,3,-8,,0,400)")
    assert [move.feed_per_rev_mm for move in right if isinstance(move, Linear)] == [1.25, 1.25]
    assert [move.feed_mm_min for move in right if isinstance(move, Linear)] == [500.0, 500.0]
    assert [move.direction for move in right if isinstance(move, Spindle)] == [1, -1, 0, 1]
    assert [move.direction for move in left if isinstance(move, Spindle)] == [-1, 1, 0, 1]


def test_tapping_in_strokes_draws_back_or_leaves() -> None:
    breaking = at_hole("CYCLE84(10,0,2,-15,,,3,8,,0,400,,,,,1,6,2)")
    removing = at_hole("CYCLE84(10,0,2,-15,,,3,8,,0,400,,,,,2,6)")
    assert [height for letter, height in heights(breaking) if letter == "L"] == [-6.0, -4.0, -12.0, -10.0, -15.0, 2.0]
    assert [height for letter, height in heights(removing) if letter == "L"] == [-6.0, 2.0, -12.0, 2.0, -15.0, 2.0]


def test_a_tap_with_a_chuck_and_no_encoder_takes_its_lead_from_the_feed() -> None:
    moves = at_hole("CYCLE840(10,0,2,-15,,,4,3,1)", "G17 S500 M3 F625\nG0 Z20\n")
    assert [move.feed_per_rev_mm for move in moves if isinstance(move, Linear)] == [1.25, 1.25]


def test_a_cycle_drills_along_the_normal_of_its_plane() -> None:
    assert [end[1] for end in ends(run("G18 S500 M3 F200\nG0 Y20\nCYCLE81(10,0,2,-5)"))] == [20.0, 2.0, -5.0, 10.0]


def test_a_cycle_leaves_the_modes_as_they_were() -> None:
    moves = run(BEFORE + "G91 G1\nCYCLE82(10,0,2,-15)\nX5")
    assert moves[-1] == Linear(4, (5.0, 0.0, 10.0), 200.0)


def test_oriented_boring_moves_off_the_wall_and_ends_over_the_hole() -> None:
    moves = run(BEFORE + "X7 Y8\nCYCLE86(10,0,2,-15,,,3,-1,-2,0,45)")
    assert ends(moves)[-3:] == [(6.0, 6.0, -15.0), (6.0, 6.0, 2.0), (7.0, 8.0, 10.0)]
    assert sum(isinstance(move, SpindleOrient) for move in moves) == 1
    assert not any(isinstance(move, ProgramStop) for move in moves)


def holes(pattern: str, before: str = "X0 Y0") -> list[tuple[float, float]]:
    """The places that a pattern drills."""
    moves = run(f"{BEFORE}{before}\nMCALL CYCLE81(10,0,2,-5)\n{pattern}\nMCALL\nX99")
    return [(round(move.end_mm[0], 4) + 0.0, round(move.end_mm[1], 4) + 0.0) for move in moves if isinstance(move, Linear)]


@pytest.mark.parametrize(
    ("pattern", "before", "places"),
    [
        ("HOLES1(10,20,0,5,10,3)", "X0 Y0", [(15.0, 20.0), (25.0, 20.0), (35.0, 20.0)]),
        ("HOLES1(10,20,0,5,10,3)", "X99 Y0", [(35.0, 20.0), (25.0, 20.0), (15.0, 20.0)]),
        ("HOLES1(0,0,90,0,10,2)", "X0 Y0", [(0.0, 0.0), (0.0, 10.0)]),
        ("HOLES2(0,0,10,0,,4)", "X0 Y0", [(10.0, 0.0), (0.0, 10.0), (-10.0, 0.0), (0.0, -10.0)]),
        ("HOLES2(0,0,10,0,-90,2)", "X0 Y0", [(10.0, 0.0), (0.0, -10.0)]),
        (
            "CYCLE801(30,20,0,10,15,3,2)",
            "X0 Y0",
            [(30.0, 20.0), (40.0, 20.0), (50.0, 20.0), (50.0, 35.0), (40.0, 35.0), (30.0, 35.0)],
        ),
        ("CYCLE801(30,20,0,10,15,2,2)", "X99 Y99", [(40.0, 35.0), (30.0, 35.0), (30.0, 20.0), (40.0, 20.0)]),
        ("CYCLE802(111111111,111111111,5,6,7,8)", "X0 Y0", [(5.0, 6.0), (7.0, 8.0)]),
        ("CYCLE802(222222222,222222222,5,6,7,8)", "X1 Y1", [(6.0, 7.0), (13.0, 15.0)]),
        ("X5 Y6\nX7", "X0 Y0", [(5.0, 6.0), (7.0, 6.0)]),
        ("M8\nF100", "X0 Y0", []),
    ],
)
def test_mcall_drills_at_every_place_until_it_is_off(pattern: str, before: str, places: list[tuple[float, float]]) -> None:
    assert holes(pattern, before) == places


def test_a_pattern_turns_with_its_angle_and_with_the_frame() -> None:
    assert holes("CYCLE801(0,0,90,10,5,2,2)") == [(0.0, 0.0), (0.0, 10.0), (-5.0, 10.0), (-5.0, 0.0)]
    assert holes("ATRANS X100\nHOLES2(0,0,10,0,,2)") == [(110.0, 0.0), (90.0, 0.0)]


def test_a_subprogram_is_called_at_the_places_of_a_pattern() -> None:
    programs = Settings(programs={"dot": "G91 G1 Z-3 F100\nZ3\nG90\nM17"})
    moves = run("G0 Z5\nMCALL DOT\nHOLES1(0,0,0,0,10,3)\nMCALL\nX99", programs)
    assert [end[::2] for end in ends(moves)] == [
        (0.0, 5.0),
        *((x, z) for x in (0.0, 10.0, 20.0) for z in (5.0, 2.0, 5.0)),
        (99.0, 5.0),
    ]
    assert {(move.line, move.program) for move in moves} == {(0, None), (2, None), (0, "DOT"), (1, "DOT"), (4, None)}
