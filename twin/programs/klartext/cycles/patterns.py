"""Cycles 220 and 221, and PATTERN DEF: the places where a cycle runs, one after the other.

220: on a pitch circle; 221: in rows, to and fro. Between two places the tool moves at the set-up clearance (Q301 = 0) or at the
second one (Q301 = 1) (Cycle Programming TNC 640, "Point patterns").
"""

import math
import re
from collections.abc import Sequence
from typing import Final

from twin.programs.arcs import Point
from twin.programs.canonical import Arc
from twin.programs.klartext import compensation, motion
from twin.programs.klartext.block import Block, parse
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.cycles.running import run_cycle
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

PLACES_MAX: Final = 100_000
FORM: Final = re.compile(r"[ \t]*+(POS|ROW|PAT|FRAME|CIRC|PITCHCIRC)([0-9]++)[ \t]*+\(([^()]*+)\)")
WORDS: Final = frozenset({"X", "Y", "Z", "D", "NUM", "DX", "DY", "NUMX", "NUMY", "ROT", "ROTX", "ROTY", "START", "STEP"})


def need_cycle(state: State, text: str) -> Definition:
    if state.cycle is None or state.cycle.number == 12:
        raise RefusedError(text, "needs a machining cycle; CYCL DEF it before")
    return state.cycle


def polar_pattern(state: State, cycle: Definition) -> None:
    """220: Q241 places from Q245, Q247 apart; Q247 = 0: evenly up to Q246."""
    centre, radius = (cycle.length(216), cycle.length(217)), cycle.positive(244) / 2.0
    first, last, step = cycle.value(245), cycle.value(246), cycle.value(247)
    count = cycle.number_of(241, 1, PLACES_MAX)
    if step == 0.0:
        span = last - first
        gaps = count if math.isclose(abs(span), 360.0) else max(count - 1, 1)
        step = span / gaps
    angles = [math.radians(first + step * at) for at in range(count)]
    places = [(centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)) for angle in angles]
    arc = centre if cycle.number_of(365, 0, 1) == 1 else None
    sense = 1.0 if step > 0.0 else -1.0
    work(state, cycle, places, arc, sense)


def grid_pattern(state: State, cycle: Definition) -> None:
    """221: Q242 columns, Q243 rows, Q237 and Q238 apart, from Q225, Q226, turned by Q224 about that point."""
    begin = (cycle.length(225), cycle.length(226))
    step_a, step_b, turn = cycle.length(237), cycle.length(238), math.radians(cycle.value(224))
    columns, rows = cycle.number_of(242, 1, PLACES_MAX), cycle.number_of(243, 1, PLACES_MAX)
    if columns * rows > PLACES_MAX:
        raise cycle.refusal(243, f"makes more than {PLACES_MAX} places")
    work(state, cycle, grid(begin, step_a, step_b, columns, rows, turn), None, 1.0)


