"""S, M3, M4, M5, M19, M29, G96 and G97: what the spindle is told."""

from typing import Final

from twin.programs.canonical import Position, Spindle, SpindleOrient
from twin.programs.fanuc.state import State
from twin.programs.spindle_speed import checked_speed, rpm_at_radius

DIRECTIONS: Final = {3: 1, 4: -1}


def turn(state: State, direction: int) -> None:
    """Start or stop the spindle at the speed in force."""
    state.spindle_direction = direction
    state.emit(Spindle(state.line, state.rpm if direction else 0.0, direction, state.program))


def set_speed(state: State, text: str, speed: float) -> None:
    """S: rev/min, or in G96 the surface speed, m/min (G20: feet/min)."""
    state.speed_word = checked_speed(speed, text)
    if state.modal.speed == 970 and speed != state.rpm:
        state.rpm = speed
        return
    if state.modal.speed == 960:
        follow_surface_speed(state, state.position)


def m_code(state: State, code: int) -> bool:
    """Do M3, M4, M5, M19, M29; whether the spindle was told its speed."""
    if code in DIRECTIONS:
        turn(state, DIRECTIONS[code])
    elif code == 5:
        turn(state, 0)
    elif code == 19:
        state.spindle_direction = 0
        state.emit(SpindleOrient(state.line, state.program))
    elif code == 29:
        state.rigid = True
    return code in DIRECTIONS or code == 5


def follow_surface_speed(state: State, end: Position) -> None:
    """G96: the radius is the program coordinate of the chosen axis at the end of the block; G92 S is the clamp."""
    if state.modal.speed != 960:
        return
    radius_mm = abs(state.coordinates.to_program(end)[state.spindle_axis])
    rpm = rpm_at_radius(state.speed_word, state.modal.units == 200, radius_mm, state.speed_max, "G92 S")
    if rpm != state.rpm:
        state.rpm = rpm
        if state.spindle_direction:
            turn(state, state.spindle_direction)
