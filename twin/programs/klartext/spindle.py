"""The spindle: M3, M4, M5, M13, M14, and the speed of TOOL CALL."""

from typing import Final

from twin.programs.canonical import Coolant, Spindle, SpindleOrient
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

RPM_MAX: Final = 1_000_000.0


def turn(state: State, direction: int) -> None:
    """Start or stop the spindle at the speed in force."""
    if state.spindle_direction:
        state.stopped_direction = state.spindle_direction
    state.spindle_direction = direction
    state.emit(Spindle(state.line, state.rpm if direction else 0.0, direction, state.program))


def set_speed(state: State, rpm: float, text: str) -> None:
    """S of TOOL CALL. A spindle that turns takes it up at once."""
    if not 0.0 <= rpm <= RPM_MAX:
        raise RefusedError(text, f"a spindle speed is from 0 to {RPM_MAX:g}; its direction is M3 or M4")
    changes = rpm != state.rpm
    state.rpm = rpm
    if changes and state.spindle_direction:
        turn(state, state.spindle_direction)


def orient(state: State) -> None:
    """The spindle stands at an angle."""
    if state.spindle_direction:
        state.stopped_direction = state.spindle_direction
    state.spindle_direction = 0
    state.emit(SpindleOrient(state.line, state.program))


def coolant(state: State, on: bool) -> None:
    state.coolant = on
    state.emit(Coolant(state.line, on, state.program))
