"""Bore milling, pockets and slots: what of them is exact, that is contour, levels, feeds and what is left."""

import math

import pytest

from tests.twin.programs.klartext.short import TOOL_5, all_of, moves_of, program
from twin.errors import PartProgramError
from twin.programs import Arc, Linear, Move, Rapid
from twin.programs.klartext.interpreter import interpret

BEFORE = ["TOOL CALL 1 Z S3000", "L X+10 Y+20 Z+50 R0 FMAX M3"]
POCKET = {
    **{215: "0", 368: "0.5", 369: "0.2", 207: "500", 351: "+1", 201: "-10", 202: "4", 206: "150", 338: "0", 200: "2", 203: "+0"},
    **{204: "50", 370: "1", 366: "1", 385: "300"},
}
SHAPES = {
    251: {218: "60", 219: "40", 220: "8", 224: "0", 367: "0"},
    252: {223: "50"},
    253: {218: "60", 219: "16", 374: "30", 367: "0"},
    254: {219: "16", 375: "80", 367: "0", 216: "+10", 217: "+20", 376: "+0", 248: "90"},
}


def cycle(number: int, **changed: str) -> list[str]:
    values = {**POCKET, **SHAPES.get(number, {}), **{int(name[1:]): value for name, value in changed.items()}}
    return [f"CYCL DEF {number} NAME ~", *(f"    Q{one}={value} ;TEXT ~" for one, value in values.items()), "", "CYCL CALL"]


def made(*blocks: str) -> list[Move]:
    return interpret(program(*BEFORE, *blocks), TOOL_5)


def points(moves: list[Move], level: float) -> list[tuple[float, float, float]]:
    """Places of the tool's centre along the cuts at a level, with the feed."""
    place, found = (0.0, 0.0, 0.0), []
    for move in moves:
        if not isinstance(move, Rapid | Linear | Arc):
            continue
        start, (x, y, z) = place, move.end_mm
        place = (x, y, z)
        if isinstance(move, Rapid) or not start[2] == pytest.approx(level) == z:
            continue
        for share in (k / 16 for k in range(17)):
            if isinstance(move, Arc):
                angle = math.atan2(start[1] - move.centre_mm[1], start[0] - move.centre_mm[0]) + share * move.sweep_rad
                radius = math.dist(start[:2], move.centre_mm[:2])
                at = (move.centre_mm[0] + radius * math.cos(angle), move.centre_mm[1] + radius * math.sin(angle))
            else:
                at = (start[0] + share * (x - start[0]), start[1] + share * (y - start[1]))
            found.append((*at, move.feed_mm_min))
    return found


def wall(number: int, x: float, y: float) -> float:
    """The distance from the wall of the pocket, + inside."""
    x, y = x - 10.0, y - 20.0
    if number == 251:
        a, b = abs(x) - (30.0 - 8.0), abs(y) - (20.0 - 8.0)
        return 8.0 - (math.hypot(max(a, 0.0), max(b, 0.0)) + min(max(a, b), 0.0))
    if number == 252:
        return 25.0 - math.hypot(x, y)
    if number == 253:
        turn = math.radians(30.0)
        along, across = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x
        return 8.0 - math.hypot(max(abs(along) - 22.0, 0.0), across)
    angle = min(max(math.atan2(y, x), 0.0), math.pi / 2.0)
    if 0.0 <= math.atan2(y, x) <= math.pi / 2.0:
        return 8.0 - abs(math.hypot(x, y) - 40.0)
    return 8.0 - math.dist((x, y), (40.0 * math.cos(angle), 40.0 * math.sin(angle)))


@pytest.mark.parametrize("number", SHAPES)
def test_roughing_leaves_the_allowances_and_finishing_the_size(number: int) -> None:
    moves = made(*cycle(number))
    assert {round(move.end_mm[2], 6) for move in moves if isinstance(move, Linear | Arc)} >= {-4.0, -8.0, -9.8, -10.0}
    assert min(move.end_mm[2] for move in moves if isinstance(move, Rapid | Linear | Arc)) == pytest.approx(-10.0)
    for level in (-4.0, -8.0, -9.8):
        rough = [(x, y) for x, y, feed in points(moves, level) if feed == 500.0]
        assert min(wall(number, x, y) for x, y in rough) == pytest.approx(5.5, abs=1e-6)
    finish = [(x, y) for x, y, feed in points(moves, -10.0) if feed == 300.0]
    assert min(wall(number, x, y) for x, y in finish) == pytest.approx(5.0, abs=1e-6)
    assert all_of(moves)[-2] == "rapid 10 20 50"


