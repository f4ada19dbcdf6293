"""Pockets, slots, long holes, faces: their contour, depths and feeds are exact; the way inside is held to stay inside."""

import math
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.depth import examples
from tests.twin.programs.sinumerik.reading import cuts, run
from twin.programs import Arc, Linear, Move, Rapid, Settings, Spindle, ToolOffset

BEFORE = "G17 G90 S1000 M3 T1 M6\nG0 Z20\n"


def tools(radius: float) -> Settings:
    return Settings(tool_offsets={1: ToolOffset(0.0, radius)})


def of_cycle(cycle: str, radius: float, before: str = BEFORE) -> list[Move]:
    """The moves of a cycle that stands in the third line."""
    return [move for move in run(before + cycle, tools(radius)) if move.line == before.count("\n")]


def points(moves: list[Move], spacing: float = 0.2) -> list[tuple[float, float, float]]:
    """Points along all that cuts, arcs divided."""
    found: list[tuple[float, float, float]] = []
    position: tuple[float, ...] = (0.0, 0.0, 20.0)
    for move in moves:
        if isinstance(move, Linear):
            found.append((move.end_mm[0], move.end_mm[1], move.end_mm[2]))
        elif isinstance(move, Arc):
            radius = math.dist(position[:2], move.centre_mm[:2])
            first = math.atan2(position[1] - move.centre_mm[1], position[0] - move.centre_mm[0])
            parts = max(int(abs(move.sweep_rad) * radius / spacing), 1)
            for part in range(1, parts + 1):
                angle = first + move.sweep_rad * part / parts
                z = position[2] + (move.end_mm[2] - position[2]) * part / parts
                found.append((move.centre_mm[0] + radius * math.cos(angle), move.centre_mm[1] + radius * math.sin(angle), z))
        if isinstance(move, Rapid | Linear | Arc):
            position = move.end_mm
    return found


def levels(moves: list[Move]) -> list[float]:
    """The depths at which a cycle cuts in the plane, each once."""
    found: list[float] = []
    position: tuple[float, ...] = (0.0, 0.0, 20.0)
    for move in moves:
        if isinstance(move, Rapid | Linear | Arc):
            flat = (
                abs(move.end_mm[2] - position[2]) < 1e-9
                and math.dist(move.end_mm[:2], position[:2]) + isinstance(move, Arc) > 1e-9
            )
            if flat and not isinstance(move, Rapid) and round(move.end_mm[2], 6) not in found:
                found.append(round(move.end_mm[2], 6))
            position = move.end_mm
    return found


def test_a_rectangular_pocket_is_its_size_its_depths_and_its_feeds() -> None:
    # 60 × 40, corners 8, 17.5 deep in infeeds of at most 4: five of 3.46 down to the allowance of 0.2.
    moves = of_cycle("POCKET3(5,0,0.5,-17.5,60,40,8,60,40,0,4,0.75,0.2,1000,750,0,11,5)", 5.0)
    assert levels(moves) == pytest.approx([-3.46, -6.92, -10.38, -13.84, -17.3])
    along = points(moves)
    reach = (max(abs(x - 60.0) for x, _, _ in along), max(abs(y - 40.0) for _, y, _ in along))
    assert reach == pytest.approx((30.0 - 5.0 - 0.75, 20.0 - 5.0 - 0.75))
    corners = {round(math.dist(move.centre_mm[:2], move.end_mm[:2]), 6) for move in moves if isinstance(move, Arc)}
    assert max(corners) == pytest.approx(8.0 - 5.0 - 0.75)
    down = {move.feed_mm_min for move in moves if isinstance(move, Linear | Arc)}
    assert down == {1000.0, 750.0}
    assert all(move.sweep_rad > 0.0 for move in moves if isinstance(move, Arc)), (
        "climb milling inside is counter-clockwise with M3"
    )
    assert cuts(moves)[0] == ("R", (0.0, 0.0, 5.0))
    assert cuts(moves)[-1] == ("R", (60.0, 40.0, 5.0))


def test_finishing_cuts_the_wall_itself_and_then_the_base() -> None:
    moves = of_cycle("POCKET3(5,0,0.5,-17.5,60,40,8,60,40,0,10,0.75,0.2,1000,750,0,12,5)", 5.0)
    assert levels(moves) == pytest.approx([-8.65, -17.3, -17.5])
    along = points(moves)
    assert max(x for x, _, _ in along) == pytest.approx(85.0)
    walls = [
        move for move in moves if isinstance(move, Arc) and math.isclose(math.dist(move.centre_mm[:2], move.end_mm[:2]), 3.0)
    ]
    assert len(walls) == 3 * 4  # The four corners of the wall: at two infeeds, and round the base.


