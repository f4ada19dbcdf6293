"""Macro B arithmetic: `[#1+SIN[30]*2]`, compiled once into a function of the variables.

Binding, strongest first: functions; `* / AND MOD`; `+ - OR XOR`; comparisons. Angles are in degrees. A null variable (`#0`, or
one never set) counts as 0 in arithmetic and in GT GE LT LE; in EQ and NE it equals only null. A bare `#1` hands its null on.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from twin.programs.fanuc.tokens import KEYWORD, NUMBER, OPERATOR, Token
from twin.programs.refusal import RefusedError

EXACT_INTEGER_MAX = 2**53


class Store(Protocol):
    """The store that an expression reads from."""

    def read(self, number: float) -> float | None:
        """Value of #number; None = null."""


Value = float | None
Expression = Callable[[Store], Value]


def round_half_away(value: float) -> float:
    """ROUND: 2.5 becomes 3, -2.5 becomes -3 (Python's own rounds halves to even).

    >>> round_half_away(2.5), round_half_away(-2.5), round_half_away(0.49999999999999994)
    (3.0, -3.0, 0.0)
    """
    whole = float(math.floor(abs(value)))
    return math.copysign(whole + (1.0 if abs(value) - whole >= 0.5 else 0.0), value)


def whole(name: str, value: float) -> int:
    """An integer for the bitwise operators and BIN, BCD."""
    if not value.is_integer() or abs(value) > EXACT_INTEGER_MAX:
        raise RefusedError(name, f"needs an integer, not {value:g}; use FIX[...] or ROUND[...]")
    return int(value)


def from_bcd(value: float) -> float:
    """BIN: reads hexadecimal digits as decimal ones. BIN of 0x25 = 37 is 25."""
    digits = f"{whole('BIN', value):x}"
    if not digits.isdecimal():
        raise RefusedError("BIN", f"{value:g} is not a BCD number (as hexadecimal it is {digits})")
    return float(int(digits))


def to_bcd(value: float) -> float:
    """BCD: 25 becomes 0x25 = 37."""
    if value < 0:
        raise RefusedError("BCD", f"needs a number of at least 0, not {value:g}")
    return float(int(str(whole("BCD", value)), 16))


FUNCTIONS: Mapping[str, Callable[[float], float]] = {
    "SIN": lambda v: math.sin(math.radians(v)),
    "COS": lambda v: math.cos(math.radians(v)),
    "TAN": lambda v: math.tan(math.radians(v)),
    "ASIN": lambda v: math.degrees(math.asin(v)),
    "ACOS": lambda v: math.degrees(math.acos(v)),
    "ATAN": lambda v: math.degrees(math.atan(v)),
    "SQRT": math.sqrt,
    "ABS": abs,
    "ROUND": round_half_away,
    "FIX": lambda v: float(math.trunc(v)),
    "FUP": lambda v: math.copysign(float(math.ceil(abs(v))), v),
    "LN": math.log,
    "EXP": math.exp,
    "BIN": from_bcd,
    "BCD": to_bcd,
}


def divide(a: float, b: float) -> float:
    if b == 0.0:
        raise RefusedError("/", "division by zero; test the divisor with IF first")
    return a / b


def modulo(a: float, b: float) -> float:
    """MOD keeps the sign of the dividend."""
    if b == 0.0:
        raise RefusedError("MOD", "division by zero; test the divisor with IF first")
    return math.fmod(a, b)


TERM: Mapping[str, Callable[[float, float], float]] = {
    "*": lambda a, b: a * b,
    "/": divide,
    "MOD": modulo,
    "AND": lambda a, b: float(whole("AND", a) & whole("AND", b)),
}
SUM: Mapping[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "OR": lambda a, b: float(whole("OR", a) | whole("OR", b)),
    "XOR": lambda a, b: float(whole("XOR", a) ^ whole("XOR", b)),
}
ORDER: Mapping[str, Callable[[float, float], float]] = {
    "GT": lambda a, b: float(a > b),
    "LT": lambda a, b: float(a < b),
    "GE": lambda a, b: float(a >= b),
    "LE": lambda a, b: float(a <= b),
}


def equal(name: str, a: Value, b: Value) -> float:
    same = a is b if a is None or b is None else a == b
    return float(same if name == "EQ" else not same)


def checked(value: float, word: str) -> float:
    """`value`, if it is a number that a control could hold."""
    if not math.isfinite(value):
        raise RefusedError(word, "the result is too large")
    return value


def apply(name: str, argument: Expression, angle_signed: bool) -> Expression:
    function = FUNCTIONS[name]

    def call(store: Store) -> Value:
        given = argument(store) or 0.0
        try:
            result = checked(function(given), name)
        except ValueError:
            raise RefusedError(name, f"has no value at {given:g}") from None
        except OverflowError:
            raise RefusedError(name, "the result is too large") from None
        return result + 360.0 if name == "ASIN" and result < 0 and not angle_signed else result

    return call


def arctangent(above: Expression, below: Expression, angle_signed: bool) -> Expression:
    """ATAN[above]/[below]: the angle of the point (below, above)."""

    def call(store: Store) -> Value:
        angle = math.degrees(math.atan2(above(store) or 0.0, below(store) or 0.0))
        return angle + 360.0 if angle < 0 and not angle_signed else angle

    return call


