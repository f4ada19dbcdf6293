"""Assignments and FN functions: `Q1 = Q2 + 3`, `FN 1: Q5 = +Q1 + +3`, `FN 9: IF +Q1 EQU +5 GOTO LBL 2`.

Forms and numbers are those of the User's Manual TNC 640, "Programming Q parameters".
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.klartext.expressions import applied, divided, formula
from twin.programs.klartext.numbers import VALUE, Expression, value
from twin.programs.klartext.source import Source
from twin.programs.klartext.state import State
from twin.programs.refusal import RefusedError

Command = Callable[[State], None]

HEAD: Final = re.compile(r"FN[ \t]*+([0-9]{1,2}+)[ \t]*+:[ \t]*+")
TARGET: Final = re.compile(r"(Q[LR]?+)([0-9]++)[ \t]*+=[ \t]*+")
STRING_TARGET: Final = re.compile(r"(?:DECLARE STRING[ \t]++)?+QS([0-9]++)[ \t]*+=[ \t]*+")
LITERAL: Final = re.compile(r"\"([^\"]*+)\"")
TWO: Final = re.compile(rf"({VALUE})[ \t]*+(\+|-|\*|DIV|LEN|ANG)[ \t]*+({VALUE})")
ONE: Final = re.compile(rf"(SQRT|SIN|COS)[ \t]*+({VALUE})")
JUMP: Final = re.compile(
    rf"IF[ \t]*+({VALUE})[ \t]*+(?:(EQU|NE|GT|LT)[ \t]*+({VALUE})|IS (DEFINED|UNDEFINED))[ \t]*+"
    r"GOTO LBL[ \t]*+(\"[^\"]*+\"|[0-9]++|QS[0-9]++)"
)
COMPARED: Final[Mapping[int, str]] = {9: "EQU", 10: "NE", 11: "GT", 12: "LT"}
TWO_SIDED: Final[Mapping[str, tuple[int, Callable[[float, float], float]]]] = {
    "+": (1, lambda a, b: a + b),
    "-": (2, lambda a, b: a - b),
    "*": (3, lambda a, b: a * b),
    "DIV": (4, lambda a, b: divided(a, b, "DIV")),
    "LEN": (8, math.hypot),
    "ANG": (13, lambda a, b: math.degrees(math.atan2(a, b)) % 360.0),
}
ONE_SIDED: Final[Mapping[str, tuple[int, Callable[[float], float]]]] = {
    "SQRT": (5, math.sqrt),
    "SIN": (6, lambda a: math.sin(math.radians(a))),
    "COS": (7, lambda a: math.cos(math.radians(a))),
}
PASSED_OVER: Final = frozenset({15, 16, 19, 26, 27, 29, 38})
"""They print, send, or tell the PLC or a table, and change nothing that the program reads."""
REFUSED: Final[Mapping[int, str]] = {
    17: "changes system data of the control, which the twin does not have",
    18: "reads system data of the control, which the twin does not have; set the parameter in [control] parameters",
    20: "waits for the PLC, which the twin does not have",
    25: "sets a new datum, which has no place in the twin's preset table; use cycle 7 or 247",
    28: "reads a table of the control, which the twin does not have; set the parameter in [control] parameters",
    37: "hands parameters on to the calling program, which is not read",
}


def assigned(source: Source, depth_max: int) -> Command:
    """`Q1 = …`, `QS1 = …`."""
    string = STRING_TARGET.match(source.body)
    if string is not None:
        literal = LITERAL.fullmatch(source.written, string.end())
        number, text = int(string.group(1)[:9]), literal.group(1) if literal is not None else None
        return lambda state: set_string(state, number, text)
    match = TARGET.match(source.body)
    assert match is not None
    return setting(match, formula(source.body[match.end() :], depth_max))


def set_string(state: State, number: int, text: str | None) -> None:
    """A string that is put together from others is passed over: it has no value that is known."""
    if text is None:
        state.strings.pop(number, None)
    else:
        state.strings[number] = text


def setting(match: re.Match[str], found: Expression) -> Command:
    kind, number = match.group(1), int(match.group(2)[:9])
    return lambda state: state.variables.write(kind, number, found(state.variables))


def function(source: Source) -> Command:
    """`FN n: …`."""
    head = HEAD.match(source.body)
    if head is None:
        raise RefusedError(source.written[:16], "an FN function is written FN 1: Q5 = +Q1 + +3")
    number, at = int(head.group(1)), head.end()
    word = f"FN {number}"
    if number in COMPARED:
        return jump(source, at, number)
    if number in PASSED_OVER or (number == 20 and "SYNC" in source.body):
        return lambda state: None
    if number == 14:
        return lambda state: refuse(word, f"the program ends with its own error here: {source.written[at:].strip()}")
    if number in REFUSED:
        return lambda state: refuse(word, REFUSED[number])
    target = TARGET.match(source.body, at)
    if target is None or number > 13:
        raise RefusedError(word, "is not read")
    rest = source.body[target.end() :].rstrip()
    return setting(target, right_side(rest, number, word))


def refuse(word: str, reason: str) -> None:
    raise RefusedError(word, reason)


def right_side(text: str, number: int, word: str) -> Expression:
    """Return what an FN function assigns; its operator has to be the one that the number names."""
    if number == 0:
        return value(text, text)
    two = TWO.fullmatch(text)
    if two is not None and TWO_SIDED[two.group(2)][0] == number:
        first, second = value(two.group(1), text), value(two.group(3), text)
        operate = TWO_SIDED[two.group(2)][1]
        return lambda store: applied(word, operate, first(store), second(store))
    one = ONE.fullmatch(text)
    if one is not None and ONE_SIDED[one.group(1)][0] == number:
        given, apply = value(one.group(2), text), ONE_SIDED[one.group(1)][1]
        return lambda store: applied(word, apply, given(store))
    raise RefusedError(text[:24], f"is not what {word} takes")


def jump(source: Source, at: int, number: int) -> Command:
    """FN 9 to FN 12: on at a label where the condition holds."""
    match = JUMP.fullmatch(source.body.rstrip(), at)
    word = f"FN {number}"
    if match is None or (match.group(2) is not None and match.group(2) != COMPARED[number]):
        raise RefusedError(word, f"is written {word}: IF +Q1 {COMPARED[number]} +Q2 GOTO LBL 1")
    label = source.written[match.start(5) : match.end(5)].strip('"')
    if match.group(4) is not None:
        kind, parameter = re.sub(r"[^QLR]", "", match.group(1)), int(re.sub(r"[^0-9]", "", match.group(1))[:9] or 0)
        wanted = match.group(4) == "DEFINED"
        return lambda state: go(state, state.variables.defined(kind, parameter) == wanted, label, word)
    first, second = value(match.group(1), match.group(1)), value(match.group(3), match.group(3))
    holds = HOLDS[COMPARED[number]]
    return lambda state: go(state, holds(first(state.variables), second(state.variables)), label, word)


HOLDS: Final[Mapping[str, Callable[[float, float], bool]]] = {
    "EQU": lambda a, b: a == b,
    "NE": lambda a, b: a != b,
    "GT": lambda a, b: a > b,
    "LT": lambda a, b: a < b,
}


def go(state: State, holds: bool, label: str, word: str) -> None:
    if holds:
        state.flow.jump(named(state, label), word)


def named(state: State, label: str) -> str:
    """A label as it is set: numbers without zeros before them; that in a string parameter by its value."""
    if re.fullmatch(r"QS[0-9]+", label):
        found = state.strings.get(int(label[2:]))
        if found is None:
            raise RefusedError(label, "this string parameter has no value that is known")
        return found
    return label.lstrip("0") or "0" if label.isdigit() else label
