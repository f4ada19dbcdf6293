"""Canned cycles step by step, as the manual draws them."""

import pytest

from twin.errors import PartProgramError
from twin.programs import Dwell, Linear, Move, ProgramStop, Rapid, Settings, Spindle, SpindleOrient
from twin.programs.fanuc.interpreter import interpret

SETTINGS = Settings(peck_retract_mm=0.5, peck_clearance_mm=1.0)


def steps(text: str, settings: Settings = SETTINGS) -> list[str]:
    """The moves of a program in short: rapids r, cuts c with where they end, and what happens in between."""
    return [step(move) for move in interpret(text, settings)]


def step(move: Move) -> str:
    if isinstance(move, Rapid | Linear):
        where = " ".join(f"{value + 0.0:g}" for value in (round(a, 6) for a in move.end_mm))
        return f"{'r' if isinstance(move, Rapid) else 'c'} {where}"
    if isinstance(move, Dwell):
        return f"dwell {move.seconds:g}"
    if isinstance(move, Spindle):
        return f"spindle {move.direction:+d}"
    return {SpindleOrient: "orient", ProgramStop: "stop"}[type(move)]


HEAD = "S1000 M3\nG0 Z10.\n"


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("G98 G81 X5. Z-4. R2. F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,r 5 0 10"),
        ("G99 G82 X5. Z-4. R2. P500 F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,dwell 0.5,r 5 0 2"),
        (
            "G99 G83 X5. Z-5. R2. Q3. F100.",
            "r 5 0 10,r 5 0 2,c 5 0 -1,r 5 0 2,r 5 0 0,c 5 0 -4,r 5 0 2,r 5 0 -3,c 5 0 -5,r 5 0 2",
        ),
        ("G99 G73 X5. Z-5. R2. Q3. F100.", "r 5 0 10,r 5 0 2,c 5 0 -1,r 5 0 -0.5,c 5 0 -4,r 5 0 -3.5,c 5 0 -5,r 5 0 2"),
        ("G98 G85 X5. Z-4. R2. F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,c 5 0 2,r 5 0 10"),
        ("G99 G89 X5. Z-4. R2. P250 F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,dwell 0.25,c 5 0 2"),
        ("G98 G86 X5. Z-4. R2. F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,spindle +0,r 5 0 10,spindle +1"),
        ("G98 G88 X5. Z-4. R2. P100 F100.", "r 5 0 10,r 5 0 2,c 5 0 -4,dwell 0.1,spindle +0,stop,r 5 0 10,spindle +1"),
        (
            "G99 G76 X5. Z-4. R2. Q.2 P100 F100.",
            "r 5 0 10,r 5 0 2,c 5 0 -4,dwell 0.1,orient,r 5.2 0 -4,r 5.2 0 2,r 5 0 2,spindle +1",
        ),
        (
            "G98 G87 X5. Z6. R-10. I0 J-.3 F100.",
            "r 5 0 10,orient,r 5 -0.3 10,r 5 -0.3 -10,r 5 0 -10,spindle +1,c 5 0 6,"
            "orient,r 5 -0.3 6,r 5 -0.3 10,r 5 0 10,spindle +1",
        ),
        ("G99 G84 X5. Z-4. R2. P200 F1250.", "r 5 0 10,r 5 0 2,c 5 0 -4,dwell 0.2,spindle -1,c 5 0 2,dwell 0.2,spindle +1"),
        ("G98 G74 X5. Z-4. R2. F1250.", "r 5 0 10,r 5 0 2,spindle -1,c 5 0 -4,spindle +1,c 5 0 2,spindle -1,r 5 0 10"),
        ("M29 S500\nG99 G84 X5. Z-4. R2. F500.", "spindle +1,r 5 0 10,r 5 0 2,c 5 0 -4,spindle -1,c 5 0 2,spindle +0"),
        ("G99 G81 X5. Z-4. R2. F100. K0\nX7.", "r 7 0 10,r 7 0 2,c 7 0 -4,r 7 0 2"),
        ("G91 G98 G81 X5. Z-6. R-8. F100. K2", "r 5 0 10,r 5 0 2,c 5 0 -4,r 5 0 10,r 10 0 10,r 10 0 2,c 10 0 -4,r 10 0 10"),
        ("G18 G98 G81 X5. Z1. Y-4. R-2. F100.", "r 5 0 1,r 5 -2 1,c 5 -4 1,r 5 0 1"),
    ],
)
def test_a_cycle_makes_its_steps(block: str, expected: str) -> None:
    assert ",".join(steps(HEAD + block)[2:]) == expected


def test_tapping_is_tied_to_the_spindle() -> None:
    moves = interpret("S500 M3\nG84 X5. Z-4. R2. F625.")
    assert [move.feed_per_rev_mm for move in moves if isinstance(move, Linear)] == [1.25, 1.25]
    moves = interpret("S500 M3\nG95 G84 X5. Z-4. R2. F1.25")
    assert [move.feed_mm_min for move in moves if isinstance(move, Linear)] == [625.0, 625.0]


def test_cycle_words_stay_until_the_cycle_is_cancelled() -> None:
    assert len(steps("G81 X1. Z-1. R1. F100.\nX2.\nG80\nX3.")) == 9
    with pytest.raises(PartProgramError, match="level R"):
        interpret("G81 X1. Z-1. R1. F100.\nG0 X5.\nG81 X1. Z-1.")


def test_a_rotated_pattern_of_holes_is_rotated() -> None:
    assert steps("G0 Z10.\nG68 X0 Y0 R90.\nG99 G81 X5. Y0 Z-1. R1. F100.")[1] == "r 0 5 10"


@pytest.mark.parametrize(
    ("block", "reason"),
    [
        ("G81 X1. R1. F100.", "depth Z"),
        ("G83 X1. Z-1. R1. F100.", "write Q"),
        ("G83 X1. Z-100. R1. Q.001 F100.", "pecks"),
        ("G84 X1. Z-1. R1. F100.", "write S and F"),
        ("G99 G87 X1. Z1. R-1. Q.1 F100.", "write G98"),
        ("G76 X1. Z-1. R1. F100.", "shift off the wall"),
        ("G81 X1. Z-1. R1. F100. K10000", "0 to 9999"),
    ],
)
def test_a_cycle_without_what_it_needs_says_so(block: str, reason: str) -> None:
    with pytest.raises(PartProgramError, match=reason):
        interpret(block)
