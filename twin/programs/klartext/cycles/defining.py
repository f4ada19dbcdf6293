"""CYCL DEF: which cycle a definition is, and what it does when it is read."""

import math
import re
from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.klartext import compensation
from twin.programs.klartext.cycles import coordinates, patterns, special
from twin.programs.klartext.cycles.definition import Definition, parameters
from twin.programs.klartext.cycles.running import MACHINING, Cycle
from twin.programs.klartext.numbers import Expression
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

HEAD: Final = re.compile(r"CYCL DEF[ \t]++([0-9]++)(?:\.([0-9]++))?+(?![0-9.])")
Part = Callable[[State, Source, int], None]

AT_ONCE: Final[Mapping[int, Cycle]] = {
    220: patterns.polar_pattern,
    221: patterns.grid_pattern,
    247: coordinates.preset,
}
"""Cycles of one block that act where they are defined."""
IN_PARTS: Final[Mapping[tuple[int, int], Part]] = {
    **{(7, part): coordinates.datum_shift for part in range(1, 7)},
    (8, 1): coordinates.mirror_image,
    (9, 1): special.dwell,
    (10, 1): coordinates.rotation,
    (11, 1): coordinates.scaling,
    (12, 1): special.program_as_cycle,
    (13, 1): special.orientation,
    (26, 1): coordinates.axis_scaling,
    (32, 1): special.tolerance,
    (32, 2): special.tolerance_mode,
}
"""Cycles that stand in several blocks, 7.0, 7.1, …; the part with the number 0 names them."""
SEVERAL: Final = frozenset(number for number, _ in IN_PARTS)
WHY_NOT: Final[Mapping[int, str]] = {
    14: "contours of SL cycles (14, 20 to 25, 27, 28) are not read",
    19: "the tilted working plane needs the kinematics of the machine, which the twin does not have",
    800: "turning is not read",
}


def cycl_def(source: Source) -> Callable[[State], None]:
    """One block of a definition."""
    match = HEAD.match(source.body)
    if match is None:
        raise RefusedError(source.written[:24], "needs the number of the cycle; write CYCL DEF 200 …")
    number, part = int(match.group(1)[:6]), match.group(2)
    if part is not None and number in SEVERAL:
        return in_parts(source, number, int(part[:3]), match.end())
    if part is None and number in AT_ONCE:
        act, given = AT_ONCE[number], parameters(source, match.end())
        return lambda state: act(state, evaluated(state, number, given))
    if part is None and number in MACHINING:
        given = parameters(source, match.end())

        def define(state: State) -> None:
            state.cycle, state.calls_cycle = evaluated(state, number, given), False

        return define
    text = f"CYCL DEF {number}" + ("" if part is None else f".{part}")
    reason = WHY_NOT.get(number, f"this cycle is not read; read are {known()}")
    return lambda state: refuse(text, reason)


def evaluated(state: State, number: int, given: Mapping[int, tuple[Expression, str, int]]) -> Definition:
    """The definition with its values; those with a number are Q parameters of the program as well."""
    values = {}
    for parameter, (expression, _, line) in given.items():
        try:
            values[parameter] = expression(state.variables)
        except RefusedError as refused:
            raise RefusedError(refused.word, refused.reason, (line, state.program)) from None
        if math.isfinite(values[parameter]):
            state.variables.write("Q", parameter, values[parameter])
    lines = {parameter: line for parameter, (_, _, line) in given.items()}
    feed = state.tool.feed_mm_min
    return Definition(number, values, state.unit_mm, state.feed_unit, feed, line=state.line, lines=lines, program=state.program)


def refuse(text: str, reason: str) -> None:
    raise RefusedError(text, reason)


def in_parts(source: Source, number: int, part: int, begin: int) -> Callable[[State], None]:
    if part == 0:
        return lambda state: compensation.refuse(state, f"CYCL DEF {number}") if number in (7, 8, 10, 11, 26) else None
    if (number, part) not in IN_PARTS:
        raise RefusedError(f"CYCL DEF {number}.{part}", "is not a part of this cycle that is read")
    act = IN_PARTS[(number, part)]
    return lambda state: act(state, source, begin)


def known() -> str:
    return ", ".join(str(number) for number in sorted({*MACHINING, *AT_ONCE, *SEVERAL}))
