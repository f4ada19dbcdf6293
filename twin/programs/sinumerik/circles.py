"""G2, G3, CIP, CT: every way in which an arc is given ("Fundamentals", chapter "Circular interpolation").

Centre: I, J, K from the start, or I=AC() from the zero. CR=: radius, negative for more than half a circle. AR=: opening angle,
with the end or with the centre. AP= and RP=: end in polar coordinates, the pole is the centre. TURN=: whole turns more. CIP: over
an intermediate point I1=, J1=, K1=. CT: tangential to the motion before.
"""

import math
from collections.abc import Callable
from typing import Final

from twin.programs.arcs import Point, Sweep, arc_length, by_centre, by_radius, sweep_about
from twin.programs.canonical import Arc, Position
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

CENTRE_LETTERS: Final = "IJK"
TURNS_MAX: Final = 999
SAME_MM: Final = 1e-6


def arc(state: State, words: Words, end: Position) -> Arc:
    """The arc of a block whose axis words go to `end`."""
    plane, mode = state.plane, state.modal["motion"]
    state.frames.arc_scale(plane, mode)
    first, second, normal = PLANES[plane]
    start = state.position
    a, b = (start[first], start[second]), (end[first], end[second])
    clockwise = (mode == "G2") != state.frames.mirrors(plane)
    centre = None
    if mode == "CIP":
        found = by_intermediate(state, words, a, b)
    elif mode == "CT":
        found = by_tangent(state, a, b)
    else:
        centre = given_centre(state, words)
        if "AR" in words.values:
            found, b = by_angle(state, words, a, b, centre, clockwise)
        elif "CR" in words.values:
            radius = words.number("CR") * state.unit_mm * state.frames.arc_scale(plane, "CR")
            found = named("CR", words, lambda: by_radius(a, b, radius, clockwise, state.settings.arc_radius_error_mm_max))
        else:
            if centre is None:
                raise RefusedError(mode, f"an arc in G{plane} needs I, J, K of the plane, CR=, AR=, or AP= and RP=")
            middle = centre
            found = named(mode, words, lambda: by_centre(a, b, middle, clockwise, state.settings.arc_radius_error_mm_max))
    sweep = found.sweep_rad
    if "TURN" in words.values:
        sweep += math.copysign(math.tau * words.values["TURN"].whole(0, TURNS_MAX), sweep)
    place, full = list(end), list(start[:3])
    place[first], place[second] = b
    full[first], full[second] = found.centre
    length = arc_length(a, found.centre, sweep, end[normal] - start[normal])
    feed, per_rev = state.feed(length)
    return Arc(state.line, tuple(place), (full[0], full[1], full[2]), plane, sweep, feed, per_rev, state.program)


def named(word: str, words: Words, find: Callable[[], Sweep]) -> Sweep:
    """Call `find`, and name the word where it refuses."""
    try:
        return find()
    except RefusedError as refused:
        text = words.values[word].text if word in words.values else word
        raise RefusedError(text, refused.reason.replace("write I, J, K for", "write I, J, K, or TURN=, for")) from None


def given_centre(state: State, words: Words) -> Point | None:
    """I, J, K of the plane in machine coordinates; with AP or RP the pole. None where there is neither."""
    first, second, _ = PLANES[state.plane]
    letters = [CENTRE_LETTERS[first], CENTRE_LETTERS[second]]
    start = state.frames.to_program(state.position)
    if not any(letter in words.values for letter in letters):
        if "AP" not in words.values and "RP" not in words.values:
            return None
        program = list(start)
        program[first], program[second] = state.pole.centre
    else:
        program = list(start)
        for letter, axis in zip(letters, (first, second), strict=True):
            if letter in words.values:
                given = words.values[letter]
                value = given.number * state.unit_mm
                program[axis] = value if given.mode == "AC" else program[axis] + value
    machine = state.checked(state.frames.to_machine(tuple(program)))
    return machine[first], machine[second]


