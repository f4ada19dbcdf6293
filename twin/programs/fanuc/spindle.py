"""S, M3, M4, M5, M19, M29, G96 and G97: what the spindle is told."""

import math
from typing import Final

from twin.programs.canonical import Position, Spindle, SpindleOrient
from twin.programs.fanuc.state import State
from twin.programs.refusal import RefusedError

RPM_MAX: Final = 1_000_000.0
DIRECTIONS: Final = {3: 1, 4: -1}


def turn(state: State, direction: int) -> None:
    """Start or stop the spindle at the speed in force."""
    state.spindle_direction = direction
    state.emit(Spindle(state.line, state.rpm if direction else 0.0, direction, state.program))


def set_speed(state: State, text: str, speed: float) -> None:
    """S: rev/min, or in G96 the surface speed, m/min (G20: feet/min)."""
    if speed < 0.0 or speed > RPM_MAX:
        raise RefusedError(text, f"a spindle speed is from 0 to {RPM_MAX:g}; its direction is M3 or M4")
    state.speed_word = speed
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
    """G96: n = V / (2 π r), with r the program coordinate of the chosen axis at the end of the block.

    A control turns faster all along a facing cut; here the speed changes block by block. At r = 0 only a clamp (G92 S,
    `Settings.spindle_rpm_max`) gives a speed.
    """
    if state.modal.speed != 960:
        return
    feet = state.modal.units == 200
    speed_mm_min = state.speed_word * (304.8 if feet else 1000.0)
    radius_mm = abs(state.coordinates.to_program(end)[state.spindle_axis])
    clamp = state.speed_max
    if speed_mm_min > 0.0 and radius_mm < 1e-9 and clamp is None:
        raise RefusedError("", "G96 at radius 0 is an endless speed; write G92 S before, or [control] spindle_rpm_max")
    rpm = speed_mm_min / (math.tau * radius_mm) if radius_mm >= 1e-9 else math.inf
    rpm = 0.0 if speed_mm_min == 0.0 else min(rpm, clamp if clamp is not None else RPM_MAX)
    if rpm != state.rpm:
        state.rpm = rpm
        if state.spindle_direction:
            turn(state, state.spindle_direction)
