"""Moves written short, so that a table of them can be checked by hand.

`rapid 10 0 5`, `line 10 0 5 F500`, `arc 10 0 5 about 5 0 sweep 180 F500`, `dwell 0.5`, `spindle 1200`, `tool 3`, …
"""

from collections.abc import Sequence

from twin.programs import Arc, Dwell, Linear, Move, Rapid, Settings, Spindle, SpindleOrient, ToolChange, ToolOffset
from twin.programs.canonical import Coolant, ProgramEnd, ProgramStop, Tolerance, ToolLength
from twin.programs.klartext.interpreter import interpret
from twin.programs.planes import PLANES

TOOL_5 = Settings(tool_offsets={1: ToolOffset(0.0, 5.0)})
"""A control with one tool of radius 5."""


def program(*blocks: str, unit: str = "MM") -> str:
    """The blocks between BEGIN PGM and END PGM; the first one is line 1."""
    return "\n".join([f"BEGIN PGM TEST {unit}", *blocks, f"END PGM TEST {unit}"])


def figure(value: float) -> str:
    return f"{round(value, 4) + 0.0:g}"


def short(move: Move) -> str:
    """One move."""
    if isinstance(move, Rapid):
        return " ".join(["rapid", *map(figure, move.end_mm)])
    if isinstance(move, Linear):
        tied = f" per {figure(move.feed_per_rev_mm)}" if move.feed_per_rev_mm is not None else ""
        return " ".join(["line", *map(figure, move.end_mm), f"F{figure(move.feed_mm_min)}{tied}"])
    if isinstance(move, Arc):
        first, second, _ = PLANES[move.plane]
        about = f"about {figure(move.centre_mm[first])} {figure(move.centre_mm[second])}"
        plane = "" if move.plane == 17 else f" G{move.plane}"
        turn = f"sweep {figure(move.sweep_rad * 180.0 / 3.141592653589793)}"
        return " ".join(["arc", *map(figure, move.end_mm), about, turn, f"F{figure(move.feed_mm_min)}{plane}"])
    if isinstance(move, Dwell):
        return f"dwell {figure(move.seconds)}"
    if isinstance(move, Spindle):
        return f"spindle {figure(move.rpm * move.direction)}"
    if isinstance(move, SpindleOrient):
        return "orient"
    if isinstance(move, ToolChange):
        return f"tool {move.tool}"
    if isinstance(move, ToolLength):
        return f"length {figure(move.length_mm)}"
    if isinstance(move, Coolant):
        return "coolant on" if move.on else "coolant off"
    if isinstance(move, ProgramStop):
        return "stop"
    if isinstance(move, Tolerance):
        return f"tolerance {move.contour_mm} {move.rotary_deg}"
    assert isinstance(move, ProgramEnd)
    return "end"


def moves_of(*blocks: str, settings: Settings | None = None, unit: str = "MM") -> list[str]:
    """The moves of the blocks, without the end of the program."""
    return list(map(short, interpret(program(*blocks, unit=unit), settings)))[:-1]


def all_of(moves: Sequence[Move]) -> list[str]:
    return list(map(short, moves))