@pytest.mark.parametrize(("direction", "left"), [(0, True), (1, False), (2, False), (3, True)])
def test_the_direction_is_climb_up_cut_g2_or_g3(direction: int, left: bool) -> None:
    for spindle, climbs in (("M3", left), ("M4", left != (direction < 2))):
        before = BEFORE.replace("M3", spindle)
        moves = of_cycle(f"POCKET4(5,0,1,-5,20,0,0,0,0,0,500,200,{direction},11)", 5.0, before)
        turns = {move.sweep_rad > 0.0 for move in moves if isinstance(move, Arc)}
        assert turns == {climbs if spindle == "M4" else left}


def test_a_round_pocket_goes_in_on_a_helix_and_out_to_its_radius() -> None:
    moves = of_cycle("POCKET4(3,0,0.5,-20,25,60,40,6,0.75,0.2,1000,800,0,21,10,0,0,2,0.5)", 5.0)
    assert levels(moves) == pytest.approx([-4.95, -9.9, -14.85, -19.8])
    radii = [math.hypot(x - 60.0, y - 40.0) for x, y, _ in points(moves)]
    assert max(radii) == pytest.approx(25.0 - 5.0 - 0.75)
    helix = [
        move for move in moves if isinstance(move, Arc) and math.isclose(math.dist(move.centre_mm[:2], move.end_mm[:2]), 2.0)
    ]
    assert len(helix) == 4 * (10 + 1)  # 4.95 mm at 0.5 mm a turn: ten turns, and the full circle at the depth.
    assert {move.feed_mm_min for move in helix} == {800.0}


def test_the_way_in_may_go_to_and_fro() -> None:
    moves = of_cycle("POCKET3(5,0,1,-6,60,30,5,0,0,0,3,0,0,1000,300,0,31,8,0,0,0,10)", 5.0)
    slopes = [
        abs(after.end_mm[2] - before.end_mm[2]) / math.dist(after.end_mm[:2], before.end_mm[:2])
        for before, after in pairwise([move for move in moves if isinstance(move, Rapid | Linear)])
        if after.end_mm[2] != before.end_mm[2] and math.dist(after.end_mm[:2], before.end_mm[:2]) > 1e-9
    ]
    assert slopes and max(slopes) <= math.tan(math.radians(10.0)) + 1e-9


@settings(max_examples=examples(60, 25), deadline=None)
@given(
    length=st.floats(20.0, 80.0),
    width=st.floats(20.0, 80.0),
    corner=st.floats(5.0, 10.0),
    step=st.floats(0.5, 9.5),
    angle=st.floats(-180.0, 180.0),
    allowance=st.floats(0.0, 1.0),
)
@example(length=80.0, width=80.0, corner=5.0, step=9.5, angle=0.0, allowance=0.0)  # 8.75 apart they leave islands.
def test_roughing_stays_inside_the_wall_and_leaves_nothing_standing(
    length: float, width: float, corner: float, step: float, angle: float, allowance: float
) -> None:
    """Every place of the tool keeps the allowance off the wall; every place of the floor is under it at some time."""
    radius = 5.0
    cycle = (
        f"POCKET3(5,0,1,-2,{length:.3f},{width:.3f},{corner:.3f},0,0,{angle:.3f},0,{allowance:.3f},0,1000,300,0,11,{step:.3f})"
    )
    moves = of_cycle(cycle, radius)
    turned = math.radians(round(angle, 3))
    half_u, half_v = round(length, 3) / 2 - radius - allowance, round(width, 3) / 2 - radius - allowance
    places: list[tuple[float, float]] = []
    for x, y, _ in points(moves):
        u, v = x * math.cos(turned) + y * math.sin(turned), -x * math.sin(turned) + y * math.cos(turned)
        assert abs(u) <= half_u + 2e-3 and abs(v) <= half_v + 2e-3
        places.append((u, v))
    ways = list(pairwise(places))
    for across in range(-4, 5):
        for up in range(-4, 5):
            u, v = half_u * across / 4.5, half_v * up / 4.5
            assert min(off(way, (u, v)) for way in ways) <= radius + 1e-6
    room = min(half_u, half_v)
    for inset in (*(room * share / 20 for share in range(21)), min(radius + 0.1, room)):
        # Along the diagonals, where the corners of the rings lie; just out of reach of the wall's ring they are furthest off.
        assert min(off(way, (half_u - inset, half_v - inset)) for way in ways) <= radius + 1e-6


def off(way: tuple[tuple[float, float], tuple[float, float]], point: tuple[float, float]) -> float:
    """Distance of a point from a straight way."""
    (u0, v0), (u1, v1) = way
    square = (u1 - u0) ** 2 + (v1 - v0) ** 2
    share = 0.0 if square == 0.0 else min(max(((point[0] - u0) * (u1 - u0) + (point[1] - v0) * (v1 - v0)) / square, 0.0), 1.0)
    return math.dist(point, (u0 + share * (u1 - u0), v0 + share * (v1 - v0)))