def grid(begin: Point, step_a: float, step_b: float, columns: int, rows: int, turn_rad: float) -> list[Point]:
    """The places of a grid, every other row backwards."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    found = []
    for row in range(rows):
        order = range(columns) if row % 2 == 0 else range(columns - 1, -1, -1)
        for column in order:
            a, b = column * step_a, row * step_b
            found.append((begin[0] + cosine * a - sine * b, begin[1] + sine * a + cosine * b))
    return found


def work(state: State, pattern: Definition, places: Sequence[Point], arc: Point | None, sense: float) -> None:
    """Run the cycle that was defined before at every place, with Q200, Q203 and Q204 of the pattern."""
    compensation.refuse(state, pattern.text)
    machining = need_cycle(state, pattern.text)
    changed = machining.with_values({number: pattern.value(number) for number in (200, 203, 204)})
    second = pattern.surface_mm() + max(pattern.length(204), pattern.length(200))
    clearance = pattern.surface_mm() + pattern.length(200)
    between = second if pattern.number_of(301, 0, 1) == 1 else clearance
    state.take_length()
    steps.to(state, max(second, steps.height(state)))
    inner = changed if between == second else changed.with_values({204: changed.value(200)})
    for at, place in enumerate(places):
        if at > 0 and arc is not None:
            along(state, arc, place, sense)
        steps.across(state, *place)
        run_cycle(state, changed if at == len(places) - 1 else inner)
        steps.to(state, second if at == len(places) - 1 else between)


def along(state: State, centre: Point, place: Point, sense: float) -> None:
    """Q365 = 1: to the next place on the pitch circle, with the feed in force."""
    if state.feed_mm_min <= 0.0:
        raise RefusedError("Q365", "the way along the circle needs a feed; write F before, or Q365=0")
    here = steps.in_plane(state)
    begin = math.atan2(here[1] - centre[1], here[0] - centre[0])
    turn = (math.atan2(place[1] - centre[1], place[0] - centre[0]) - begin) * sense % math.tau
    first, second, _ = PLANES[state.plane]
    middle = list(state.position[:3])
    machine = steps.placed_in_plane(state, *centre)
    middle[first], middle[second] = machine[first], machine[second]
    sweep = turn * sense * (-1.0 if state.frame.mirrors(state.plane) else 1.0)
    full = (middle[0], middle[1], middle[2])
    end = steps.placed_in_plane(state, *place)
    motion.add(state, Arc(state.line, end, full, state.plane, sweep, state.feed_mm_min, None, state.program))


def pattern_def(state: State, source: Source, begin: int) -> None:
    """PATTERN DEF POS1 (X+25 Y+33 Z+0) ROW1 (…) …: places in program coordinates, with the surface there."""
    at, places = begin, []
    while source.body[at:].strip():
        match = FORM.match(source.body, at)
        if match is None or match.group(1) == "FRAME":
            raise RefusedError(source.written[at:].strip()[:24], "is read as POS, ROW, PAT, CIRC or PITCHCIRC with words in ( )")
        inner = source._replace(body=source.body[: match.end(3)], written=source.written[: match.end(3)])
        block = parse(inner, match.start(3), WORDS)
        places.extend(places_of(state, match.group(1), block))
        if len(places) > PLACES_MAX:
            raise RefusedError("PATTERN DEF", f"makes more than {PLACES_MAX} places")
        at = match.end()
    state.pattern = tuple(places)


def places_of(state: State, form: str, block: Block) -> list[tuple[float, float, float]]:
    unit = state.unit_mm

    def number(name: str, otherwise: float | None = None) -> float:
        given = block.value(state.variables, name)
        if given is None and otherwise is None:
            raise RefusedError(form, f"needs {name}")
        return given if given is not None else otherwise or 0.0

    def many(name: str) -> int:
        given = number(name)
        if not given.is_integer() or not 1 <= given <= PLACES_MAX:
            raise RefusedError(block.texts[name], f"is a number from 1 to {PLACES_MAX}")
        return int(given)

    x, y, z = number("X") * unit, number("Y") * unit, number("Z", 0.0) * unit
    if form == "POS":
        return [(x, y, z)]
    if form in ("ROW", "PAT"):
        turn = math.radians(number("ROT", 0.0))
        if form == "PAT" and (number("ROTX", 0.0) or number("ROTY", 0.0)):
            raise RefusedError("ROTX", "distorts the pattern, which is not read; write 0")
        step_a = number("D" if form == "ROW" else "DX") * unit
        step_b = 0.0 if form == "ROW" else number("DY") * unit
        columns, rows = (many("NUM"), 1) if form == "ROW" else (many("NUMX"), many("NUMY"))
        return [(a, b, z) for a, b in grid((x, y), step_a, step_b, columns, rows, turn)]
    count, radius = many("NUM"), number("D") * unit / 2.0
    step = 360.0 / count if form == "CIRC" else number("STEP")
    angles = [math.radians(number("START", 0.0) + step * at) for at in range(count)]
    return [(x + radius * math.cos(angle), y + radius * math.sin(angle), z) for angle in angles]
