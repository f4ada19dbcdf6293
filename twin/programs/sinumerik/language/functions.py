"""The operators and functions of expressions ("NC programming", chapters "Arithmetic functions" and "String operations").

Angles are in degrees. Texts join with `<<`, which turns a number into its digits. INT, BOOL and CHAR are numbers.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final

from twin.programs.refusal import RefusedError

Value = float | str
INTEGER_MAX: Final = 2**53
TEXT_MAX: Final = 400
"""Characters of a text that operators make: twice what a control keeps."""


def as_number(value: Value, word: str) -> float:
    """`value`, if it is a number."""
    if isinstance(value, str):
        raise RefusedError(word, f'needs a number, not the text "{value[:20]}"')
    return value


def as_whole(value: Value, word: str) -> int:
    """`value` as the integer that it is."""
    given = as_number(value, word)
    if not given.is_integer() or abs(given) > INTEGER_MAX:
        raise RefusedError(word, f"needs a whole number, not {given:g}; use TRUNC() or ROUND()")
    return int(given)


def is_true(value: Value, word: str) -> bool:
    return as_number(value, word) != 0.0


def as_text(value: Value) -> str:
    """Return what `<<` makes of a value: whole numbers without a point.

    >>> as_text(5.0), as_text(2.5), as_text("A")
    ('5', '2.5', 'A')
    """
    if isinstance(value, str):
        return value
    return str(int(value)) if value.is_integer() and abs(value) < INTEGER_MAX else f"{value:.10g}"


def checked(value: float, word: str) -> float:
    """`value`, if it is a number that a control could hold."""
    if not math.isfinite(value):
        raise RefusedError(word, "the result is too large")
    return value


def round_half_up(value: float) -> float:
    """ROUND, and what an INT keeps of a REAL: 2.5 becomes 3, -2.5 becomes -3.

    >>> round_half_up(2.5), round_half_up(-2.5), round_half_up(2.4)
    (3.0, -3.0, 2.0)
    """
    whole = float(math.floor(abs(value)))
    return math.copysign(whole + (1.0 if abs(value) - whole >= 0.5 else 0.0), value)


def divide(word: str, a: float, b: float) -> float:
    if b == 0.0:
        raise RefusedError(word, "division by zero; test the divisor with IF first")
    return a / b


ARITHMETIC: Final[Mapping[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: divide("/", a, b),
    "DIV": lambda a, b: float(math.trunc(divide("DIV", a, b))),
    "MOD": lambda a, b: math.fmod(a, b) if b else divide("MOD", a, b),
}
BITWISE: Final[Mapping[str, Callable[[int, int], int]]] = {
    "B_AND": lambda a, b: a & b,
    "B_XOR": lambda a, b: a ^ b,
    "B_OR": lambda a, b: a | b,
}
LOGICAL: Final[Mapping[str, Callable[[bool, bool], bool]]] = {
    "AND": lambda a, b: a and b,
    "XOR": lambda a, b: a != b,
    "OR": lambda a, b: a or b,
}
ORDER: Final[Mapping[str, Callable[[float, float], bool]]] = {
    ">": lambda a, b: a > b,
    "<": lambda a, b: a < b,
    ">=": lambda a, b: a >= b,
    "<=": lambda a, b: a <= b,
}


def compare(word: str, a: Value, b: Value) -> float:
    """Compare numbers with numbers and texts with texts."""
    if isinstance(a, str) != isinstance(b, str):
        raise RefusedError(word, "compares a number with a text")
    if word in ("==", "<>"):
        return float((a == b) == (word == "=="))
    if isinstance(a, str) or isinstance(b, str):
        first, second = str(a), str(b)
        return float(ORDER[word](float((first > second) - (first < second)), 0.0))
    return float(ORDER[word](a, b))


def operate(word: str, a: Value, b: Value) -> Value:
    """The value of `a word b`."""
    if word == "<<":
        joined = as_text(a) + as_text(b)
        if len(joined) > TEXT_MAX:
            raise RefusedError(word, f"makes a text of more than {TEXT_MAX} characters")
        return joined
    if word in ARITHMETIC:
        return checked(ARITHMETIC[word](as_number(a, word), as_number(b, word)), word)
    if word in BITWISE:
        return float(BITWISE[word](as_whole(a, word), as_whole(b, word)))
    if word in LOGICAL:
        return float(LOGICAL[word](is_true(a, word), is_true(b, word)))
    return compare(word, a, b)


def bound(low: float, value: float, high: float) -> float:
    """BOUND(minimum, maximum, value) brings a value between two others."""
    return min(max(value, low), high)


REAL_FUNCTIONS: Final[Mapping[str, tuple[int, Callable[..., float]]]] = {
    "SIN": (1, lambda v: math.sin(math.radians(v))),
    "COS": (1, lambda v: math.cos(math.radians(v))),
    "TAN": (1, lambda v: math.tan(math.radians(v))),
    "ASIN": (1, lambda v: math.degrees(math.asin(v))),
    "ACOS": (1, lambda v: math.degrees(math.acos(v))),
    "ATAN2": (2, lambda a, b: math.degrees(math.atan2(a, b))),
    "SQRT": (1, math.sqrt),
    "ABS": (1, abs),
    "POT": (1, lambda v: v * v),
    "TRUNC": (1, lambda v: float(math.trunc(v))),
    "ROUND": (1, round_half_up),
    "ROUNDUP": (1, lambda v: float(math.ceil(v))),
    "LN": (1, math.log),
    "EXP": (1, math.exp),
    "MINVAL": (2, min),
    "MAXVAL": (2, max),
    "BOUND": (3, lambda low, high, v: bound(low, v, high)),
}
"""Number of arguments, and the function."""


TEXT_FUNCTIONS: Final[Mapping[str, tuple[int, Callable[..., Value]]]] = {
    "STRLEN": (1, lambda text: float(len(as_text(text)))),
    "NUMBER": (1, lambda text: text_number(as_text(text))),
    "ISNUMBER": (1, lambda text: float(is_number(as_text(text)))),
    "TOUPPER": (1, lambda text: as_text(text).upper()),
    "TOLOWER": (1, lambda text: as_text(text).lower()),
    "INDEX": (2, lambda text, one: float(as_text(text).find(as_text(one)))),
    "SUBSTR": (3, lambda text, at, many: part(as_text(text), at, many)),
}


def is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text.strip().upper().replace("EX", "e")))
    except ValueError:
        return False


def text_number(text: str) -> float:
    if not is_number(text):
        raise RefusedError("NUMBER", f'"{text[:20]}" is no number; test it with ISNUMBER first')
    return float(text.strip().upper().replace("EX", "e"))


def part(text: str, at: Value, many: Value) -> str:
    begin, count = as_whole(at, "SUBSTR"), as_whole(many, "SUBSTR")
    return text[max(begin, 0) : max(begin, 0) + max(count, 0)]


def call(name: str, given: list[Value]) -> Value:
    """The value of a function. RefusedError where it has none for these arguments."""
    if name in TEXT_FUNCTIONS:
        many, text_function = TEXT_FUNCTIONS[name]
        need(name, many, given)
        return text_function(*given)
    many, function = REAL_FUNCTIONS[name]
    need(name, many, given)
    numbers = [as_number(value, name) for value in given]
    try:
        return checked(function(*numbers), name)
    except ValueError:
        raise RefusedError(name, f"has no value at {numbers[0]:g}") from None
    except OverflowError:
        raise RefusedError(name, "the result is too large") from None


def need(name: str, many: int, given: list[Value]) -> None:
    if len(given) != many:
        raise RefusedError(name, f"needs {many} argument{'s' if many > 1 else ''}, not {len(given)}")


FUNCTIONS: Final = REAL_FUNCTIONS.keys() | TEXT_FUNCTIONS.keys()
