"""The spindle: M3, M4, M5, M13, M14, and the speed of TOOL CALL."""

from twin.programs.canonical import Coolant, Spindle, SpindleOrient
from twin.programs.klartext.state import State
from twin.programs.spindle_speed import checked_speed


def turn(state: State, direction: int) -> None:
    """Start or stop the spindle at the speed in force."""
    if state.spindle_direction:
        state.stopped_direction = state.spindle_direction
    state.spindle_direction = direction
    state.emit(Spindle(state.line, state.rpm if direction else 0.0, direction, state.program))


def set_speed(state: State, rpm: float, text: str) -> None:
    """S of TOOL CALL. A spindle that turns takes it up at once."""
    changes = checked_speed(rpm, text) != state.rpm
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
