"""G0 to G3, G31 and G33: from the words of a block to one canonical motion."""

import math
from typing import Final

from twin.programs.arcs import Sweep, arc_length, by_centre, by_radius
from twin.programs.canonical import Arc, ExactStop, Linear, Motion, Position, Rapid
from twin.programs.fanuc import compensation, corners
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.codes import written
from twin.programs.fanuc.spindle import follow_surface_speed
from twin.programs.fanuc.state import PolarPole, State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError

CENTRE_LETTERS: Final = "IJK"
Z: Final = 2
"""The axis that the length of the tool is in."""


def axis_letters(state: State, words: Words) -> list[int]:
    """Axes that the block names, by index. RefusedError for an axis that the machine does not have."""
    named = []
    for letter in words.values:
        if letter in "XYZABC":
            if letter.lower() not in state.axes:
                raise RefusedError(words.texts[letter], f"the machine has no axis {letter}; it has {', '.join(state.axes)}")
            named.append(state.axes.index(letter.lower()))
    return named


def target(state: State, words: Words, named: list[int]) -> Position:
    """Machine position that the axis words ask for; an axis that is not named stays."""
    coordinates, absolute = state.coordinates, state.modal.distance == 900
    if Z in named:
        state.take_length()
    if state.modal.polar == 160 and any(axis in PLANES[state.plane][:2] for axis in named):
        return state.checked(coordinates.to_machine(polar_target(state, words, named)))
    if coordinates.plain:
        moved = list(state.position)
        for axis in named:
            value = state.length(words, state.axes[axis].upper())
            moved[axis] = value + coordinates.offset[axis] if absolute else moved[axis] + value
        return state.checked(tuple(moved))
    program = list(coordinates.to_program(state.position))
    for axis in named:
        value = state.length(words, state.axes[axis].upper())
        program[axis] = value if absolute else program[axis] + value
    return state.checked(coordinates.to_machine(tuple(program)))


def polar_target(state: State, words: Words, named: list[int]) -> Position:
    """G16: the first axis of the plane is a radius, the second an angle. In G91 the radius has its pole where the tool is."""
    program, absolute = list(state.coordinates.to_program(state.position)), state.modal.distance == 900
    first, second, _ = PLANES[state.plane]
    pole = state.pole
    if pole is None:
        here = math.hypot(program[first], program[second])
        pole = state.pole = PolarPole((0.0, 0.0), here, math.degrees(math.atan2(program[second], program[first])))
    for axis in named:
        letter = state.axes[axis].upper()
        if axis == first:
            pole.radius_mm = state.length(words, letter)
            pole.centre = (0.0, 0.0) if absolute else (program[first], program[second])
        elif axis == second:
            angle = state.angle(words, letter)
            pole.angle_deg = angle if absolute else pole.angle_deg + angle
        else:
            value = state.length(words, letter)
            program[axis] = value if absolute else program[axis] + value
    angle_rad = math.radians(pole.angle_deg)
    program[first] = pole.centre[0] + pole.radius_mm * math.cos(angle_rad)
    program[second] = pole.centre[1] + pole.radius_mm * math.sin(angle_rad)
    return tuple(program)


def distance(start: Position, end: Position) -> float:
    """Length of a straight move over x, y, z; of a move of rotary axes alone, its degrees."""
    return math.dist(start[:3], end[:3]) or math.dist(start, end)


def add(state: State, move: Motion) -> None:
    """Put out a motion, and take the position on."""
    if state.corner is not None:
        move = corners.close(state, move)
    if state.compensation is not None:
        compensation.note(state, move)
    state.emit(move)
    start, state.position = state.position, move.end_mm
    if state.compensation is not None:
        compensation.after_move(state, start)


def linear(state: State, end: Position) -> None:
    """Cut straight to a machine position."""
    feed, per_rev = state.feed(distance(state.position, end))
    add(state, Linear(state.line, end, feed, per_rev, state.program))


def rapid(state: State, end: Position) -> None:
    """Go to a machine position in rapid."""
    add(state, Rapid(state.line, end, state.program))


def move(state: State, words: Words, named: list[int]) -> None:
    """The motion of a block with axis words (or an arc's centre) in the mode in force."""
    mode = state.modal.motion
    single = "exact" in words.codes and state.modal.path != 610
    if words.corner is not None and mode not in (10, 20, 30):
        raise RefusedError("," + words.corner[0], f"stands in a block of G1, G2 or G3, not {written(mode)}")
    if state.modal.feed == 930 and mode in (10, 20, 30) and "F" not in words.values:
        raise RefusedError("", "in inverse time (G93) every cut needs its own F")
    start, end = state.position, target(state, words, named)
    follow_surface_speed(state, end)
    if single:
        state.emit(ExactStop(state.line, True, state.program))
    if "skip" in words.codes:
        linear(state, end)
        state.skip_position = end
    elif mode == 0:
        rapid(state, end)
    elif mode == 10:
        linear(state, end)
    elif mode == 330:
        thread(state, end)
    else:
        arc(state, words, end)
    if single:
        state.emit(ExactStop(state.line, False, state.program))
    if words.corner is not None:
        corners.begin(state, words, start)


def thread(state: State, end: Position) -> None:
    """G33: F is the lead, mm/rev, in whatever feed mode."""
    if state.feed_word <= 0.0:
        raise RefusedError("", "a thread needs its lead; write F")
    if state.rpm <= 0.0 or state.spindle_direction == 0:
        raise RefusedError("", "a thread needs a turning spindle; write S and M3 before")
    add(state, Linear(state.line, end, state.feed_word * state.rpm, state.feed_word, state.program))


def centre_offset(state: State, words: Words) -> Position:
    """I, J, K as a vector in machine coordinates."""
    vector = [0.0] * len(state.axes)
    for axis, letter in enumerate(CENTRE_LETTERS):
        if letter in words.values:
            vector[axis] = state.length(words, letter)
    return state.coordinates.linear(tuple(vector))


def arc(state: State, words: Words, end: Position) -> None:
    """G2, G3, as R or as I, J, K; a helix where the end is out of the plane."""
    plane = state.plane
    first, second, normal = PLANES[plane]
    scale = state.coordinates.arc_scale(plane)
    clockwise = (state.modal.motion == 20) != state.coordinates.mirrors(plane)
    start = state.position
    start_point, end_point = (start[first], start[second]), (end[first], end[second])
    error_max = state.settings.arc_radius_error_mm_max
    in_plane = [CENTRE_LETTERS[axis] for axis in (first, second)]
    if "R" in words.values:
        radius = state.length(words, "R") * scale
        try:
            found: Sweep = by_radius(start_point, end_point, radius, clockwise, error_max)
        except RefusedError as refused:
            raise RefusedError(words.texts["R"], refused.reason) from None
    elif any(letter in words.values for letter in in_plane):
        vector = centre_offset(state, words)
        centre = (start[first] + vector[first], start[second] + vector[second])
        found = by_centre(start_point, end_point, centre, clockwise, error_max)
    else:
        raise RefusedError("", f"an arc in G{plane} needs R, or {' and '.join(in_plane)}")
    full = list(start[:3])
    full[first], full[second] = found.centre
    length = arc_length(start_point, found.centre, found.sweep_rad, end[normal] - start[normal])
    feed, per_rev = state.feed(length)
    middle = (full[0], full[1], full[2])
    add(state, Arc(state.line, end, middle, plane, found.sweep_rad, feed, per_rev, state.program))
