"""Cycles 7, 8, 10, 11, 26 and 247, and TRANS DATUM: datum shift, mirror image, rotation, scaling, preset.

They act where they are defined. Cycle 7 changes the axes that it names; 8, 10, 11 and 26 replace what was in force.
"""

import math
import re
from typing import Final

from twin.programs.klartext import compensation
from twin.programs.klartext.block import parse
from twin.programs.klartext.cycles.definition import Definition
from twin.programs.klartext.motion import CARTESIAN, axis_of, coordinates
from twin.programs.klartext.numbers import VALUE, value
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

LINE_OF_TABLE: Final = re.compile(rf"[ \t]*+#[ \t]*+({VALUE})[ \t]*+")
ROTATION: Final = re.compile(rf"[ \t]*+(I?+)ROT[ \t]*+({VALUE})[ \t]*+")
SCALE: Final = re.compile(rf"[ \t]*+SCL[ \t]*+({VALUE})[ \t]*+")
MIRRORED: Final = re.compile(r"[XYZABC \t,]*+")
SCALE_MAX: Final = 99.999999
SCALE_MIN: Final = 0.000001


def changes(state: State, text: str) -> None:
    """RefusedError where the coordinates cannot change."""
    compensation.refuse(state, text)
    state.take_length()


def datum_shift(state: State, source: Source, begin: int) -> None:
    """7.1 X+60 …, 7.1 #5: from the datum table."""
    changes(state, "CYCL DEF 7")
    row = LINE_OF_TABLE.fullmatch(source.body, begin)
    if row is not None:
        number = int(value(row.group(1), row.group(1))(state.variables))
        name = f"datum {number}"
        if name not in state.settings.work_offsets_mm:
            raise RefusedError(f"#{number}", f"the datum table has no such line; [control] work_offsets_mm sets {name!r}")
        state.frame.shift = list(state.settings.work_offsets_mm[name])
    else:
        block = parse(source, begin, CARTESIAN)
        for axis, (given, incremental) in coordinates(state, block).items():
            state.frame.shift[axis] = state.frame.shift[axis] + given if incremental else given
    state.frame.refresh()


def trans_datum(state: State, source: Source, begin: int) -> None:
    """TRANS DATUM AXIS X+10, TRANS DATUM TABLE TABLINE5, TRANS DATUM RESET."""
    changes(state, "TRANS DATUM")
    rest = source.body[begin:].strip()
    if rest == "RESET":
        state.frame.shift = [0.0] * len(state.axes)
        state.frame.refresh()
    elif rest.startswith("AXIS"):
        datum_shift(state, source, source.body.index("AXIS", begin) + 4)
    else:
        raise RefusedError("TRANS DATUM", "is read with AXIS or RESET; the datum table is #n of cycle 7")


def mirror_image(state: State, source: Source, begin: int) -> None:
    """8.1 X Y; without an axis the mirror is off."""
    changes(state, "CYCL DEF 8")
    rest = source.body[begin:]
    if MIRRORED.fullmatch(rest) is None:
        raise RefusedError(source.written[begin:].strip()[:24], "here stand the axes of the mirror image")
    state.frame.mirrored = frozenset(axis_of(state, letter, letter) for letter in rest if letter.isalpha())
    state.frame.refresh()


def rotation(state: State, source: Source, begin: int) -> None:
    """10.1 ROT+35, ROT IROT+45: in the working plane about the datum; ROT+0 is off."""
    changes(state, "CYCL DEF 10")
    match = ROTATION.fullmatch(source.body, begin)
    if match is None:
        raise RefusedError(source.written[begin:].strip()[:24], "here stands the angle; write ROT+30")
    angle = value(match.group(2), match.group(2))(state.variables)
    angle += state.frame.angle_deg if match.group(1) else 0.0
    if not math.isfinite(angle):
        raise RefusedError("ROT", "the angle is too large")
    state.frame.angle_deg, state.frame.plane = math.fmod(angle, 360.0), state.plane
    state.frame.refresh()


def scaling(state: State, source: Source, begin: int) -> None:
    """11.1 SCL 0.75: all three axes about the datum; SCL 1 is off."""
    changes(state, "CYCL DEF 11")
    match = SCALE.fullmatch(source.body, begin)
    if match is None:
        raise RefusedError(source.written[begin:].strip()[:24], "here stands the factor; write SCL 0.99")
    factor = checked_factor(value(match.group(1), match.group(1))(state.variables), "SCL")
    scale(state, [factor] * 3, [0.0] * 3)


def axis_scaling(state: State, source: Source, begin: int) -> None:
    """26.1 X1.4 Y0.6 CCX+15 CCY+20: a factor an axis about a centre."""
    changes(state, "CYCL DEF 26")
    block = parse(source, begin, frozenset({"X", "Y", "Z", "CCX", "CCY", "CCZ"}))
    factors, centre = [1.0] * 3, [0.0] * 3
    for axis, letter in enumerate("XYZ"):
        given, about = block.value(state.variables, letter), block.value(state.variables, f"CC{letter}")
        factors[axis] = 1.0 if given is None else checked_factor(given, block.texts[letter])
        centre[axis] = (about or 0.0) * state.unit_mm
    scale(state, factors, centre)


def checked_factor(factor: float, text: str) -> float:
    if not SCALE_MIN <= factor <= SCALE_MAX:
        raise RefusedError(text, f"a scaling factor is from {SCALE_MIN:g} to {SCALE_MAX:g}")
    return factor


def scale(state: State, factors: list[float], centre: list[float]) -> None:
    rotary = len(state.axes) - 3
    state.frame.factors, state.frame.centre = factors + [1.0] * rotary, centre + [0.0] * rotary
    state.frame.refresh()


def preset(state: State, cycle: Definition) -> None:
    """247: Q339 is the line of the preset table; a datum shift, mirror, rotation and scaling end."""
    changes(state, cycle.text)
    frame, axes = state.frame, len(state.axes)
    frame.shift, frame.mirrored, frame.angle_deg = [0.0] * axes, frozenset(), 0.0
    frame.factors, frame.centre = [1.0] * axes, [0.0] * axes
    frame.set_preset(cycle.number_of(339, 0, 9999), "Q339")
