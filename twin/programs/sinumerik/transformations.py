"""TRANS, ROT, SCALE, MIRROR and their additive forms, the settable offsets G54 to G599, and G25 and G26."""

from typing import Final

from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.compensation import refuse_inside
from twin.programs.sinumerik.frames import IDENTITY, SCALE_MAX, Matrix, diagonal, rotation, times
from twin.programs.sinumerik.polar import set_pole
from twin.programs.sinumerik.spindle import limit
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

SCALE_MIN: Final = 1.0 / SCALE_MAX


def frame(state: State, words: Words) -> None:
    """The frame instruction, pole or limit of a block, which has its axis words."""
    code, text = words.codes["frame"], words.written["frame"]
    if code in ("G110", "G111", "G112"):
        set_pole(state, words)
        return
    if code in ("G25", "G26"):
        # Working areas bound the machine, not the path.
        if "S" in words.values and code == "G26":
            limit(state, words.number("S"), words.values["S"].text)
        return
    refuse_inside(state, text)
    if state.corner is not None or state.pending_angle is not None:
        raise RefusedError(text, "cannot stand between the two blocks of a corner or an angle")
    zero = (0.0,) * len(state.axes)
    if not code.startswith("A"):
        state.frames.reset()
    name = code.removeprefix("A")
    if name == "TRANS":
        shift = [0.0] * len(state.axes)
        for at, axis in enumerate(state.axes):
            if axis.upper() in words.values:
                shift[at] = words.number(axis.upper()) * (state.unit_mm if at < 3 else 1.0)
        state.frames.add(IDENTITY, tuple(shift))
    elif name == "ROT":
        state.frames.add(rotation_of(state, words), zero)
    else:
        state.frames.add(diagonal(factors(state, words, name)), zero)
    state.pole.radius_mm = state.pole.angle_deg = None


def rotation_of(state: State, words: Words) -> Matrix:
    """RPL= turns about the normal of the plane; X, Y, Z turn about Z, then the new Y, then the new X."""
    axes = [axis for axis in state.axes[:3] if axis.upper() in words.values]
    if "RPL" in words.values:
        if axes:
            raise RefusedError(words.values["RPL"].text, "cannot stand beside angles about X, Y, Z")
        return rotation(PLANES[state.plane][2], words.number("RPL"))
    matrix = IDENTITY
    for axis in (2, 1, 0):
        name = state.axes[axis].upper()
        if name in words.values:
            matrix = times(matrix, rotation(axis, words.number(name)))
    return matrix


def factors(state: State, words: Words, name: str) -> list[float]:
    """The figures of SCALE, or -1 for each axis that MIRROR names."""
    found = [1.0, 1.0, 1.0]
    for at, axis in enumerate(state.axes[:3]):
        if axis.upper() in words.values:
            found[at] = -1.0 if name == "MIRROR" else words.number(axis.upper())
            if name == "SCALE" and not SCALE_MIN <= found[at] <= SCALE_MAX:
                raise RefusedError(words.values[axis.upper()].text, f"a scale is from {SCALE_MIN:g} to {SCALE_MAX:g}")
    return found


def settable(state: State, words: Words) -> None:
    """G500, G54 to G57, G505 to G599."""
    state.modal["work"] = words.codes["work"]
    state.frames.settable_name = words.codes["work"]
