"""Cycles 206, 207 and 209: tapping, with a floating holder, without, and with chip breaking.

Feed = pitch times speed, tied to the spindle. Q239 < 0 is a left-hand thread (Cycle Programming TNC 640, "Tapping").
"""

import math

from twin.programs.klartext import spindle
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError


def need_speed(state: State, cycle: Definition) -> None:
    if state.rpm <= 0.0:
        raise RefusedError(cycle.text, "needs the speed of the spindle; write S in TOOL CALL")


def tapping(state: State, cycle: Definition) -> None:
    """206: Q206 is the feed, pitch times speed; at depth the spindle turns back, and once more at the set-up clearance."""
    total = cycle.depth_mm()
    if total == 0.0:
        return
    need_speed(state, cycle)
    feed = cycle.cutting_feed(206)
    pitch, direction = feed / state.rpm, state.spindle_direction or 1
    clearance = steps.begin(state, cycle)
    if state.spindle_direction != direction:
        spindle.turn(state, direction)
    steps.to(state, cycle.surface_mm() - total, feed, pitch)
    steps.pause(state, cycle.seconds(211))
    spindle.turn(state, -direction)
    steps.to(state, clearance, feed, pitch)
    spindle.turn(state, direction)
    steps.finish(state, cycle)


def rigid_tapping(state: State, cycle: Definition) -> None:
    """207: Q239 is the pitch; at the set-up clearance the spindle stops."""
    thread(state, cycle, every_mm=0.0, back_mm=0.0)


def tapping_with_breaks(state: State, cycle: Definition) -> None:
    """209: a chip is broken every Q257; the tool goes back by Q256 times the pitch, or all the way out where Q256 is 0."""
    thread(state, cycle, cycle.length(257, 0.0), cycle.value(256) * abs(cycle.length(239)))


def thread(state: State, cycle: Definition, every_mm: float, back_mm: float) -> None:
    total = cycle.depth_mm()
    if total == 0.0:
        return
    need_speed(state, cycle)
    pitch, surface = abs(cycle.length(239)), cycle.surface_mm()
    if pitch == 0.0:
        raise cycle.refusal(239, "a thread needs its pitch")
    right = 1 if cycle.value(239) > 0.0 else -1
    faster = cycle.value(403)
    if not 0.0 < faster <= 10.0:
        raise cycle.refusal(403, "the speed of the way out is more than 0 and up to 10 times that of the way in")
    clearance, rpm = steps.begin(state, cycle), state.rpm
    depths = list(steps.pecks(state, cycle, total, every_mm, 0.0, 0.0)) if every_mm > 0.0 else [total]
    for depth in depths:
        if state.spindle_direction != right:
            spindle.turn(state, right)
        steps.to(state, surface - depth, pitch * rpm, pitch)
        last = math.isclose(depth, total)
        state.rpm = rpm * faster
        spindle.turn(state, -right)
        out = clearance if last or back_mm == 0.0 else surface - depth + back_mm
        steps.to(state, min(out, clearance), pitch * state.rpm, pitch)
        state.rpm = rpm
    spindle.turn(state, 0)
    steps.finish(state, cycle)