def test_a_long_hole_is_cut_to_and_fro_with_an_infeed_at_each_end() -> None:
    moves = cuts(of_cycle("LONGHOLE(5,0,1,,9,1,30,0,0,20,0,0,100,320,3)", 4.0))
    assert moves == [
        ("R", (0.0, 0.0, 5.0)),
        ("R", (24.0, 0.0, 5.0)),  # The near end of the hole is at 20, the tool 4 mm further.
        ("R", (24.0, 0.0, 1.0)),
        ("L", (24.0, 0.0, -3.0)),
        ("L", (46.0, 0.0, -3.0)),
        ("L", (46.0, 0.0, -6.0)),
        ("L", (24.0, 0.0, -6.0)),
        ("L", (24.0, 0.0, -9.0)),
        ("L", (46.0, 0.0, -9.0)),
        ("R", (46.0, 0.0, 5.0)),
    ]


def test_long_holes_lie_along_the_radii_of_their_circle() -> None:
    moves = of_cycle("LONGHOLE(5,0,1,,4,4,30,40,45,20,45,90,100,320,0)", 4.0)
    ends = {(round(x, 6), round(y, 6)) for x, y, _ in points(moves)}
    expected = {
        (round(40 + reach * math.cos(angle), 6), round(45 + reach * math.sin(angle), 6))
        for angle in (math.radians(45 + 90 * hole) for hole in range(4))
        for reach in (24.0, 46.0)
    }
    assert ends == expected


def test_a_slot_is_as_wide_as_it_is_said_and_its_wall_is_finished_with_its_own_speed() -> None:
    moves = of_cycle("SLOT1(5,0,1,-6,,1,40,15,0,0,10,0,0,100,320,3,2,0.5,0,6,250,2000)", 5.0)
    along = points(moves)
    assert max(y for _, y, _ in along) == pytest.approx(2.5)
    assert (min(x for x, _, _ in along), max(x for x, _, _ in along)) == pytest.approx((10.0 + 5.0, 50.0 - 5.0), abs=5e-3)
    assert [move.rpm for move in moves if isinstance(move, Spindle)] == [2000.0, 1000.0]
    finished = [move for move in moves if isinstance(move, Linear | Arc) and move.feed_mm_min == 250.0]
    assert {round(move.end_mm[2], 6) for move in finished} == {-6.0}
    roughed = [
        abs(y) for x, y, _ in points([move for move in moves if not (isinstance(move, Linear | Arc) and move in finished)])
    ]
    assert max(roughed) == pytest.approx(2.0)


def test_a_slot_on_a_circle_keeps_to_its_circle() -> None:
    moves = of_cycle("SLOT2(2,0,2,-6,,1,70,15,60,60,42,0,120,100,300,6,2,0.5,0,,0,0)", 5.0)
    radii = [math.hypot(x - 60.0, y - 60.0) for x, y, _ in points(moves) if math.hypot(x - 60.0, y - 60.0) > 1.0]
    assert (min(radii), max(radii)) == pytest.approx((42.0 - 2.5, 42.0 + 2.5), abs=1e-6)
    assert all(not isinstance(move, Arc) or move.sweep_rad for move in moves)


@pytest.mark.parametrize(
    ("way", "expected"),
    [
        # 40 × 30 with a tool of 20 mm in cuts of at most 16: two of 15, over 12 mm beside the face.
        (31, [(-12.0, 5.0), (52.0, 5.0), (52.0, 20.0), (-12.0, 20.0)]),
        (11, [(-12.0, 5.0), (52.0, 5.0), (-12.0, 20.0), (52.0, 20.0)]),
        (41, [(3.333333, -12.0), (3.333333, 42.0), (16.666667, 42.0), (16.666667, -12.0), (30.0, -12.0), (30.0, 42.0)]),
    ],
)
def test_a_face_is_cut_in_equal_lines(way: int, expected: list[tuple[float, float]]) -> None:
    moves = of_cycle(f"CYCLE71(10,0,2,-4,0,0,40,30,0,4,16,0,0,500,{way},0)", 10.0)
    level = [place[:2] for letter, place in cuts(moves) if place[2] == -4.0]
    assert [place for place, before in zip(level, [None, *level], strict=False) if place != before] == expected


def test_a_face_is_passed_along_by_fdp_and_across_by_fdp1() -> None:
    moves = of_cycle("CYCLE71(10,0,2,-4,0,0,40,30,0,4,16,15,0,500,31,2)", 10.0)
    level = [place[:2] for letter, place in cuts(moves) if place[2] == -4.0 and letter == "L"]
    assert level == [(55.0, 6.0), (55.0, 22.0), (-15.0, 22.0)]  # The last middle is 30 + 2 - 10 across.


def test_a_face_goes_down_in_equal_infeeds_to_its_allowance() -> None:
    assert levels(of_cycle("CYCLE71(10,0,2,-11,0,0,40,30,0,6,16,0,1,500,31,0)", 10.0)) == [-5.0, -10.0]
