"""HEIDENHAIN's own example programs, transcribed, with what their drawings and texts say of the tool's path.

TOOL DEF gives the tool that the manual's tool list gives. Sources:
`linear`, `circular`, `ccc`: User's Manual TNC 426/430 (280 476), chapter 6.4 "Path contours - Cartesian coordinates"; `circular`
unchanged in Klartext Programming TNC 640 34059x-18, page 172. `linearpo`, `helix`: 6.5 "Path contours - polar coordinates";
`helix` as in TNC 640 34059x-18, page 180. `ellipse`: "Programming examples: Ellipse" (TNC 620 34056x-04, section 8.12).
`c200`: "Example: drilling cycles"; `bolt_holes`: "Example: circular hole patterns"; `transformations`: "Example: coordinate
transformation cycles" (Cycle Programming iTNC 530 and TNC 640).
"""

import math
from itertools import pairwise
from pathlib import Path

import pytest

from tests.twin.programs.klartext.short import all_of
from twin.programs import Arc, Linear, Move, Rapid
from twin.programs.klartext.interpreter import interpret

HERE = Path(__file__).parent / "published"
NAMES = sorted(path.stem for path in HERE.glob("*.h"))
SAME = 1e-6


def moves_of(name: str) -> list[Move]:
    return interpret((HERE / f"{name}.h").read_text(encoding="utf-8"))


def of_line(moves: list[Move], *lines: int) -> list[str]:
    return all_of([move for move in moves if move.line in lines])


@pytest.mark.parametrize("name", NAMES)
def test_every_example_is_read_to_its_end(name: str) -> None:
    assert all_of(moves_of(name))[-1] == "end"


def test_linear_goes_round_the_square_beside_it() -> None:
    moves = moves_of("linear")
    assert of_line(moves, 8) == ["line -5 -5 -5 F1000", "line -5 5 -5 F300"]
    assert of_line(moves, 9) == ["line -5 95 -5 F300", "arc 5 105 -5 about 5 95 sweep -90 F300"]
    assert of_line(moves, 11, 13) == [
        "line 102.071 92.0711 -5 F300", "arc 105 85 -5 about 95 85 sweep -45 F300",
        "line 82.0711 -2.0711 -5 F300", "arc 75 -5 -5 about 75 5 sweep -45 F300",
    ]  # fmt: skip
    assert of_line(moves, 14, 15) == ["line 5 -5 -5 F300", "line -5 -5 -5 F1000"]
    assert of_line(moves, 16)[0] == "rapid -5 -5 250"


def test_circular_rounds_and_curves_as_drawn() -> None:
    moves = moves_of("circular")
    # From (-10, -10) the line touches the circle about (-10, 5) of radius 5 at asin(1/3) below +X.
    assert of_line(moves, 8) == ["line -5.286 3.3333 -5 F300", "arc -5 5 -5 about -10 5 sweep 19.4712 F300"]
    # RND R10 on the outside: the tool's centre runs on 10 + 10; its feed is its own.
    assert of_line(moves, 10) == ["arc 15 95 -5 about 15 75 sweep -90 F150"]
    (arc,) = [move for move in moves if move.line == 12 and isinstance(move, Arc)]
    start = next(move for move in moves if move.line == 11 and isinstance(move, Linear)).end_mm
    assert math.dist(start[:2], arc.centre_mm[:2]) == pytest.approx(30.0 + 10.0)
    (tangential,) = [move for move in moves if move.line == 15]
    assert isinstance(tangential, Arc)
    # CT leaves (95, 40) along -Y: its centre is at the height of its start.
    assert tangential.centre_mm[1] == pytest.approx(40.0)
    assert math.dist(tangential.centre_mm[:2], (40.0, 5.0)) == pytest.approx(95.0 - tangential.centre_mm[0])
    assert of_line(moves, 17)[-1] == "line -20 -20 -5 F1000"


def test_a_full_circle_is_made_on_the_outside() -> None:
    moves = moves_of("ccc")
    assert of_line(moves, 10) == ["arc -12.5 50 -5 about 50 50 sweep -360 F300"]
    way = [move for move in moves if move.line in (9, 11)]
    assert [type(move).__name__ for move in way] == ["Linear", "Arc", "Arc", "Linear"]
    assert of_line(moves, 11)[-1] == "line -40 50 -5 F1000"


def test_the_hexagon_is_left_its_flats() -> None:
    """The tool's centre runs 7.5 mm outside flats that are 45 cos 30° from the middle."""
    moves = moves_of("linearpo")
    flats, position = [], (0.0, 0.0)
    for move in moves:
        if not isinstance(move, Rapid | Linear | Arc):
            continue
        start, position = position, move.end_mm[:2]
        if isinstance(move, Linear) and 10 <= move.line <= 15:
            a, b = (start[0] - 50.0, start[1] - 50.0), (position[0] - 50.0, position[1] - 50.0)
            flats.append(abs(a[0] * b[1] - a[1] * b[0]) / math.dist(a, b))
    assert flats == pytest.approx([45.0 * math.cos(math.pi / 6.0) + 7.5] * 6)