def by_angle(state: State, words: Words, a: Point, b: Point, centre: Point | None, clockwise: bool) -> tuple[Sweep, Point]:
    """AR=: with the centre it gives the end, with the end the centre."""
    given = words.values["AR"]
    angle = math.radians(given.number)
    if not 0.0 < angle < math.tau:
        raise RefusedError(given.text, "an opening angle is more than 0° and less than 360°; a full circle has I, J, K")
    sweep = -angle if clockwise else angle
    if centre is not None:
        away = (a[0] - centre[0], a[1] - centre[1])
        end = (
            centre[0] + away[0] * math.cos(sweep) - away[1] * math.sin(sweep),
            centre[1] + away[0] * math.sin(sweep) + away[1] * math.cos(sweep),
        )
        if math.hypot(*away) < SAME_MM:
            raise RefusedError(given.text, "the centre of this arc is its start")
        return Sweep(centre, sweep), end
    chord = math.dist(a, b)
    if chord < SAME_MM:
        raise RefusedError(given.text, "needs the end of the arc, or its centre")
    radius = chord / 2.0 / math.sin(angle / 2.0)
    found = by_radius(a, b, radius if angle <= math.pi else -radius, clockwise, math.inf)
    return Sweep(found.centre, sweep), b


def by_intermediate(state: State, words: Words, a: Point, b: Point) -> Sweep:
    """CIP: the circle through start, intermediate point and end, which have to lie level in the plane."""
    first, second, normal = PLANES[state.plane]
    names = ("I1", "J1", "K1")
    if not any(name in words.values for name in names):
        raise RefusedError("CIP", "needs the intermediate point: I1=, J1=, K1=")
    program = list(state.frames.to_program(state.position))
    for axis, name in enumerate(names):
        if name in words.values:
            given = words.values[name]
            value = given.number * state.unit_mm
            incremental = given.mode == "IC" or (not given.mode and state.modal["distance"] == "G91")
            program[axis] = program[axis] + value if incremental else value
    machine = state.checked(state.frames.to_machine(tuple(program)))
    if abs(machine[normal] - state.position[normal]) > SAME_MM:
        raise RefusedError("CIP", f"a circle in space is not read; its three points have to lie in G{state.plane}")
    middle = (machine[first], machine[second])
    centre = circumcentre(a, middle, b)
    if centre is None:
        raise RefusedError("CIP", "start, intermediate point and end lie on one line")
    turn = (middle[0] - a[0]) * (b[1] - a[1]) - (middle[1] - a[1]) * (b[0] - a[0])
    return Sweep(centre, sweep_about(a, b, centre, clockwise=turn < 0.0))


def circumcentre(a: Point, b: Point, c: Point) -> Point | None:
    """The centre of the circle through three points; None where they lie on one line.

    >>> circumcentre((0.0, 0.0), (1.0, 1.0), (2.0, 0.0))
    (1.0, 0.0)
    """
    twice = 2.0 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    size = max(math.dist(a, b), math.dist(a, c), math.dist(b, c))
    if abs(twice) < SAME_MM * size:
        return None
    p = (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2
    q = (c[0] - a[0]) ** 2 + (c[1] - a[1]) ** 2
    across = ((c[1] - a[1]) * p - (b[1] - a[1]) * q) / twice
    along = ((b[0] - a[0]) * q - (c[0] - a[0]) * p) / twice
    return a[0] + across, a[1] + along


def by_tangent(state: State, a: Point, b: Point) -> Sweep:
    """CT: the arc that goes on in the direction of the motion before."""
    if state.tangent is None:
        raise RefusedError("CT", "needs a motion in the plane before it, to which it is tangential")
    chord = (b[0] - a[0], b[1] - a[1])
    across = state.tangent[0] * chord[1] - state.tangent[1] * chord[0]
    square = chord[0] ** 2 + chord[1] ** 2
    if square < SAME_MM**2:
        raise RefusedError("CT", "start and end of this arc are one point")
    if abs(across) < 1e-9 * math.sqrt(square):
        raise RefusedError("CT", "its end lies straight ahead; write G1")
    radius = square / (2.0 * across)
    centre = (a[0] - state.tangent[1] * radius, a[1] + state.tangent[0] * radius)
    return Sweep(centre, sweep_about(a, b, centre, clockwise=radius < 0.0))
