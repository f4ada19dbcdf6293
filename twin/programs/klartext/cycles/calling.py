"""CYCL CALL, CYCL CALL POS, CYCL CALL PAT, M99 and M89: where the cycle that was defined last is run."""

from collections.abc import Callable
from dataclasses import replace

from twin.programs.klartext import m_functions, motion
from twin.programs.klartext.block import Block, parse
from twin.programs.klartext.cycles import steps
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.cycles.running import run_cycle
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError


def defined(state: State, text: str) -> Definition:
    if state.cycle is None:
        raise RefusedError(text, "no cycle is defined that could be called; write CYCL DEF before")
    return state.cycle


def after_positioning(state: State, block: Block, moved: bool) -> None:
    """M99: once, here. M89: here and behind every block that moves, up to M99 or the next definition."""
    codes = {function.code for function in block.m}
    if 89 in codes:
        state.calls_cycle = True
    if 99 in codes or (state.calls_cycle and moved):
        run_cycle(state, defined(state, "M99" if 99 in codes else "M89"))
    if 99 in codes:
        state.calls_cycle = False


def call(source: Source, begin: int, head: str) -> Callable[[State], None]:
    """`CYCL CALL M3`, `CYCL CALL POS X+10 Y+20 Z+0 FMAX`, `CYCL CALL PAT F500`."""
    allowed = frozenset("XYZ") if head == "CYCL CALL POS" else frozenset[str]()
    block = parse(source, begin, allowed)
    act = {"CYCL CALL": here, "CYCL CALL POS": at_position, "CYCL CALL PAT": at_pattern}[head]

    def run(state: State) -> None:
        m_functions.before(state, block.m)
        act(state, block)
        m_functions.after(state, block.m)

    return run


def here(state: State, block: Block) -> None:
    run_cycle(state, defined(state, "CYCL CALL"))


def at_position(state: State, block: Block) -> None:
    """The position is that of the cycle; its height is added to the surface Q203."""
    cycle = defined(state, "CYCL CALL POS")
    rapid = motion.take_feed(state, block) or block.feed is None
    program = list(state.frame.to_program(state.position))
    raised = 0.0
    for axis, (given, _) in motion.coordinates(state, block).items():
        if axis == state.normal:
            raised = given
        else:
            program[axis] = given
    state.take_length()
    second = raised + cycle.length(203) + max(cycle.length(204), cycle.length(200))
    # Up first where the tool is below: the way to the place is at the second set-up clearance at least.
    if steps.height(state) < second:
        steps.to(state, second)
    program[state.normal] = steps.height(state)
    motion.line(state, state.frame.to_machine(tuple(program)), rapid)
    run_cycle(state, replace(cycle, raised_mm=raised))


def at_pattern(state: State, block: Block) -> None:
    """At every place of PATTERN DEF; between them at the second set-up clearance."""
    cycle = defined(state, "CYCL CALL PAT")
    if not state.pattern:
        raise RefusedError("CYCL CALL PAT", "needs places; write PATTERN DEF before")
    rapid = motion.take_feed(state, block) or block.feed is None
    state.take_length()
    for place in state.pattern:
        raised = replace(cycle, raised_mm=place[2])
        second = raised.surface_mm() + max(cycle.length(204), cycle.length(200))
        if steps.height(state) < second:
            steps.to(state, second)
        end = steps.placed_in_plane(state, place[0], place[1])
        if end != state.position:
            motion.line(state, end, rapid)
        run_cycle(state, raised)
