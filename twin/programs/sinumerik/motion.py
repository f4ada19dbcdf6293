"""Motion: the targets of a block's axis words, and the moves that come of them."""

import math
from typing import Final

from twin.programs.canonical import Arc, Linear, Motion, Move, Position, Rapid
from twin.programs.pieces import piece
from twin.programs.planar import extent, tangent
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import compensation, corners
from twin.programs.sinumerik.polar import polar_target
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Given, Words

Z: Final = 2
REACH_MM: Final = 1e-6


def named_axes(state: State, words: Words) -> list[int]:
    """Axes that the block names, by index."""
    return [at for at, axis in enumerate(state.axes) if axis.upper() in words.values]


def axis_value(state: State, axis: int, given: Given, now: float) -> float:
    """Return where an axis word goes, in program coordinates: G90 and G91, AC() and IC(), and for rotary axes DC(), ACP(),
    ACN()."""
    value = given.number
    rotary = axis > Z
    if not rotary:
        value *= state.unit_mm
    mode = given.mode or ("AC" if state.modal["distance"] == "G90" else "IC")
    if mode == "IC":
        return now + value
    if mode == "AC":
        return value
    if not rotary:
        raise RefusedError(given.text, f"{mode} is for rotary axes; write AC or IC")
    way = (value - now) % 360.0
    if mode == "ACN":
        way -= 360.0 if way else 0.0
    elif mode == "DC" and way > 180.0:
        way -= 360.0
    return now + way


def target(state: State, words: Words) -> Position:
    """Machine position that the block asks for; an axis that is not named stays."""
    if state.axes[Z].upper() in words.values:
        state.take_length()
    program = list(state.frames.to_program(state.position))
    if "AP" in words.values or "RP" in words.values:
        first, second, _ = PLANES[state.plane]
        program[first], program[second] = polar_target(state, words, (program[first], program[second]))
    for axis in named_axes(state, words):
        program[axis] = axis_value(state, axis, words.values[state.axes[axis].upper()], program[axis])
    return state.checked(state.frames.to_machine(tuple(program)))


def distance(start: Position, end: Position) -> float:
    """Length of a straight move over x, y, z; of a move of rotary axes alone, its degrees."""
    return math.dist(start[:3], end[:3]) or math.dist(start, end)


def add(state: State, move: Motion) -> None:
    """Put out a motion, and take the position on."""
    state.checked(move.end_mm)
    if state.waits_for_tool and not isinstance(move, Rapid):
        raise RefusedError("", f"T{state.preselected} was chosen, and no tool is in the spindle yet; write M6")
    if state.corner is not None:
        move = corners.close(state, move)
    start = state.position
    keep_tangent(state, start, move)
    put = compensation.note(state, move) if state.compensation is not None else move
    state.emit(put)
    state.position = move.end_mm
    if state.compensation is not None:
        compensation.after_move(state, start)


def keep_tangent(state: State, start: Position, move: Motion) -> None:
    """Remember the direction in which the motion ends in the plane, for CT."""
    if isinstance(move, Arc) and move.plane != state.plane:
        state.tangent = None
        return
    side = piece(start, move, state.plane)
    if extent(side) > REACH_MM:
        state.tangent = tangent(side, side.end)


def keep_tangents(state: State, start: Position, moves: list[Move]) -> None:
    """The same after several motions: the last that goes anywhere in the plane counts."""
    for at in range(len(moves) - 1, -1, -1):
        move = moves[at]
        before = getattr(moves[at - 1], "end_mm", start) if at else start
        if isinstance(move, Rapid | Linear | Arc) and extent(piece(before, move, state.plane)) > REACH_MM:
            keep_tangent(state, before, move)
            return


def linear(state: State, end: Position) -> None:
    """Cut straight to a machine position."""
    feed, per_rev = state.feed(distance(state.position, end))
    add(state, Linear(state.line, end, feed, per_rev, state.program))


def rapid(state: State, end: Position) -> None:
    """Go to a machine position in rapid."""
    add(state, Rapid(state.line, end, state.program))
