"""The formulas of Klartext: `(Q2 + 3) * SIN Q4 ^ 2`, compiled once into a function of the parameters.

Binding, strongest first: brackets, signs, functions, `^`, `* / %`, `+ -` (User's Manual TNC 640, "Entering formulas directly").
A function takes what follows it: `SQ 10 - 3^3` is 100 - 27. Angles are in degrees.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from twin.programs.klartext.numbers import FIGURE, PARAMETER, Expression, Store, constant, figure, value
from twin.programs.refusal import RefusedError

TOKEN: Final = re.compile(rf"[ \t]*+(?:({FIGURE})|({PARAMETER})|([A-Z]++)|([-+*/^%()])|(\S))")
FIGURE_KIND, PARAMETER_KIND, NAME_KIND, OPERATOR_KIND = 1, 2, 3, 4


class Token(NamedTuple):
    kind: int
    text: str


def sign(number: float) -> float:
    return math.copysign(1.0, number) if number else 0.0


FUNCTIONS: Final[Mapping[str, Callable[[float], float]]] = {
    "SIN": lambda v: math.sin(math.radians(v)),
    "COS": lambda v: math.cos(math.radians(v)),
    "TAN": lambda v: math.tan(math.radians(v)),
    "ASIN": lambda v: math.degrees(math.asin(v)),
    "ACOS": lambda v: math.degrees(math.acos(v)),
    "ATAN": lambda v: math.degrees(math.atan(v)),
    "SQ": lambda v: v * v,
    "SQRT": math.sqrt,
    "ABS": abs,
    "INT": lambda v: float(math.trunc(v)),
    "FRAC": lambda v: v - math.trunc(v),
    "NEG": lambda v: -v,
    "LN": math.log,
    "LOG": math.log10,
    "EXP": math.exp,
    "SGN": sign,
}


def divided(a: float, b: float, word: str = "/") -> float:
    if b == 0.0:
        raise RefusedError(word, "division by zero; test the divisor with FN 9 first")
    return a / b


def modulo(a: float, b: float) -> float:
    if b == 0.0:
        raise RefusedError("%", "division by zero; test the divisor with FN 9 first")
    return math.fmod(a, b)


def power(a: float, b: float) -> float:
    result = a**b if a != 0.0 or b >= 0.0 else math.inf
    if isinstance(result, complex):
        raise RefusedError("^", f"{a:g} has no power {b:g}")
    return float(result)


OPERATORS: Final[Mapping[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": divided,
    "%": modulo,
    "^": power,
}


def applied(name: str, function: Callable[..., float], *given: float) -> float:
    """A function's value; RefusedError where it has none that a control could hold."""
    try:
        result = function(*given)
    except ValueError:
        raise RefusedError(name, f"has no value at {given[0]:g}") from None
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise RefusedError(name, "the result is too large")
    return result


def tokens(text: str) -> list[Token]:
    """RefusedError for a character that no formula has."""
    found = []
    for match in TOKEN.finditer(text):
        index = match.lastindex or 0
        if index > OPERATOR_KIND:
            raise RefusedError(match.group(index), "has no meaning in a formula")
        found.append(Token(index, match.group(index)))
    return found


class Reader:
    """Recursive descent over the tokens of one formula."""

    __slots__ = ("at", "depth", "depth_max", "tokens")

    def __init__(self, text: str, depth_max: int) -> None:
        self.tokens, self.at, self.depth, self.depth_max = tokens(text), 0, 0, depth_max

    def peek(self) -> str:
        return self.tokens[self.at].text if self.at < len(self.tokens) else ""

    def deeper(self, word: str) -> None:
        self.depth += 1
        if self.depth > self.depth_max:
            raise RefusedError(
                word, f"brackets and functions are nested deeper than {self.depth_max}; use a parameter in between"
            )

    def chain(self, names: str, operand: Callable[[], Expression]) -> Expression:
        """Left to right, in a loop: a thousand terms must not need a thousand levels of call."""
        first, rest = operand(), []
        while (name := self.peek()) and name in names:
            self.at += 1
            rest.append((name, OPERATORS[name], operand()))
        if not rest:
            return first

        def call(store: Store) -> float:
            result = first(store)
            for name, operate, other in rest:
                result = applied(name, operate, result, other(store))
            return result

        return call

    def sum(self) -> Expression:
        return self.chain("+-", self.term)

    def term(self) -> Expression:
        return self.chain("*/%", self.powers)

    def powers(self) -> Expression:
        return self.chain("^", self.factor)

    def factor(self) -> Expression:
        """Signs, functions, then a number, a parameter or a bracket."""
        name = self.peek()
        if name in ("+", "-"):
            self.at += 1
            self.deeper(name)
            inner = self.factor()
            self.depth -= 1
            return (lambda store: -inner(store)) if name == "-" else inner
        if name == "(":
            self.at += 1
            self.deeper("(")
            inner = self.sum()
            if self.peek() != ")":
                raise RefusedError(self.peek() or "(", "here has to stand )")
            self.at += 1
            self.depth -= 1
            return inner
        return self.primary(name)

    def primary(self, name: str) -> Expression:
        if self.at >= len(self.tokens):
            raise RefusedError("", "the block ends inside a formula: a number, a Q parameter, ( or a function has to follow")
        kind = self.tokens[self.at].kind
        self.at += 1
        if kind == FIGURE_KIND:
            return constant(figure(name, name))
        if kind == PARAMETER_KIND:
            return value(name, name)
        if name == "PI":
            return constant(math.pi)
        if name not in FUNCTIONS:
            raise RefusedError(name, "here has to stand a number, a Q parameter, ( or a function")
        self.deeper(name)
        argument, function = self.factor(), FUNCTIONS[name]
        self.depth -= 1
        return lambda store: applied(name, function, argument(store))


def formula(text: str, depth_max: int) -> Expression:
    """Compile a whole formula.

    >>> formula("5 * 3 + 2 * 10", 32)(None), formula("SQ 10 - 3^3", 32)(None)
    (35.0, 73.0)
    """
    reader = Reader(text, depth_max)
    found = reader.sum()
    if reader.at < len(reader.tokens):
        raise RefusedError(reader.peek(), "here has to stand an operator, or the end of the block")
    return found
