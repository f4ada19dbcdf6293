"""S, M3, M4, M5, M19, SPOS, G96, G961, LIMS: what the spindle is told."""

from typing import Final

from twin.programs.canonical import Position, Spindle, SpindleOrient
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words
from twin.programs.spindle_speed import RPM_MAX, checked_speed, rpm_at_radius

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
        speed = state.speed_word = checked_speed(words.number("S"), words.values["S"].text)
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
    """G96: the radius is the program coordinate of x at the end of the block; LIMS is the clamp."""
    if not is_surface_speed(state):
        return
    radius_mm = abs(state.frames.to_program(end)[TRANSVERSE])
    rpm = rpm_at_radius(state.speed_word, state.unit_mm != 1.0, radius_mm, state.speed_max, "LIMS=")
    if rpm != state.rpm:
        state.rpm = rpm
        if state.spindle_direction:
            turn(state, state.spindle_direction)
