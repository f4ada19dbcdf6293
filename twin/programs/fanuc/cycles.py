"""Canned cycles G73, G74, G76, G81 to G89 (B-64604EN, "canned cycle for drilling").

A cycle is a list of steps at each hole: rapid over it at the initial level, rapid to R, cut to Z, do what it does there, back to
R (G99) or to the initial level (G98). Levels are along the normal of the plane. R, Z, Q, P, I and J stay until the cycle is
cancelled.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from twin.programs.canonical import Dwell, Linear, ProgramStop, Rapid, SpindleOrient
from twin.programs.fanuc import motion
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.codes import written
from twin.programs.fanuc.spindle import follow_surface_speed, turn
from twin.programs.fanuc.state import CycleData, State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import DwellUnit


class Hole(NamedTuple):
    """One hole in machine coordinates, mm: the axis of the tool, its levels (`back`: where it ends), and the
    shift off the wall."""

    axis: int
    initial: float
    r: float
    z: float
    q: float
    shift: tuple[float, float]
    dwell_s: float
    back: float


def run(state: State, words: Words, named: list[int]) -> None:
    """The cycle in force at the position of this block, K (or L) times; K0 only keeps the words."""
    normal = PLANES[state.plane][2]
    if state.coordinates.rotation is not None and state.coordinates.rotation.plane != state.plane:
        raise RefusedError("", "a cycle needs the plane of G68")
    if state.cycle is None:
        state.cycle = CycleData(initial_mm=state.coordinates.to_program(state.position)[normal])
    remember(state, words, state.cycle, normal)
    repeats = 1
    for letter in "KL":
        if letter in words.values:
            repeats = words.integer(letter, 0, state.settings.repeats_max)
    state.take_length()
    across = [axis for axis in named if axis != normal]
    for _ in range(repeats):
        position = list(motion.target(state, words, across))
        position[normal] = state.position[normal]
        hole = level(state, state.cycle, normal)
        follow_surface_speed(state, tuple(position))
        motion.rapid(state, tuple(position))
        if state.modal.cycle != 870:
            to(state, hole, hole.r, cuts=False)
        CYCLES[state.modal.cycle](state, hole)
        if state.modal.cycle != 870:
            to(state, hole, hole.back, cuts=False)


def remember(state: State, words: Words, data: CycleData, normal: int) -> None:
    """Take over the words of the cycle. In G91, R counts from the initial level and Z from R."""
    absolute, axis = state.modal.distance == 900, "XYZ"[normal]
    for letter in words.values:
        if letter == "R":
            r = state.length(words, "R")
            data.r_mm = r if absolute else data.initial_mm + r
        elif letter == "Q":
            data.q_mm = abs(state.length(words, "Q"))
        elif letter == "P":
            seconds = words.values["P"] / (1.0 if state.settings.dwell_unit is DwellUnit.SECONDS else 1000.0)
            if seconds < 0:
                raise RefusedError(words.texts["P"], "a dwell is a time of at least 0")
            data.dwell_s = seconds
    in_plane = ["IJK"[axis] for axis in PLANES[state.plane][:2]]
    if any(letter in words.values for letter in in_plane):
        a, b = (state.length(words, letter) if letter in words.values else 0.0 for letter in in_plane)
        data.shift_mm = (a, b)
    if data.r_mm is None:
        raise RefusedError(written(state.modal.cycle), "needs the level R")
    if axis in words.values:
        z = state.length(words, axis)
        data.z_mm = z if absolute else data.r_mm + z
    if data.z_mm is None:
        raise RefusedError(written(state.modal.cycle), f"needs the depth {axis}")


def level(state: State, data: CycleData, normal: int) -> Hole:
    """The levels and the shift of a cycle in machine coordinates. Q and the shift are not scaled."""
    assert data.r_mm is not None and data.z_mm is not None
    here = list(state.coordinates.to_program(state.position))
    levels = []
    for value in (data.initial_mm, data.r_mm, data.z_mm):
        here[normal] = value
        levels.append(state.checked(state.coordinates.to_machine(tuple(here)))[normal])
    shift = data.shift_mm
    if shift is None:
        angle = math.radians(state.settings.bore_shift_deg)
        shift = (data.q_mm * round(math.cos(angle)), data.q_mm * round(math.sin(angle)))
    back = levels[0] if state.modal.retract == 980 else levels[1]
    return Hole(normal, levels[0], levels[1], levels[2], data.q_mm, shift, data.dwell_s, back)


def to(state: State, hole: Hole, height: float, cuts: bool) -> None:
    """Move along the tool, cutting or in rapid."""
    moved = list(state.position)
    moved[hole.axis] = height
    if cuts:
        motion.linear(state, tuple(moved))
    elif moved[hole.axis] != state.position[hole.axis]:
        motion.rapid(state, tuple(moved))


def pause(state: State, hole: Hole) -> None:
    if hole.dwell_s > 0.0:
        state.emit(Dwell(state.line, hole.dwell_s, state.program))


def drill(state: State, hole: Hole) -> None:
    """G81; G82 with its pause at the bottom."""
    to(state, hole, hole.z, cuts=True)
    if state.modal.cycle == 820:
        pause(state, hole)
    to(state, hole, hole.back, cuts=False)


def peck(state: State, hole: Hole) -> None:
    """G83: out to R after each Q, then down in rapid to `peck_clearance_mm` above the last depth. G73: back by
    `peck_retract_mm` only."""
    text = written(state.modal.cycle)
    if hole.q <= 0.0:
        raise RefusedError(text, "needs the depth of a peck; write Q")
    depth, down = abs(hole.z - hole.r), math.copysign(1.0, hole.z - hole.r)
    if depth / hole.q > state.settings.pecks_max:
        raise RefusedError(text, f"makes more than {state.settings.pecks_max} pecks; a larger Q, or Settings.pecks_max")
    chips = state.modal.cycle == 730
    done = 0.0
    while done < depth:
        if done > 0.0 and not chips:
            to(state, hole, hole.r + down * max(done - state.settings.peck_clearance_mm, 0.0), cuts=False)
        # A remainder that is only rounding is no peck of its own.
        done = depth if done + hole.q > depth - 1e-9 else done + hole.q
        to(state, hole, hole.r + down * done if done < depth else hole.z, cuts=True)
        if done >= depth:
            pause(state, hole)
            to(state, hole, hole.back, cuts=False)
        elif chips:
            to(state, hole, hole.r + down * max(done - state.settings.peck_retract_mm, 0.0), cuts=False)
        else:
            to(state, hole, hole.r, cuts=False)


def tap(state: State, hole: Hole) -> None:
    """G84 (right hand), G74 (left hand): in and out tied to the spindle, which turns back at the bottom."""
    right = 1 if state.modal.cycle == 840 else -1
    if state.rpm <= 0.0 or state.feed_word <= 0.0:
        raise RefusedError(written(state.modal.cycle), "needs the speed and the feed; write S and F")
    if state.spindle_direction != right:
        turn(state, right)
    synchronous(state, hole, hole.z)
    pause(state, hole)
    turn(state, -right)
    synchronous(state, hole, hole.r)
    pause(state, hole)
    turn(state, 0 if state.rigid else right)


def synchronous(state: State, hole: Hole, height: float) -> None:
    moved = list(state.position)
    moved[hole.axis] = height
    if state.modal.feed == 930:
        raise RefusedError(written(state.modal.cycle), "cannot tap in inverse time (G93); write G94 or G95")
    per_rev = state.feed_word if state.modal.feed == 950 else state.feed_word / state.rpm
    motion.add(state, Linear(state.line, tuple(moved), per_rev * state.rpm, per_rev, state.program))


def bore(state: State, hole: Hole) -> None:
    """G85: out with feed. G89: after a pause."""
    to(state, hole, hole.z, cuts=True)
    if state.modal.cycle == 890:
        pause(state, hole)
    to(state, hole, hole.r, cuts=True)


def bore_and_stop(state: State, hole: Hole) -> None:
    """G86: the spindle stands while the tool leaves. G88: the operator takes the tool out, so the program stops there."""
    direction = state.spindle_direction
    to(state, hole, hole.z, cuts=True)
    if state.modal.cycle == 880:
        pause(state, hole)
    turn(state, 0)
    if state.modal.cycle == 880:
        state.emit(ProgramStop(state.line, False, state.program))
    to(state, hole, hole.back, cuts=False)
    turn(state, direction)


def shifted(state: State, hole: Hole, sign: float) -> None:
    """Move the oriented tool away from the wall (+1) or back (-1)."""
    first, second, _ = PLANES[state.plane]
    moved = list(state.position)
    moved[first] += sign * hole.shift[0]
    moved[second] += sign * hole.shift[1]
    motion.add(state, Rapid(state.line, tuple(moved), state.program))


def oriented(state: State) -> None:
    state.emit(SpindleOrient(state.line, state.program))


def fine_bore(state: State, hole: Hole) -> None:
    """G76: at the bottom the spindle is oriented, and the tool leaves without touching the wall."""
    need_shift(state, hole)
    direction = state.spindle_direction
    to(state, hole, hole.z, cuts=True)
    pause(state, hole)
    oriented(state)
    shifted(state, hole, +1.0)
    to(state, hole, hole.back, cuts=False)
    shifted(state, hole, -1.0)
    turn(state, direction)


def back_bore(state: State, hole: Hole) -> None:
    """G87: down beside the hole with the oriented tool to R, then upwards with feed to Z. Always back to the initial level."""
    need_shift(state, hole)
    if state.modal.retract != 980:
        raise RefusedError("G87", "returns to the initial level only; write G98")
    direction = state.spindle_direction
    oriented(state)
    shifted(state, hole, +1.0)
    to(state, hole, hole.r, cuts=False)
    shifted(state, hole, -1.0)
    turn(state, direction or 1)
    to(state, hole, hole.z, cuts=True)
    pause(state, hole)
    oriented(state)
    shifted(state, hole, +1.0)
    to(state, hole, hole.initial, cuts=False)
    shifted(state, hole, -1.0)
    turn(state, direction or 1)


def need_shift(state: State, hole: Hole) -> None:
    if hole.shift == (0.0, 0.0):
        raise RefusedError(written(state.modal.cycle), "needs the shift off the wall; write Q, or I and J")


CYCLES: Final[Mapping[int, Callable[[State, Hole], None]]] = {
    730: peck,
    740: tap,
    760: fine_bore,
    810: drill,
    820: drill,
    830: peck,
    840: tap,
    850: bore,
    860: bore_and_stop,
    870: back_bore,
    880: bore_and_stop,
    890: bore,
}
