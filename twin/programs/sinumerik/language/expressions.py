"""Expressions, compiled once into functions of the variables: `R1*SIN(45)+_DEPTH[2]`.

Binding, strongest first, as the manual has it: NOT B_NOT; `* / DIV MOD`; `+ -`; B_AND; B_XOR; B_OR; AND; XOR; OR; `<<`;
comparisons. Two comparisons side by side (`R1==1 AND R2==2`) therefore do not mean what they seem to: they are refused.
"""

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from twin.programs.refusal import RefusedError
from twin.programs.sinumerik.language.functions import (
    FUNCTIONS,
    Value,
    as_number,
    as_whole,
    call,
    checked,
    is_true,
    operate,
)
from twin.programs.sinumerik.language.tokens import Kind, Token

OPERATORS_MAX: Final = 256
"""Operators of one block; a block of a control has 512 characters."""
PRIORITY: Final[Mapping[str, int]] = {
    **dict.fromkeys(("*", "/", "DIV", "MOD"), 10),
    **dict.fromkeys(("+", "-"), 9),
    **{"B_AND": 8, "B_XOR": 7, "B_OR": 6, "AND": 5, "XOR": 4, "OR": 3, "<<": 2},
    **dict.fromkeys(("==", "<>", ">", "<", ">=", "<="), 1),
}
COMPARISON: Final = 1


class Store(Protocol):
    """The variables that an expression reads."""

    def read(self, name: str, index: tuple[Value, ...], word: str) -> Value:
        """Value of a variable, of an element of an array, of a system variable; RefusedError where there is none."""


Expression = Callable[[Store], Value]


def constant(value: Value) -> Expression:
    return lambda store: value


class Variable:
    """A variable as it stands in the text: its name, and the expressions of its index."""

    __slots__ = ("index", "name", "text")

    def __init__(self, name: str, index: tuple[Expression, ...], text: str) -> None:
        self.name, self.index, self.text = name, index, text

    def at(self, store: Store) -> tuple[Value, ...]:
        """The index as it is now."""
        return tuple(one(store) for one in self.index)

    def __call__(self, store: Store) -> Value:
        return store.read(self.name, self.at(store), self.text)


def binary(word: str, left: Expression, right: Expression) -> Expression:
    return lambda store: operate(word, left(store), right(store))


