"""S, M3, M4, M5, M19, SPOS, G96, G961, LIMS: what the spindle is told."""

import math
from typing import Final

from twin.programs.canonical import Position, Spindle, SpindleOrient
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

RPM_MAX: Final = 1_000_000.0
DIRECTIONS: Final = {3: 1, 4: -1, 5: 0}
TRANSVERSE: Final = 0
"""The axis whose coordinate is the radius of G96: x, the first geometry axis."""


def turn(state: State, direction: int) -> None:
    """Start or stop the spindle at the speed in force."""
    state.spindle_direction = direction
    state.emit(Spindle(state.line, state.rpm if direction else 0.0, direction, state.program))


def orient(state: State) -> None:
    """Stop the spindle at an angle."""
    state.spindle_direction = 0
    state.emit(SpindleOrient(state.line, state.program))


def is_surface_speed(state: State) -> bool:
    return state.modal["feed"] in ("G96", "G961")


def limit(state: State, speed: float, text: str) -> None:
    """LIMS=, G26 S: no faster than this."""
    if not 0.0 < speed <= RPM_MAX:
        raise RefusedError(text, f"a limit of the speed is more than 0, and up to {RPM_MAX:g}")
    state.speed_max = speed if state.settings.spindle_rpm_max is None else min(speed, state.settings.spindle_rpm_max)


def command(state: State, words: Words) -> None:
    """The speed and the M codes of a block."""
    before = state.rpm
    if "LIMS" in words.values:
        limit(state, words.number("LIMS"), words.values["LIMS"].text)
    is_speed = "S" in words.values and words.codes.get("once") != "G4" and words.codes.get("frame") not in ("G25", "G26")
    if is_speed:
        speed, text = words.number("S"), words.values["S"].text
        if not 0.0 <= speed <= RPM_MAX:
            raise RefusedError(text, f"a spindle speed is from 0 to {RPM_MAX:g}; its direction is M3 or M4")
        state.speed_word = speed
        if not is_surface_speed(state):
            state.rpm = speed if state.speed_max is None or speed <= state.speed_max else state.speed_max
    if is_surface_speed(state):
        follow_surface_speed(state, state.position)
    said = False
    for code in words.m:
        if code in DIRECTIONS:
            turn(state, DIRECTIONS[code])
            said = True
        elif code in (19, 70):
            orient(state)
    for name in ("SPOS", "SPOSA"):
        if name in words.values:
            orient(state)
    if not said and state.spindle_direction and not is_surface_speed(state) and state.rpm != before:
        turn(state, state.spindle_direction)


def follow_surface_speed(state: State, end: Position) -> None:
    """G96: n = V / (2 π r), with r the program coordinate of x at the end of the block; it changes block by block.

    At r = 0 only a limit (LIMS, `Settings.spindle_rpm_max`) gives a speed.
    """
    if not is_surface_speed(state):
        return
    feet = state.unit_mm != 1.0
    speed_mm_min = state.speed_word * (304.8 if feet else 1000.0)
    radius_mm = abs(state.frames.to_program(end)[TRANSVERSE])
    clamp = state.speed_max
    if speed_mm_min > 0.0 and radius_mm < 1e-9 and clamp is None:
        raise RefusedError("", "G96 at radius 0 is an endless speed; write LIMS= before, or [control] spindle_rpm_max")
    rpm = speed_mm_min / (math.tau * radius_mm) if radius_mm >= 1e-9 else math.inf
    rpm = 0.0 if speed_mm_min == 0.0 else min(rpm, clamp if clamp is not None else RPM_MAX)
    if rpm != state.rpm:
        state.rpm = rpm
        if state.spindle_direction:
            turn(state, state.spindle_direction)