def chain(first: Expression, rest: Iterable[tuple[Callable[[float, float], float], Expression]]) -> Expression:
    """Left to right. In a loop, not by nesting: a thousand terms must not need a thousand levels of call."""
    steps = tuple(rest)
    if not steps:
        return first

    def call(store: Store) -> Value:
        value = first(store) or 0.0
        for operate, operand in steps:
            value = operate(value, operand(store) or 0.0)
        return checked(value, "")

    return call


class Reader:
    """Recursive descent over the tokens of one block, from `at` on."""

    __slots__ = ("angle_signed", "at", "depth", "depth_max", "tokens")

    def __init__(self, tokens: list[Token], depth_max: int, angle_signed: bool) -> None:
        self.tokens, self.at, self.depth = tokens, 0, 0
        self.depth_max, self.angle_signed = depth_max, angle_signed

    def peek(self) -> str:
        """Text of the next operator or keyword; "" for anything else."""
        if self.at < len(self.tokens):
            token = self.tokens[self.at]
            if token.kind in (OPERATOR, KEYWORD):
                return token.name
        return ""

    def take(self, name: str) -> None:
        if self.peek() != name:
            found = self.tokens[self.at].text if self.at < len(self.tokens) else "the end of the block"
            raise RefusedError(found if self.at < len(self.tokens) else "", f"here has to stand {name!r}")
        self.at += 1

    def bracket(self) -> Expression:
        """`[ expression ]`"""
        self.take("[")
        self.depth += 1
        if self.depth > self.depth_max:
            raise RefusedError("[", f"brackets are nested deeper than {self.depth_max}; use a variable in between")
        inner = self.expression()
        self.take("]")
        self.depth -= 1
        return inner

    def expression(self) -> Expression:
        value = self.sum()
        while (name := self.peek()) in ORDER or name in ("EQ", "NE"):
            self.at += 1
            value = self.compared(name, value, self.sum())
            self.depth += 1  # One level a comparison, as with a bracket: these do nest.
            if self.depth > self.depth_max:
                raise RefusedError(name, f"more than {self.depth_max} comparisons in a row")
        return value

    @staticmethod
    def compared(name: str, left: Expression, right: Expression) -> Expression:
        if name in ("EQ", "NE"):
            return lambda store: equal(name, left(store), right(store))
        order = ORDER[name]
        return lambda store: order(left(store) or 0.0, right(store) or 0.0)

    def sum(self) -> Expression:
        first, rest = self.term(), []
        while (name := self.peek()) in SUM:
            self.at += 1
            rest.append((SUM[name], self.term()))
        return chain(first, rest)

    def term(self) -> Expression:
        first, rest = self.factor(), []
        while (name := self.peek()) in TERM:
            self.at += 1
            rest.append((TERM[name], self.factor()))
        return chain(first, rest)

    def factor(self) -> Expression:
        """Signs, then a number, a variable, a bracket or a function."""
        negative = signed = False
        while (sign := self.peek()) in ("+", "-"):
            negative, signed, self.at = negative != (sign == "-"), True, self.at + 1
        value = self.primary()
        if not signed:
            return value
        return (lambda store: -(value(store) or 0.0)) if negative else (lambda store: value(store) or 0.0)

    def primary(self) -> Expression:
        if self.at >= len(self.tokens):
            last = self.tokens[-1].text if self.tokens else ""
            raise RefusedError(last, "the block ends inside an expression: a number, # variable, [ or function has to follow")
        token = self.tokens[self.at]
        if token.kind == NUMBER:
            self.at += 1
            number = token.number
            return lambda store: number
        if token.name == "#":
            variable = self.variable()
            return lambda store: store.read(variable(store))
        if token.name == "[":
            return self.bracket()
        if token.kind == KEYWORD and token.name in FUNCTIONS:
            self.at += 1
            argument = self.bracket()
            follows = [next_token.name for next_token in self.tokens[self.at : self.at + 2]]
            if token.name == "ATAN" and follows == ["/", "["]:
                self.at += 1
                return arctangent(argument, self.bracket(), self.angle_signed)
            return apply(token.name, argument, self.angle_signed)
        raise RefusedError(token.text, "here has to stand a number, # variable, [ or function")

    def variable(self) -> Callable[[Store], float]:
        """`#5`, `#[...]`, `##5`: the number of the variable that is meant."""
        hashes = 0
        while self.peek() == "#":
            hashes, self.at = hashes + 1, self.at + 1
        if self.at < len(self.tokens) and self.tokens[self.at].kind == NUMBER:
            number = self.tokens[self.at].number
            self.at += 1
            inner: Expression = lambda store: number  # noqa: E731
        elif self.peek() == "[":
            inner = self.bracket()
        else:
            raise RefusedError("#", "needs the number of a variable, or [ ]; named variables are not of this dialect")

        def call(store: Store) -> float:
            number = inner(store) or 0.0
            for _ in range(hashes - 1):
                number = store.read(number) or 0.0
            return number

        return call
