"""G10, G43, G44, G49, G50, G51, G52, G54 to G59, G54.1, G68, G69, G92: everything that moves or turns the coordinates."""

from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.fanuc.block import Words
from twin.programs.fanuc.compensation import in_force
from twin.programs.fanuc.coordinates import EXTENDED_MAX, Scaling
from twin.programs.fanuc.coordinates import rotation as rotated
from twin.programs.fanuc.motion import axis_letters
from twin.programs.fanuc.state import State
from twin.programs.fanuc.tool_table import OFFSET_NUMBER_MAX, change_tool, set_length
from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.settings import OffsetLookup

TABLE: Final = {10: "length_mm", 11: "length_wear_mm", 12: "radius_mm", 13: "radius_wear_mm"}
SCALE_MAX: Final = 1e5


def work(state: State, words: Words) -> None:
    """G54 … G59, G54.1 P1 … P48."""
    code = words.codes["work"]
    if code == 541:
        if "P" not in words.values:
            raise RefusedError(words.written["work"], f"needs P1 to P{EXTENDED_MAX}")
        name = f"G54.1 P{words.integer('P', 1, EXTENDED_MAX)}"
    else:
        name = f"G{code // 10}"
    state.modal.work = code
    state.coordinates.work_name = name
    state.coordinates.refresh()


def tool_length(state: State, words: Words) -> None:
    """G43, G44, G49. It moves nothing by itself: the next move of Z contains it."""
    if "H" in words.values:
        state.length_number = words.integer("H", 0, OFFSET_NUMBER_MAX)
    elif state.settings.offset_lookup is OffsetLookup.TOOL:
        state.length_number = None
    state.modal.length = words.codes["length"]
    set_length(state, words.texts.get("H", words.written["length"]))


def select_numbers(state: State, words: Words) -> None:
    """H and D outside a block of G43 or G41."""
    if "H" in words.values and "length" not in words.codes:
        state.length_number = words.integer("H", 0, OFFSET_NUMBER_MAX)
        if state.modal.length != 490:
            set_length(state, words.texts["H"])
    if "D" in words.values and "cutter" not in words.codes:
        number = words.integer("D", 0, OFFSET_NUMBER_MAX)
        if state.compensation is not None and number != state.radius_number:
            raise RefusedError(words.texts["D"], "the radius cannot change in G41 or G42; cancel with G40 first")
        state.radius_number = number


def scaling(state: State, words: Words) -> None:
    """G51 X Y Z with P, or with I, J, K of each axis; G50."""
    coordinates = state.coordinates
    if in_force(state):
        raise RefusedError(words.written["scaling"], "cannot stand between G41 or G42 and G40")
    state.modal.scaling = words.codes["scaling"]
    if state.modal.scaling == 500:
        coordinates.scaling = None
        coordinates.refresh()
        return
    centre = list(coordinates.to_program(state.position))
    for axis in axis_letters(state, words):
        centre[axis] = state.length(words, state.axes[axis].upper())
    factors = [1.0] * len(state.axes)
    for axis, letter in enumerate("IJK"):
        if letter in words.values or "P" in words.values:
            factors[axis] = factor(state, words, letter if letter in words.values else "P")
    coordinates.scaling = Scaling(tuple(centre), tuple(factors))
    coordinates.refresh()


def factor(state: State, words: Words, letter: str) -> float:
    """A magnification: with a point as it stands, without in units of `Settings.scale_unit` (P2000 = 2 times)."""
    value = words.values[letter]
    value = value * state.settings.scale_unit if letter in words.integers else value
    if not 1.0 / SCALE_MAX <= abs(value) <= SCALE_MAX:
        raise RefusedError(words.texts[letter], "a magnification cannot be 0, nor beyond 100 000 times")
    return value


def rotation(state: State, words: Words) -> None:
    """G68 with the centre in the plane and R in degrees; G69. The centre is a point of the program, so scaling moves it."""
    coordinates = state.coordinates
    if in_force(state):
        raise RefusedError(words.written["rotation"], "cannot stand between G41 or G42 and G40")
    state.modal.rotation = words.codes["rotation"]
    first, second, _ = PLANES[state.plane]
    centre = list(coordinates.to_program(state.position))
    coordinates.rotation = None
    if state.modal.rotation == 680:
        if "R" not in words.values:
            raise RefusedError(words.written["rotation"], "needs the angle; write R in degrees")
        for axis in axis_letters(state, words):
            centre[axis] = state.length(words, state.axes[axis].upper())
        scaled = [a - b for a, b in zip(coordinates.to_machine(tuple(centre)), coordinates.offset, strict=True)]
        coordinates.rotation = rotated(state.plane, (scaled[first], scaled[second]), state.angle(words, "R"))
    coordinates.refresh()


def local(state: State, words: Words) -> None:
    """G52: a shift of all work coordinate systems; G52 X0 Y0 Z0 takes it back."""
    for axis in axis_letters(state, words):
        state.coordinates.local[axis] = state.length(words, state.axes[axis].upper())
    state.coordinates.refresh()


def declare(state: State, words: Words) -> None:
    """G92: the tool is here, by declaration; all work coordinate systems shift. G92 S is the clamp of G96."""
    coordinates = state.coordinates
    if not coordinates.plain:
        raise RefusedError(words.written["once"], "cannot stand in G51 or G68; cancel them first")
    named = axis_letters(state, words)
    if not named and "S" in words.values:
        state.speed_max = words.values["S"]
    for axis in named:
        coordinates.local[axis] = 0.0
    coordinates.refresh()
    here = coordinates.to_program(state.position)
    for axis in named:
        coordinates.g92[axis] += here[axis] - state.length(words, state.axes[axis].upper())
    coordinates.refresh()


def preset(state: State, words: Words) -> None:
    """G92.1: takes back G92 and G52 in the named axes; without any, in all."""
    for axis in axis_letters(state, words) or range(len(state.axes)):
        state.coordinates.g92[axis] = state.coordinates.local[axis] = 0.0
    state.coordinates.refresh()


def data(state: State, words: Words) -> None:
    """G10 L2 P0-P6, L20 P1-P48: work offsets; L10-L13 P R: the offset table. G91 adds."""
    for letter in ("L", "P"):
        if letter not in words.values:
            raise RefusedError(words.written["once"], f"needs {letter}: G10 L2 P1 X…, G10 L20 P1 X…, G10 L10 P1 R…")
    kind = words.integer("L", 0, 99)
    if kind in TABLE:
        enter_tool(state, words, TABLE[kind])
        return
    if kind not in (2, 20):
        raise RefusedError(words.texts["L"], "is not known; L2 and L20 set work offsets, L10 to L13 tool offsets")
    if kind == 2:
        number = words.integer("P", 0, 6)
        table = state.coordinates.offsets(f"G{53 + number}") if number else state.coordinates.external
    else:
        table = state.coordinates.offsets(f"G54.1 P{words.integer('P', 1, EXTENDED_MAX)}")
    for axis in axis_letters(state, words):
        value = state.length(words, state.axes[axis].upper())
        table[axis] = value if state.modal.distance == 900 else table[axis] + value
    state.coordinates.refresh()


def enter_tool(state: State, words: Words, column: str) -> None:
    number = words.integer("P", 1, OFFSET_NUMBER_MAX)
    if "R" not in words.values:
        raise RefusedError(words.written["once"], "needs the offset; write R")
    value = state.length(words, "R")
    change_tool(state, number, column, value, state.modal.distance == 910)


ONCE: Final[Mapping[int, Callable[[State, Words], None]]] = {100: data, 520: local, 920: declare, 921: preset}
