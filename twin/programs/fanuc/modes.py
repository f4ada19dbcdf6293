"""One block of words, done in the order of a control: modes, speeds and tools, offsets, the motion, the stop."""

from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.canonical import Coolant, Dwell, ExactStop, LookAhead, ProgramStop, ToolChange
from twin.programs.fanuc import compensation, cycles, motion, offsets, spindle
from twin.programs.fanuc.block import Words
from twin.programs.fanuc.codes import M_CODES
from twin.programs.fanuc.state import State
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import DwellUnit, IntegerWords

TOOL_MAX: Final = 99_999_999
SECONDS_MAX: Final = 99_999_999.0
LETTERS: Final = frozenset("XYZABCIJKRFSTHDPQL")
FEED_MAX: Final = 1e9


def execute(state: State, words: Words) -> None:
    """Run a block; calls and ends are left to the interpreter. RefusedError names the word at fault."""
    pending = state.corner
    for letter in words.values:
        if letter not in LETTERS and not (letter == "U" and "dwell" in words.codes):
            raise RefusedError(words.texts[letter], f"{letter} has no meaning here; axes are {', '.join(state.axes)}")
    for code in words.m:
        if code not in M_CODES and code not in state.settings.builder_m_codes:
            raise RefusedError(
                f"M{code}", "is not known; if it is the machine builder's, [control] builder_m_codes passes it over"
            )
    set_modes(state, words)
    spindle_and_tool(state, words)
    if "dwell" in words.codes:
        dwell(state, words)
    switches(state, words)
    for group, handler in HANDLERS.items():
        if group in words.codes:
            handler(state, words)
    offsets.select_numbers(state, words)
    go(state, words)
    stops(state, words)
    if pending is not None and state.corner is pending and "dwell" not in words.codes:
        raise RefusedError(pending.text, "the block after a corner has to be a cut, G1, G2 or G3 (one dwell may stand between)")


def set_modes(state: State, words: Words) -> None:
    codes, modal = words.codes, state.modal
    if "units" in codes:
        modal.units = codes["units"]
    if "distance" in codes:
        modal.distance = codes["distance"]
    if "retract" in codes:
        modal.retract = codes["retract"]
    if "plane" in codes and codes["plane"] != modal.plane:
        if compensation.in_force(state) or state.coordinates.rotation is not None or modal.polar == 160:
            raise RefusedError(words.written["plane"], "the plane cannot change in G41, G42, G68 or G16; cancel them first")
        modal.plane = codes["plane"]
    if "feed" in codes and codes["feed"] != modal.feed:
        modal.feed, state.feed_word = codes["feed"], 0.0
    if "F" in words.values:
        set_feed(state, words)
    motion_and_cycle(state, words)


def set_feed(state: State, words: Words) -> None:
    """F: mm/min or inch/min in G94, mm or inch a revolution in G95, 1/min in G93."""
    value, text = words.values["F"], words.texts["F"]
    mode = state.modal.feed
    if "F" in words.integers and state.settings.integer_words is IntegerWords.INCREMENTS and mode != 930:
        inch = state.modal.units == 200
        value *= (0.0001 if inch else 0.01) if mode == 950 else (0.01 if inch else 1.0)
    if not 0.0 <= value <= FEED_MAX:
        raise RefusedError(text, "a feed is more than 0")
    state.feed_word = value if mode == 930 else value * state.unit_mm


def motion_and_cycle(state: State, words: Words) -> None:
    """A code of the motion group ends a cycle, unless the cycle's code comes after it in the block."""
    codes, modal = words.codes, state.modal
    if "motion" in codes:
        modal.motion = codes["motion"]
        if "cycle" not in codes or words.order.index("cycle") < words.order.index("motion"):
            if modal.cycle != 800:
                modal.cycle, state.cycle, state.rigid = 800, None, False
            return
    if "cycle" in codes:
        modal.cycle = codes["cycle"]
        if modal.cycle == 800:
            state.cycle, state.rigid = None, False


def spindle_and_tool(state: State, words: Words) -> None:
    """S, T, M6, the spindle and the coolant."""
    codes, values = words.codes, words.values
    before = state.rpm
    if "speed" in codes:
        change_speed_mode(state, words)
    clamps = codes.get("once") == 920 and not motion.axis_letters(state, words)
    if "S" in values and not clamps:
        spindle.set_speed(state, words.texts["S"], values["S"])
    if "T" in values:
        state.preselected = words.integer("T", 0, TOOL_MAX)
    if 6 in words.m:
        if state.preselected is None:
            raise RefusedError("M6", "no tool was chosen; write T")
        state.tool = state.preselected
        state.emit(ToolChange(state.line, state.tool, state.program))
    said = False
    for code in words.m:
        said = spindle.m_code(state, code) or said
        if code in (7, 8, 9):
            state.emit(Coolant(state.line, code != 9, state.program))
    if not said and state.spindle_direction and state.modal.speed == 970 and state.rpm != before:
        spindle.turn(state, state.spindle_direction)


def change_speed_mode(state: State, words: Words) -> None:
    modal, code = state.modal, words.codes["speed"]
    if code == 960 and "P" in words.values:
        state.spindle_axis = words.integer("P", 0, len(state.axes)) - 1
        state.spindle_axis = max(state.spindle_axis, 0)
    if code == 960 and modal.speed != 960 and "S" not in words.values:
        raise RefusedError(words.written["speed"], "needs the surface speed; write S")
    modal.speed = code


