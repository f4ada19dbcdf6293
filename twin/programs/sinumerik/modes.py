"""One block of words, done in the order of a control: modes, speeds and tools, offsets, the motion, the stop."""

from typing import Final

from twin.programs.canonical import Coolant, Dwell, ProgramStop
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik import compensation, contour, corners, motion, smoothing, spindle, tool, transformations
from twin.programs.sinumerik.codes import ARC_CODES, M_CODES
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

ADDRESSES: Final = frozenset(
    {"I", "J", "K", "I1", "J1", "K1", "F", "S", "T", "D", "H", "P", "CR", "AR", "AP", "RP", "TURN", "CHF", "CHR", "RND", "RNDM"}
    | {"FRC", "FRCM", "ANG", "SPOS", "SPOSA", "ADIS", "ADISPOS", "CTOL", "OTOL", "OFFN", "DISC", "RPL", "LIMS", "SF", "FB"}
    | {"X1", "Y1", "Z1", "OVR", "OVRRAP", "ACC", "DITS", "DITE"}
)
SECONDS_MAX: Final = 99_999_999.0
FEED_MAX: Final = 1e9
HUNDRED: Final = ("OVR", "OVRRAP", "ACC")
PER_REVOLUTION: Final = frozenset({"G95", "G96", "G97"})
"""Feed modes in which F counts mm a revolution."""
ALIASES: Final = {"X1": 0, "Y1": 1, "Z1": 2}
"""Names of machine axes, for G74."""


def execute(state: State, words: Words) -> bool:
    """Run a block; calls and ends are left to the interpreter. Returns True where it moved."""
    check(state, words)
    pending, started = state.corner, state.position
    set_modes(state, words)
    smoothing.modes(state, words)
    corners.modes(state, words)
    tool.select(state, words)
    spindle.command(state, words)
    for code in words.m:
        if code in (7, 8, 9):
            state.emit(Coolant(state.line, code != 9, state.program))
    if "work" in words.codes:
        compensation.refuse_inside(state, words.written["work"])
        transformations.settable(state, words)
    if "OFFN" in words.values:
        state.allowance_mm = words.number("OFFN") * state.unit_mm
    if "frame" in words.codes:
        transformations.frame(state, words)
    if "cutter" in words.codes:
        compensation.switch(state, words)
    go(state, words)
    state.block_feed = None
    for code in words.m:
        if code == 0 or (code == 1 and state.settings.optional_stop):
            state.emit(ProgramStop(state.line, code == 1, state.program))
    if pending is not None and state.corner is pending and (state.position is not started or words.m):
        corners.abandoned(state)
    return state.position is not started


def check(state: State, words: Words) -> None:
    """RefusedError for words that have no meaning here."""
    axes = {axis.upper() for axis in state.axes}
    for name, given in words.values.items():
        if name in ADDRESSES or name in axes:
            if name in HUNDRED and given.number != 100.0:
                raise RefusedError(given.text, "only 100 % is read")
            continue
        if name in ("A", "B", "C"):
            raise RefusedError(given.text, f"the machine has no axis {name}; it has {', '.join(state.axes)}")
        raise RefusedError(given.text, f"{name} has no meaning here; axes are {', '.join(state.axes)}")
    for code in words.m:
        if code not in M_CODES and code not in state.settings.builder_m_codes:
            way = "if it is the machine builder's, [control] builder_m_codes passes it over"
            raise RefusedError(f"M{code}", f"is not known; {way}")
    if words.codes.get("dialect") == "G291":
        raise RefusedError(
            words.written["dialect"], "the ISO dialect is a language of its own; give that program by itself, as FANUC"
        )
    if "DISC" in words.values and words.number("DISC") != 0.0:
        raise RefusedError(words.values["DISC"].text, "only DISC=0, the arc, is read; write G451 for sharp corners")


