"""The motion of a block in the mode in force: G0, G1, arcs, threads, and the tapping move G63."""

from twin.programs.canonical import ExactStop, Linear, Position
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import circles, corners
from twin.programs.sinumerik.codes import ARC_CODES
from twin.programs.sinumerik.contour_angle import angled
from twin.programs.sinumerik.motion import add, linear, rapid, target
from twin.programs.sinumerik.spindle import follow_surface_speed, turn
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words


def move(state: State, words: Words) -> None:
    """The motion of a block in the mode in force."""
    mode = state.modal["motion"]
    single = "exact" in words.codes and state.modal["path"] != "G60"
    corner = corners.wanted(state, words)
    if angled(state, words):
        return
    start, end = state.position, target(state, words)
    follow_surface_speed(state, end)
    if single:
        state.emit(ExactStop(state.line, True, state.program))
    if mode == "G0":
        rapid(state, end)
    elif mode == "G1":
        linear(state, end)
    elif mode in ARC_CODES:
        add(state, circles.arc(state, words, end))
    else:
        thread(state, words, end)
    if single:
        state.emit(ExactStop(state.line, False, state.program))
    if corner is not None:
        corners.begin(state, corner, start)


def thread(state: State, words: Words, end: Position) -> None:
    """G33, G331, G332: I, J or K is the lead along its axis, mm/rev; with G331 its sign is the hand of the thread."""
    mode = state.modal["motion"]
    given = [words.values[letter] for letter in "IJK" if letter in words.values]
    if len(given) != 1 or given[0].number == 0.0:
        raise RefusedError(mode, "needs the lead of the thread: one of I, J, K")
    lead = given[0].number * state.unit_mm
    if mode == "G33":
        feed, per_rev = state.per_revolution(abs(lead))
        add(state, Linear(state.line, end, feed, per_rev, state.program))
        return
    if state.rpm <= 0.0:
        raise RefusedError(mode, "needs the speed of the spindle; write S")
    direction = 1 if (lead > 0.0) == (mode == "G331") else -1
    turn(state, direction)
    add(state, Linear(state.line, end, abs(lead) * state.rpm, abs(lead), state.program))
    turn(state, 0)


def tap(state: State, words: Words) -> None:
    """G63: one tapping move with a compensating chuck; F is what the program makes of lead and speed."""
    end = target(state, words)
    linear(state, end)