def test_the_helix_makes_nine_turns_inside() -> None:
    moves = moves_of("helix")
    (helix,) = [move for move in moves if move.line == 10]
    assert isinstance(helix, Arc)
    assert helix.sweep_rad == pytest.approx(9.0 * math.tau)
    assert helix.end_mm[2] == pytest.approx(0.75)
    assert math.dist(helix.end_mm[:2], (50.0, 50.0)) == pytest.approx(32.0 - 5.0)
    (on,) = [move for move in moves if move.line == 9 and isinstance(move, Arc)]
    assert (on.feed_mm_min, on.sweep_rad) == (100.0, pytest.approx(math.pi))
    assert math.dist(on.end_mm[:2], on.centre_mm[:2]) == pytest.approx(2.0)


def test_the_ellipse_lies_on_its_curve() -> None:
    moves = moves_of("ellipse")
    cuts = [move for move in moves if isinstance(move, Linear) and move.feed_mm_min == 350.0]
    assert len(cuts) == 40
    turn = math.radians(30.0)
    for cut in cuts:
        x, y = cut.end_mm[0] - 50.0, cut.end_mm[1] - 50.0
        along, across = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x
        assert (along / 50.0) ** 2 + (across / 30.0) ** 2 == pytest.approx(1.0)
        assert cut.end_mm[2] == -5.0


def test_four_holes_are_pecked_from_a_surface_below_the_datum() -> None:
    moves = moves_of("c200")
    assert of_line(moves, 14) == ["spindle 4500", "rapid 10 10 250"]
    first = [
        "rapid 10 10 -8", "line 10 10 -15 F250", "rapid 10 10 -8", "rapid 10 10 -13", "line 10 10 -20 F250",
        "rapid 10 10 -8", "rapid 10 10 -18", "line 10 10 -25 F250", "dwell 0.2", "rapid 10 10 -8", "rapid 10 10 10",
    ]  # fmt: skip
    assert of_line(moves, 15) == first
    assert [move for move in of_line(moves, 16, 17, 18) if move.startswith("rapid") and move.endswith(" 10")][::2] == [
        "rapid 10 90 10", "rapid 90 90 10", "rapid 90 10 10",
    ]  # fmt: skip


def test_the_bolt_holes_lie_on_their_circles() -> None:
    moves = moves_of("bolt_holes")
    holes = [move.end_mm for move in moves if isinstance(move, Linear) and move.end_mm[2] == -15.0]
    assert len(holes) == 10 + 5
    assert [math.dist(hole[:2], (30.0, 70.0)) for hole in holes[:10]] == pytest.approx([25.0] * 10)
    angles = [math.degrees(math.atan2(hole[1] - 25.0, hole[0] - 90.0)) % 360.0 for hole in holes[10:]]
    assert angles == pytest.approx([90.0, 120.0, 150.0, 180.0, 210.0])
    # 15 mm in plunges of 4: 4, 8, 12, 15.
    first = [move.end_mm[2] for move in moves if isinstance(move, Linear)][:4]
    assert first == [-4.0, -8.0, -12.0, -15.0]


def test_the_contour_is_turned_seven_times_about_the_shifted_datum() -> None:
    moves = moves_of("transformations")
    plunges = [move for move in moves if move.line == 24]
    assert len(plunges) == 8
    leaves = [move.end_mm[:2] for move in moves if move.line == 25 and isinstance(move, Linear)]
    angles = [math.degrees(math.atan2(y - 65.0, x - 65.0)) for x, y in leaves]
    steps = [(b - a) % 360.0 for a, b in pairwise(angles)]
    assert steps == pytest.approx([45.0] * 7)


def figures(moves: list[Move]) -> list[float]:
    """Number of motions, what is cut, its time at the programmed feeds, and what is rapid."""
    place, count, cut_mm, minutes, rapid_mm = (0.0, 0.0, 0.0), 0, 0.0, 0.0, 0.0
    for move in moves:
        if not isinstance(move, Rapid | Linear | Arc):
            continue
        x, y, z = move.end_mm
        length = math.dist(place, (x, y, z))
        if isinstance(move, Arc):
            length = math.hypot(math.dist(place[:2], move.centre_mm[:2]) * move.sweep_rad, z - place[2])
        if isinstance(move, Rapid):
            rapid_mm += length
        else:
            cut_mm += length
            minutes += length / move.feed_mm_min
        place, count = (x, y, z), count + 1
    return [count, cut_mm, minutes, rapid_mm]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("linear", (18, 671.6, 1.604, 519.1)),
        ("circular", (17, 685.1, 1.725, 519.1)),
        ("ccc", (9, 709.5, 1.698, 569.0)),
        ("linearpo", (19, 583.4, 1.540, 556.0)),
        ("helix", (8, 1825.2, 8.014, 570.0)),
        ("ellipse", (46, 262.0, 0.799, 872.7)),
        ("c200", (46, 84.0, 0.336, 1332.1)),
        ("bolt_holes", (212, 345.0, 1.380, 4895.6)),
        ("transformations", (138, 1242.2, 5.097, 1145.9)),
    ],
)
def test_an_example_has_its_figures(name: str, expected: tuple[float, ...]) -> None:
    for given, found, places in zip(expected, figures(moves_of(name)), (0, 1, 3, 1), strict=True):
        assert given == pytest.approx(found, abs=0.51 * 10**-places)