@pytest.mark.parametrize("number", SHAPES)
@pytest.mark.parametrize(("way", "sign"), [("+1", 1.0), ("-1", -1.0)])
def test_climb_milling_goes_counter_clockwise_inside(number: int, way: str, sign: float) -> None:
    moves = made(*cycle(number, Q351=way, Q215="1", Q366="0", Q202="10"))
    path = [(x, y) for x, y, _ in points(moves, -9.8)]
    ring = [at for at in path if wall(number, *at) == pytest.approx(5.5, abs=1e-6)]
    area = sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)) / 2.0
    assert area * sign > 100.0


@pytest.mark.parametrize("number", SHAPES)
def test_the_contours_leave_nothing_between_them(number: int) -> None:
    """Every place of the floor that is further than the allowance from the wall is reached by the tool."""
    moves = made(*cycle(number, Q215="1", Q202="10", Q369="0", Q370="1.4"))
    path = [(x, y) for x, y, _ in points(moves, -10.0)]
    for a in range(-36, 56, 4):
        for b in range(-8, 68, 4):
            if wall(number, a + 0.3, b + 0.7) > 0.5 + 5.0:
                assert min(math.dist((a + 0.3, b + 0.7), at) for at in path) < 5.0


@pytest.mark.parametrize(("place", "centre"), [("1", (40, 40)), ("2", (-20, 40)), ("3", (-20, 0)), ("4", (40, 0))])
def test_the_tool_may_stand_at_a_corner_of_the_pocket(place: str, centre: tuple[float, float]) -> None:
    path = points(made(*cycle(251, Q367=place, Q215="1", Q202="10", Q369="0")), -10.0)
    assert (max(x for x, _, _ in path) + min(x for x, _, _ in path)) / 2.0 == pytest.approx(centre[0])
    assert (max(y for _, y, _ in path) + min(y for _, y, _ in path)) / 2.0 == pytest.approx(centre[1])


def test_a_slot_as_wide_as_the_tool_is_cut_along_its_middle() -> None:
    found = all_of(made(*cycle(253, Q219="10", Q374="0", Q368="0", Q369="0", Q366="0", Q202="10", Q215="1")))[3:-1]
    assert found == [
        "rapid 10 20 2",
        "rapid -15 20 2",
        "line -15 20 -10 F150",
        "line 35 20 -10 F500",
        "line -15 20 -10 F500",
        "line 35 20 -10 F500",
        "rapid 35 20 -8",
        "rapid -15 20 -8",
        "rapid -15 20 2",
        "rapid -15 20 50",
        "rapid 10 20 50",
    ]


def test_bore_milling_is_one_helix_and_a_full_circle() -> None:
    blocks = ["CYCL DEF 208 BORE MILLING Q200=2 Q201=-10 Q206=150 Q334=2 Q203=+0 Q204=50 Q335=24 Q342=0 Q351=+1", "CYCL CALL"]
    assert moves_of(*BEFORE, *blocks, settings=TOOL_5)[3:] == [
        "rapid 10 20 2",
        "arc 17 20 2 about 13.5 20 sweep 180 F150",
        "arc 17 20 -10 about 10 20 sweep 2160 F150",
        "arc 17 20 -10 about 10 20 sweep 360 F150",
        "arc 10 20 -10 about 13.5 20 sweep 180 F150",
        "rapid 10 20 2",
        "rapid 10 20 50",
    ]


def test_a_pocket_is_turned_and_mirrored_with_its_coordinates() -> None:
    frame = ["CYCL DEF 8.0 MIRROR IMAGE", "CYCL DEF 8.1 X", "L X+10 Y+20 FMAX"]
    plain, turned = made(*cycle(251, Q224="20")), made(*frame, *cycle(251, Q224="20"))
    there = [(-x, y) for x, y, _ in points(plain, -10.0)]
    assert len(there) > 100
    for at, (x, y, _) in zip(there, points(turned, -10.0), strict=True):
        assert math.dist(at, (x, y)) < 1e-6


REFUSED = {
    "a tool that is too thick": (cycle(252, Q223="9"), "CYCL DEF 252", "does not fit"),
    "a slot shorter than wide": (cycle(253, Q218="10"), "Q218", "shorter"),
    "an overlap of nothing": (cycle(251, Q370="0"), "Q370", "overlap"),
    "a bore narrower than the tool": (
        ["CYCL DEF 208 B Q200=2 Q201=-10 Q206=150 Q334=2 Q203=+0 Q204=50 Q335=8", "CYCL CALL"],
        "Q335",
        "narrower",
    ),
}


@pytest.mark.parametrize(("blocks", "word", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_a_pocket_that_cannot_be_made_is_refused(blocks: list[str], word: str, reason: str) -> None:
    with pytest.raises(PartProgramError) as caught:
        made(*blocks)
    assert caught.value.word == word
    assert reason in caught.value.reason
