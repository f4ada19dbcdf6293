"""Spigots: the manual's two examples, and what holds for all: an exact contour, no tool inside it, climb by the spindle."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.programs.sinumerik.reading import run
from tests.twin.programs.sinumerik.test_milling import levels, of_cycle, points
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Settings, ToolOffset


def area(moves: list[tuple[float, float, float]]) -> float:
    """Twice the area that a way goes round in the plane, + counter-clockwise."""
    ahead = zip(moves, moves[1:] + moves[:1], strict=True)
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in ahead)


def test_the_rectangular_spigot_of_the_manual() -> None:
    """60 by 40 with corners of 15 about (80, 60), turned by 10°, 17.5 deep in two infeeds, climb: clockwise with M3."""
    moves = of_cycle("CYCLE76(10, 0, 2, -17.5, , -60, -40, 15, 80, 60, 10, 11, , , 900, 800, 0, 1, 80, 50)", 10.0)
    assert levels(moves) == [-8.75, -17.5]
    sine, cosine = math.sin(math.radians(10.0)), math.cos(math.radians(10.0))
    own = [
        ((x - 80) * cosine + (y - 60) * sine, (y - 60) * cosine - (x - 80) * sine, z) for x, y, z in points(moves) if z < -17.4
    ]
    assert (max(u for u, _, _ in own), max(abs(v) for _, v, _ in own)) == pytest.approx((52.0, 30.0))
    assert (min(u for u, _, _ in own), min(v for _, v, _ in own)) == pytest.approx((-40.0, -30.0))
    assert area(own) < 0.0
    assert {move.feed_mm_min for move in moves if isinstance(move, Arc)} == {900.0}
    assert {move.feed_mm_min for move in moves if isinstance(move, Linear)} == {800.0, 900.0}


def test_the_round_spigot_of_the_manual() -> None:
    """50 across about (60, 70), out of a blank of 55, 20 deep in two infeeds, 0.5 left at the wall, up-cut: counter-clockwise."""
    moves = of_cycle("CYCLE77(10, 0, 3, -20, , 50, 60, 70, 10, 0.5, 0, 900, 800, 1, 1, 55)", 10.0)
    assert levels(moves) == [-10.0, -20.0]
    laps = [move for move in moves if isinstance(move, Arc) and abs(move.sweep_rad) > 4.0]
    assert [move.sweep_rad for move in laps] == pytest.approx([math.tau, math.tau])
    assert all(math.dist(move.end_mm[:2], (60.0, 70.0)) == pytest.approx(25.0 + 0.5 + 10.0) for move in laps)


@pytest.mark.parametrize(
    ("vari", "side", "base", "found"),
    [(1, 0.5, 0.3, [-2.35, -4.7]), (2, 0.5, 0.3, [-2.5, -5.0]), (2, 0.0, 0.3, [-5.0]), (2, 0.0, 0.0, [-2.5, -5.0])],
)
def test_roughing_leaves_the_allowances_and_finishing_takes_them(vari: int, side: float, base: float, found: list[float]) -> None:
    moves = of_cycle(f"CYCLE77(5,0,1,-5,,40,0,0,3,{side},{base},500,200,0,{vari},44)", 4.0)
    assert levels(moves) == found
    nearest = min(math.hypot(x, y) for x, y, z in points(moves) if z < 0.0)
    assert nearest == pytest.approx(24.0 + (side if vari == 1 else 0.0), abs=1e-6)


@settings(max_examples=examples(25), deadline=None)
@given(
    st.floats(10.0, 60.0),
    st.floats(10.0, 60.0),
    st.floats(0.0, 5.0),
    st.floats(1.0, 12.0),
    st.floats(0.0, 3.0),
    st.sampled_from("0123"),
    st.sampled_from(("M3", "M4")),
)
def test_the_tool_touches_the_wall_and_never_cuts_into_it(
    length: float, width: float, corner: float, radius: float, allowance: float, direction: str, spindle: str
) -> None:
    before = f"G17 G90 S1000 {spindle} T1 M6\nG0 Z20\n"
    shape = f"{length:.3f},{width:.3f},{corner:.3f},0,0,0,2,{allowance:.3f},0"
    moves = of_cycle(f"CYCLE76(5,0,1,-3,,{shape},500,200,{direction},1,{length + 4:.3f})", radius, before)
    half_u, half_v = round(length, 3) / 2.0 - corner, round(width, 3) / 2.0 - corner
    away = [
        math.hypot(max(abs(x) - half_u, 0.0), max(abs(y) - half_v, 0.0)) - corner - radius - round(allowance, 3)
        for x, y, z in points(moves)
        if z < 0.0
    ]
    assert min(away) == pytest.approx(0.0, abs=2e-3)
    lap = [point for point, far in zip([p for p in points(moves) if p[2] < 0.0], away, strict=True) if far < 2e-3]
    clockwise = {"0": spindle == "M3", "1": spindle == "M4", "2": True, "3": False}[direction]
    assert (area(lap) < 0.0) is clockwise


SPIGOT = "CYCLE77(10,0,3,-20,,50,60,70,10,0.5,0,900,800,1,{})"


@pytest.mark.parametrize(
    ("call", "word", "reason"),
    [
        (SPIGOT.format("5,55"), "CYCLE77 _VARI", "is 5; read are 1 roughing and 2 finishing"),
        (SPIGOT.format("1,40"), "CYCLE77 _AP1", "smaller than the spigot"),
        (SPIGOT.format("1,55,0,0,100"), "CYCLE77 _GMODE=100", "post this operation without the cycle"),
        (SPIGOT.format("1,55,0,0,0,1,11"), "CYCLE77 _AMODE=11", "post this operation without the cycle"),
        (SPIGOT.format("1,55,0,0,0,12"), "CYCLE77 _DMODE", "its last digit 2 is G18, and G17 is in force"),
        ("CYCLE76(10,0,2,-5,,60,0,15)", "CYCLE76 _WID", "is needed"),
        ("CYCLE76(10,0,2,-5,,60,40,25)", "CYCLE76 _CRAD", "rounder than the spigot is wide"),
        (
            "POCKET3(50,0,1,5,40,20,4,0,0,0,2,0,0,500,100,0,21,80,0,0,0,3,2,0,1,2,11100,11,111)",
            "POCKET3 _GMODE=11100",
            "post this operation without the cycle",
        ),
    ],
)
def test_what_is_not_read_is_named_with_its_value(call: str, word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        run(f"G17 G90 S1000 M3 T1 M6\nG0 Z20\n{call}", Settings(tool_offsets={1: ToolOffset(0.0, 2.0)}))
    assert (caught.value.line, caught.value.word) == (3, word)
    assert reason in caught.value.reason


def test_what_is_for_chamfering_alone_changes_nothing() -> None:
    assert of_cycle(SPIGOT.format("1,55,1,2,0,1"), 5.0) == of_cycle(SPIGOT.format("1,55"), 5.0)
