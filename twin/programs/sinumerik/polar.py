"""Polar coordinates: AP= and RP= about the pole of G110, G111 or G112 ("Fundamentals", chapter "Travel commands with polar
coordinates")."""

import math

from twin.programs.planes import PLANES
from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.state import State
from twin.programs.sinumerik.words import Words

Point = tuple[float, float]


def polar_target(state: State, words: Words, now: Point) -> Point:
    """Return where AP and RP go, in program coordinates of the plane; what is left out stays as it was, or as the tool stands."""
    first, second, _ = PLANES[state.plane]
    stray = next((words.values[name] for at in (first, second) if (name := state.axes[at].upper()) in words.values), None)
    if stray is not None:
        raise RefusedError(stray.text, "cannot stand beside AP and RP, which say where both axes of the plane go")
    pole = state.pole
    away = (now[0] - pole.centre[0], now[1] - pole.centre[1])
    radius = pole.radius_mm if pole.radius_mm is not None else math.hypot(*away)
    angle = pole.angle_deg if pole.angle_deg is not None else math.degrees(math.atan2(away[1], away[0]))
    if "RP" in words.values:
        given = words.values["RP"]
        value = given.number * state.unit_mm
        radius = radius + value if given.mode == "IC" else value
    if "AP" in words.values:
        given = words.values["AP"]
        angle = angle + given.number if given.mode == "IC" else given.number
    if radius < 0.0:
        raise RefusedError("RP", f"is {radius:g} mm; a polar radius is at least 0")
    pole.radius_mm, pole.angle_deg = radius, angle
    return pole.centre[0] + radius * math.cos(math.radians(angle)), pole.centre[1] + radius * math.sin(math.radians(angle))


def set_pole(state: State, words: Words) -> None:
    """G110: from the last place of the tool; G111: from the zero of the workpiece; G112: from the last pole."""
    code = words.codes["frame"]
    first, second, normal = PLANES[state.plane]
    out = state.axes[normal].upper()
    if out in words.values:
        raise RefusedError(words.values[out].text, f"a pole lies in the plane G{state.plane}")
    program = state.frames.to_program(state.position)
    origin = {"G110": (program[first], program[second]), "G111": (0.0, 0.0), "G112": state.pole.centre}[code]
    if "AP" in words.values or "RP" in words.values:
        if "AP" not in words.values or "RP" not in words.values:
            raise RefusedError(words.written["frame"], "needs both AP and RP, or the axes of the plane")
        radius, angle = words.number("RP") * state.unit_mm, math.radians(words.number("AP"))
        shift = (radius * math.cos(angle), radius * math.sin(angle))
    else:
        names = [state.axes[at].upper() for at in (first, second)]
        figures = [words.number(name) * state.unit_mm if name in words.values else 0.0 for name in names]
        shift = (figures[0], figures[1])
    state.pole.centre = (origin[0] + shift[0], origin[1] + shift[1])
    state.pole.radius_mm = state.pole.angle_deg = None