class Reader:
    """Descent over the tokens of one block, from `at` on."""

    __slots__ = ("at", "depth", "depth_max", "operators", "tokens")

    def __init__(self, tokens: list[Token], depth_max: int) -> None:
        self.tokens, self.at, self.depth, self.depth_max, self.operators = tokens, 0, 0, depth_max, 0

    @property
    def done(self) -> bool:
        return self.at >= len(self.tokens)

    def token(self) -> Token:
        """The next token. RefusedError at the end of the block."""
        if self.done:
            last = self.tokens[-1].text if self.tokens else ""
            raise RefusedError(last, "the block ends here, and something has to follow")
        return self.tokens[self.at]

    def peek(self, offset: int = 0) -> str:
        """Name of the next operator or name; "" for anything else."""
        at = self.at + offset
        if at < len(self.tokens) and self.tokens[at].kind in (Kind.OPERATOR, Kind.NAME):
            return self.tokens[at].name
        return ""

    def taken(self, name: str) -> bool:
        """Pass this operator or name, if it comes next."""
        if self.peek() == name:
            self.at += 1
            return True
        return False

    def take(self, name: str) -> None:
        if not self.taken(name):
            found = self.token().text
            raise RefusedError(found, f"here has to stand {name}")

    def name(self, what: str) -> str:
        """A name, as of a label."""
        token = self.token()
        if token.kind is not Kind.NAME:
            raise RefusedError(token.text, f"here has to stand {what}")
        self.at += 1
        return token.name

    def deeper(self) -> None:
        self.depth += 1
        if self.depth > self.depth_max:
            raise RefusedError("(", f"brackets are nested deeper than {self.depth_max}; use a variable in between")

    def expression(self, lowest: int = COMPARISON) -> Expression:
        """Operators that bind at least as strongly as `lowest`."""
        left, compared = self.factor(), False
        while (word := self.peek()) in PRIORITY and self.tokens[self.at].kind is Kind.OPERATOR and PRIORITY[word] >= lowest:
            if PRIORITY[word] == COMPARISON:
                if compared:
                    raise RefusedError(
                        word, "the second comparison needs brackets, since AND and OR bind first: (R1==1) AND (R2==2)"
                    )
                compared = True
            self.at += 1
            self.operators += 1
            if self.operators > OPERATORS_MAX:
                raise RefusedError(word, f"more than {OPERATORS_MAX} operators in one block; use a variable in between")
            left = binary(word, left, self.expression(PRIORITY[word] + 1))
        return left

    def factor(self) -> Expression:
        """Signs and NOT, then a number, a text, a variable, a bracket or a function."""
        signs: list[str] = []
        while (word := self.peek()) in ("+", "-", "NOT", "B_NOT"):
            signs.append(word)
            self.at += 1
            if len(signs) > self.depth_max:
                raise RefusedError(word, "too many signs in a row")
        value = self.primary()
        for sign in reversed(signs):
            value = signed(sign, value)
        return value

    def primary(self) -> Expression:
        token = self.token()
        self.at += 1
        if token.kind is Kind.NUMBER:
            return constant(token.number)
        if token.kind is Kind.TEXT:
            return constant(token.name)
        if token.kind is Kind.ADDRESS:
            return self.address(token)
        if token.name == "(":
            self.deeper()
            inner = self.expression()
            self.take(")")
            self.depth -= 1
            return inner
        if token.kind is Kind.NAME:
            return self.named(token)
        raise RefusedError(token.text, "here has to stand a number, a variable, a function or (")

    def address(self, token: Token) -> Expression:
        """`R5`; in a value no other letter has a number behind it."""
        if token.name != "R" or not token.number.is_integer() or token.number < 0:
            raise RefusedError(token.text, "is no value; a parameter is R1, calculations stand as X=R1+5")
        return Variable("R", (constant(token.number),), token.text)

    def named(self, token: Token) -> Expression:
        if token.name in ("TRUE", "FALSE"):
            return constant(float(token.name == "TRUE"))
        if self.peek() == "(" and token.name in FUNCTIONS:
            given = [argument or constant(0.0) for argument in self.arguments()]
            name = token.name
            return lambda store: call(name, [one(store) for one in given])
        if self.peek() == "(":
            raise RefusedError(token.text, "this function is not read")
        return self.variable(token)

    def variable(self, token: Token) -> Variable:
        """A name with its index, if any, once the name is passed. `R5` is the parameter also before `=`."""
        if token.name[0] == "R" and token.name[1:].isdecimal():
            return Variable("R", (constant(float(token.name[1:])),), token.text)
        index: list[Expression] = []
        if self.taken("["):
            self.deeper()
            while not self.taken("]"):
                index.append(self.expression())
                if self.peek() != "]":
                    self.take(",")
            self.depth -= 1
        return Variable(token.name, tuple(index), token.text)

    def arguments(self) -> list[Expression | None]:
        """`(1, , R5)`: None where one is left out."""
        self.take("(")
        self.deeper()
        found: list[Expression | None] = []
        while True:
            found.append(None if self.peek() in (",", ")") else self.expression())
            if self.taken(")"):
                break
            self.take(",")
        self.depth -= 1
        return [] if found == [None] else found


def signed(sign: str, value: Expression) -> Expression:
    if sign == "-":
        return lambda store: -as_number(value(store), "-")
    if sign == "NOT":
        return lambda store: float(not is_true(value(store), "NOT"))
    if sign == "B_NOT":
        return lambda store: checked(float(~as_whole(value(store), "B_NOT")), "B_NOT")
    return lambda store: as_number(value(store), "+")