def set_modes(state: State, words: Words) -> None:
    codes, modal = words.codes, state.modal
    for group in ("units", "distance", "contour_feed"):
        if group in codes:
            modal[group] = codes[group]
    for group in ("approach", "corner", "plane"):
        if group in codes and codes[group] != modal[group]:
            compensation.refuse_inside(state, words.written[group])
            modal[group] = codes[group]
            if group == "plane":
                if state.pending_angle is not None:
                    raise RefusedError(words.written[group], "cannot stand between the two lines of an angle")
                corners.abandoned(state)
                state.tangent, state.pole.centre = None, (0.0, 0.0)
                state.pole.radius_mm = state.pole.angle_deg = None
    if "motion" in codes:
        modal["motion"] = codes["motion"]
    if "feed" in codes and codes["feed"] != modal["feed"]:
        if (codes["feed"] in PER_REVOLUTION) != (modal["feed"] in PER_REVOLUTION) or "G93" in (codes["feed"], modal["feed"]):
            state.feed_word = 0.0
        modal["feed"] = codes["feed"]
    if "FB" in words.values:
        state.block_feed = feed_of(state, words, "FB")
    if "F" in words.values and codes.get("once") != "G4":
        state.feed_word = feed_of(state, words, "F")


def feed_of(state: State, words: Words, name: str) -> float:
    """F in mm/min (G94), mm a revolution (G95), or 1/min (G93)."""
    value = words.number(name)
    if not 0.0 <= value <= FEED_MAX:
        raise RefusedError(words.values[name].text, "a feed is more than 0")
    return value if state.modal["feed"] == "G93" else value * state.feed_unit_mm


def go(state: State, words: Words) -> None:
    """The motion or the pause of the block, if it has one."""
    once = words.codes.get("once")
    if once == "G4":
        dwell(state, words)
        return
    if "frame" in words.codes:
        return
    stray = next((name for name in ALIASES if name in words.values), None)
    if once == "G74":
        compensation.refuse_inside(state, "G74")
        reference(state, words)
        return
    if stray is not None or once == "G75":
        text = words.values[stray].text if stray is not None else "G75"
        raise RefusedError(text, "fixed points and machine axes are read in G74 only; write SUPA G0 X Y Z")
    if "suppress" in words.codes:
        suppressed(state, words)
        return
    if moves(state, words):
        if once == "G63":
            contour.tap(state, words)
        else:
            contour.move(state, words)
        return
    corner = next(
        (name for name in (*corners.NAMES, "I", "J", "K", "CR", "AR", "TURN", "I1", "J1", "K1") if name in words.values), None
    )
    if corner is not None:
        raise RefusedError(words.values[corner].text, "stands in a block that moves; write the axis words beside it")


def moves(state: State, words: Words) -> bool:
    """Return True for a block with a place to go to: axis words, polar words, an angle, or an arc's centre."""
    if motion.named_axes(state, words) or any(name in words.values for name in ("AP", "RP", "ANG")):
        return True
    return state.modal["motion"] in ARC_CODES and any(
        letter in words.values for letter in ("I", "J", "K", "CR", "AR", "I1", "J1", "K1")
    )


def suppressed(state: State, words: Words) -> None:
    """G53, G153, SUPA: this block without the settable offset and the frame, G153 and SUPA without the basic offset too.

    The tool length stays; D0 takes it out.
    """
    text = words.written["suppress"]
    compensation.refuse_inside(state, text)
    state.frames.suppress = 1 if words.codes["suppress"] == "G53" else 2
    try:
        if moves(state, words):
            contour.move(state, words)
    finally:
        state.frames.suppress = 0


def dwell(state: State, words: Words) -> None:
    """G4 F in s, S in revolutions of the spindle."""
    if ("F" in words.values) == ("S" in words.values):
        raise RefusedError("G4", "needs its time: F in s, or S in revolutions")
    if "F" in words.values:
        seconds, text = words.number("F"), words.values["F"].text
    else:
        text = words.values["S"].text
        if state.rpm <= 0.0:
            raise RefusedError(text, "a pause in revolutions needs a speed; write S in a block before")
        seconds = words.number("S") * 60.0 / state.rpm
    if not 0.0 <= seconds <= SECONDS_MAX:
        raise RefusedError(text, "a pause is a time of at least 0")
    state.emit(Dwell(state.line, seconds, state.program))


def reference(state: State, words: Words) -> None:
    """G74 X1=0 Y1=0: rapid to the reference point, in the axes that are named."""
    places = state.settings.references_mm
    place = places[0] if places else (0.0,) * len(state.axes)
    named = set(motion.named_axes(state, words)) | {axis for name, axis in ALIASES.items() if name in words.values}
    if not named:
        raise RefusedError("G74", "needs its axes, such as G74 X1=0 Y1=0 Z1=0")
    if motion.Z in named:
        state.take_length()
    moved = list(state.position)
    for axis in named:
        moved[axis] = place[axis]
    motion.rapid(state, tuple(moved))
