"""M functions: those at the beginning of a block, those at its end, and those that are refused by name.

Which acts when is that of the User's Manual TNC 640, "Overview of miscellaneous functions".
"""

from collections.abc import Mapping, Sequence
from typing import Final

from twin.programs.canonical import ProgramEnd, ProgramStop
from twin.programs.klartext import compensation, spindle
from twin.programs.klartext.block import MFunction
from twin.programs.klartext.state import EdgeFeed, State
from twin.programs.refusal import RefusedError

STARTS: Final = {3: 1, 4: -1, 13: 1, 14: -1}
EDGE_FEED: Final = {109: EdgeFeed.ALL_ARCS, 110: EdgeFeed.INNER_ARCS, 111: EdgeFeed.NONE}
HARMLESS: Final = frozenset({6, 90, 101, 102, 105, 106, 107, 108, 113, 115, 117, 118, 120, 129, 134, 135, 138, 141, 143})
HARMLESS_TOO: Final = frozenset({145, 148, 149})
"""They change no path: tool change by TOOL CALL, sister tools, handwheel, look-ahead of the compensation, and switches back."""
REFUSED: Final[Mapping[int, str]] = {
    92: "its datum is the machine builder's; write M91, or coordinates of the workpiece",
    94: "takes whole turns from rotary axes, which the twin does not; leave it out",
    97: "leaves out what does not fit at small steps of a contour, in a way of its own; a smaller tool does without",
    112: "puts curves between contour elements, which is not modelled; use cycle 32",
    114: "needs the kinematics of the rotary axes, which the twin does not have",
    116: "counts the feed of rotary axes in mm/min, which needs their radius",
    124: "leaves out points, in a way of its own; leave it out",
    128: "needs the kinematics of the rotary axes, which the twin does not have",
    130: "needs the tilted working plane, which the twin does not have",
    142: "clears modal program data, which is not modelled",
    144: "needs the kinematics of the rotary axes, which the twin does not have",
}
CODES: Final = (
    frozenset({0, 1, 2, 3, 4, 5, 8, 9, 13, 14, 19, 30, 89, 91, 98, 99, 103, 109, 110, 111, 126, 127, 136, 137, 140})
    | HARMLESS
    | HARMLESS_TOO
    | frozenset(REFUSED)
)
"""Every code with a meaning of its own; all others are the machine builder's."""


def before(state: State, functions: Sequence[MFunction]) -> None:
    """Do what acts at the beginning of a block. RefusedError for what is not run."""
    for function in functions:
        code = function.code
        if code in REFUSED and code not in state.settings.builder_m_codes:
            raise RefusedError(f"M{code}", REFUSED[code])
        if code not in CODES and code not in state.settings.builder_m_codes:
            raise RefusedError(
                f"M{code}", "is not known; if it is the machine builder's, [control] builder_m_codes passes it over"
            )
        if code in STARTS:
            spindle.turn(state, STARTS[code])
        if code in (8, 13, 14):
            spindle.coolant(state, True)
        if code == 103:
            limit_plunging(state, function)
        elif code in (109, 110, 111):
            state.edge_feed = EDGE_FEED[code]
        elif code in (126, 127):
            state.shortest_rotary = code == 126
        elif code in (136, 137):
            state.per_revolution = code == 136
            if state.per_revolution and state.feed_mm_min > 0.0:
                state.feed_per_rev_mm, state.feed_mm_min = state.feed_mm_min, 0.0


def limit_plunging(state: State, function: MFunction) -> None:
    """M103 F20: along the tool's axis at most 20 % of the feed; without F, no more."""
    given = function.words.get("F")
    state.plunge_factor = None
    if given is not None:
        factor = given(state.variables) / 100.0
        if factor <= 0.0:
            raise RefusedError("M103", "needs a share of the feed of more than 0 %")
        state.plunge_factor = factor if factor < 1.0 else None


def after(state: State, functions: Sequence[MFunction]) -> None:
    """Do what acts at the end of a block; the end of the program sets `flow.ended`."""
    for function in functions:
        code = function.code
        if code == 5:
            spindle.turn(state, 0)
        if code == 9:
            spindle.coolant(state, False)
        if code == 19:
            spindle.orient(state)
        if code == 0 or (code == 1 and state.settings.optional_stop):
            state.emit(ProgramStop(state.line, code == 1, state.program))
        if code in (2, 30):
            end(state, f"M{code}")


def end(state: State, text: str) -> None:
    """The program ends here. In a called program it may not: the control refuses M2 and M30 there."""
    if state.flow.in_called_program and text.startswith("M"):
        raise RefusedError(text, "cannot stand in a program that CALL PGM calls; END PGM returns from it")
    close(state)
    state.emit(ProgramEnd(state.line, state.program))


def close(state: State) -> None:
    """Put out what was kept back; nothing runs any more."""
    compensation.finish(state)
    if state.corner is not None:
        place = (state.corner.line, state.program)
        raise RefusedError(state.corner.text, "the program ends; a corner needs a move behind it", place)
    state.flow.ended = True
