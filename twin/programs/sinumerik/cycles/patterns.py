"""HOLES1, HOLES2, CYCLE801, CYCLE802: positions at which the cycle of MCALL is called.

A row begins at the end that is nearer to the tool; a grid at its nearest corner, then to and fro: the ways between are short.
"""

import math
from collections.abc import Callable
from typing import Final

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import motion
from twin.programs.sinumerik.cycles.arguments import Arguments
from twin.programs.sinumerik.state import State

Point = tuple[float, float]
Hole = Callable[[], None]
POSITIONS_MAX: Final = 10_000
POSITIONS_OF_ONE: Final = 9
"""Positions that one CYCLE802 has places for."""


def visit(state: State, places: list[Point], hole: Hole) -> None:
    """Go to each place of the plane in rapid, and do there what MCALL says."""
    first, second = (state.normal + 1) % 3, (state.normal + 2) % 3
    for place in places:
        program = list(state.frames.to_program(state.position))
        program[first], program[second] = place
        motion.rapid(state, state.checked(state.frames.to_machine(tuple(program))))
        hole()


def here(state: State) -> Point:
    program = state.frames.to_program(state.position)
    return program[(state.normal + 1) % 3], program[(state.normal + 2) % 3]


def many(given: Arguments, name: str) -> int:
    return given.whole(name, 1, POSITIONS_MAX)


def row(state: State, given: Arguments, hole: Hole) -> None:
    """HOLES1: NUM holes at DBH along STA1, the first FDIS from (SPCA, SPCO)."""
    given.only_zero("_HIDE")
    angle = math.radians(given.number("STA1"))
    reach = [given.length("FDIS") + given.length("DBH") * place for place in range(many(given, "NUM"))]
    places = [(given.length("SPCA") + one * math.cos(angle), given.length("SPCO") + one * math.sin(angle)) for one in reach]
    if math.dist(here(state), places[-1]) < math.dist(here(state), places[0]):
        places.reverse()
    visit(state, places, hole)


def circle(state: State, given: Arguments, hole: Hole) -> None:
    """HOLES2: NUM holes on a circle about (CPA, CPO), the first at STA1, INDA apart; INDA = 0 shares the whole circle out."""
    given.only_zero("_HIDE")
    count = many(given, "NUM")
    step = given.number("INDA") or 360.0 / count
    radius = given.needed("RAD")
    angles = [math.radians(given.number("STA1") + step * place) for place in range(count)]
    places = [(given.length("CPA") + radius * math.cos(one), given.length("CPO") + radius * math.sin(one)) for one in angles]
    visit(state, places, hole)


def grid(state: State, given: Arguments, hole: Hole) -> None:
    """CYCLE801: _NUM1 columns at _DIS1 and _NUM2 rows at _DIS2 from (_SPCA, _SPCO), turned by _STA."""
    given.only_zero("_VARI", "_HIDE", reason="only the full grid (0) is read")
    columns, rows = many(given, "_NUM1"), many(given, "_NUM2")
    if columns * rows > POSITIONS_MAX:
        raise RefusedError("CYCLE801", f"makes more than {POSITIONS_MAX} positions")
    sine, cosine = math.sin(math.radians(given.number("_STA"))), math.cos(math.radians(given.number("_STA")))

    def place(column: int, line: int) -> Point:
        across, up = given.length("_DIS1") * column, given.length("_DIS2") * line
        return given.length("_SPCA") + across * cosine - up * sine, given.length("_SPCO") + across * sine + up * cosine

    now = here(state)
    corners = [(column, line) for line in (0, rows - 1) for column in (0, columns - 1)]
    column, line = min(corners, key=lambda corner: math.dist(now, place(*corner)))
    along = list(range(columns)) if column == 0 else list(range(columns - 1, -1, -1))
    places: list[Point] = []
    for one in range(rows) if line == 0 else range(rows - 1, -1, -1):
        places += [place(at, one) for at in along]
        along.reverse()
    visit(state, places, hole)


def anywhere(state: State, given: Arguments, hole: Hole) -> None:
    """CYCLE802: up to nine positions; _XA and _YA have a digit for each, 1 absolute, 2 incremental, all of them the same here."""
    places: list[Point] = []
    last = here(state)
    digits = {digit for name in ("_XA", "_YA") for digit in str(given.whole(name, 0, 222_222_222)) if digit != "0"}
    if len(digits) != 1 or digits - {"1", "2"}:
        raise RefusedError("CYCLE802 _XA", "is read with all positions absolute (1) or all incremental (2)")
    for place in range(POSITIONS_OF_ONE):
        if not (given.has(f"_X{place}") or given.has(f"_Y{place}")):
            continue
        figures = (given.length(f"_X{place}"), given.length(f"_Y{place}"))
        last = figures if digits == {"1"} else (figures[0] + last[0], figures[1] + last[1])
        places.append(last)
    if not places:
        raise RefusedError("CYCLE802 _X0", "has no position")
    visit(state, places, hole)