def dwell_seconds(state: State, words: Words, letter: str) -> float:
    """P in ms (or s, `Settings.dwell_unit`), X and U in s."""
    value = words.values[letter]
    if letter == "P":
        seconds = value if state.settings.dwell_unit is DwellUnit.SECONDS else value / 1000.0
    else:
        fine = letter in words.integers and state.settings.integer_words is IntegerWords.INCREMENTS
        seconds = value * 0.001 if fine else value
    if not 0.0 <= seconds <= SECONDS_MAX:
        raise RefusedError(words.texts[letter], "a dwell is a time of at least 0")
    return seconds


def dwell(state: State, words: Words) -> None:
    letter = next((letter for letter in "PXU" if letter in words.values), None)
    if letter is None or sum(other in words.values for other in "PXU") > 1:
        raise RefusedError(words.written["dwell"], "needs its time: P in ms, or X or U in s")
    state.emit(Dwell(state.line, dwell_seconds(state, words, letter), state.program))


def switches(state: State, words: Words) -> None:
    """G61, G64, G5.1 Q, G8 P."""
    codes = words.codes
    if "path" in codes and codes["path"] != state.modal.path:
        state.modal.path = codes["path"]
        state.emit(ExactStop(state.line, codes["path"] == 610, state.program))
    for group, letter in (("smooth", "Q"), ("ahead", "P")):
        if group in codes:
            if letter not in words.values:
                raise RefusedError(words.written[group], f"needs {letter}1 (on) or {letter}0 (off)")
            state.emit(LookAhead(state.line, words.integer(letter, 0, 1) == 1, state.program))


def polar(state: State, words: Words) -> None:
    state.modal.polar, state.pole = words.codes["polar"], None


def reference(state: State, words: Words) -> None:
    """G28, G30: by way of an intermediate point, in the named axes only."""
    code = words.codes["once"]
    named = motion.axis_letters(state, words)
    if not named:
        raise RefusedError(words.written["once"], "needs an intermediate point, such as G91 G28 Z0")
    number = 1
    if code == 300:
        number = words.integer("P", 2, 4) if "P" in words.values else 2
    places = state.settings.references_mm
    place = places[number - 1] if number <= len(places) else (0.0,) * len(state.axes)
    motion.rapid(state, motion.target(state, words, named))
    moved = list(state.position)
    for axis in named:
        moved[axis] = place[axis]
    motion.rapid(state, tuple(moved))


def once(state: State, words: Words) -> None:
    """The codes that are not modal and use axis words for something else than a place to go to."""
    code = words.codes["once"]
    if code in (280, 300):
        refuse_in_compensation(state, words.written["once"])
        reference(state, words)
    elif code in (100, 520, 920, 921):
        offsets.ONCE[code](state, words)


def refuse_in_compensation(state: State, text: str) -> None:
    if compensation.in_force(state):
        raise RefusedError(text, "cannot stand between G41 or G42 and G40; cancel with G40 and a move first")


HANDLERS: Final[Mapping[str, Callable[[State, Words], None]]] = {
    "work": offsets.work,
    "length": offsets.tool_length,
    "polar": polar,
    "cutter": compensation.switch,
    "scaling": offsets.scaling,
    "rotation": offsets.rotation,
    "once": once,
}
"""Handlers of the groups whose codes do more than set a mode, in the order in which they act."""


def go(state: State, words: Words) -> None:
    """The motion of the block, if its axis words are a place to go to."""
    codes, values = words.codes, words.values
    if "once" in codes or "dwell" in codes or codes.get("scaling") == 510 or codes.get("rotation") == 680:
        return
    if codes.get("macro") == 660:
        return
    named = motion.axis_letters(state, words)
    if "machine" in codes:
        refuse_in_compensation(state, words.written["machine"])
        machine_position(state, words, named)
        return
    if state.modal.cycle != 800 and "skip" not in codes:
        if named or "R" in values or "cycle" in codes:
            refuse_in_compensation(state, words.written.get("cycle", ""))
            cycles.run(state, words, named)
        return
    arc_mode = state.modal.motion in (20, 30)
    first, second, _ = PLANES[state.plane]
    centred = arc_mode and any("IJK"[axis] in values for axis in (first, second))
    if named or centred or (arc_mode and "R" in values):
        if not arc_mode or "skip" in codes:
            stray = next((letter for letter in "RIJK" if letter in values), None)
            if stray is not None:
                way = "; a rounding is ,R" if stray == "R" else ""
                raise RefusedError(words.texts[stray], f"has no meaning in a straight move{way}")
        motion.move(state, words, named)
    elif words.corner is not None:
        raise RefusedError("," + words.corner[0], "stands in a block that moves; write the axis words beside it")


def machine_position(state: State, words: Words, named: list[int]) -> None:
    """G53: rapid in machine coordinates, whatever the offsets."""
    if state.modal.distance == 910:
        raise RefusedError(words.written["machine"], "works with G90 only")
    if motion.Z in named:
        state.take_length()
    moved = list(state.position)
    for axis in named:
        moved[axis] = state.length(words, state.axes[axis].upper())
    if named:
        motion.rapid(state, tuple(moved))


def stops(state: State, words: Words) -> None:
    """M0, and M1 where its switch is on."""
    for code in words.m:
        if code == 0 or (code == 1 and state.settings.optional_stop):
            state.emit(ProgramStop(state.line, code == 1, state.program))
