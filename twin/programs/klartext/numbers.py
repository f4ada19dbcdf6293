"""Figures and parameters as a Klartext program writes them: `+10`, `-7,5`, `+Q5`, `-QL2`.

The decimal sign is a point or a comma. All repetitions are possessive, so that no line, however long, makes a pattern go back.
"""

import re
from collections.abc import Callable
from typing import Final, Protocol

from twin.programs.refusal import RefusedError

NUMBER_MAX: Final = 999_999_999.0
"""More than any control holds; also what keeps arithmetic on lengths finite."""

FIGURE: Final = r"(?:[0-9]++(?:[.,][0-9]*+)?+|[.,][0-9]++)"
PARAMETER: Final = r"Q[LRS]?+[0-9]++"
VALUE: Final = rf"[-+]?+[ \t]*+(?:{FIGURE}|{PARAMETER})"
VALUE_PARTS: Final = re.compile(rf"([-+]?+)[ \t]*+(?:({FIGURE})|(Q[LRS]?+)([0-9]++))")


class Store(Protocol):
    """The store that an expression reads from."""

    def read(self, kind: str, number: int) -> float:
        """Value of a parameter: kind Q, QL or QR."""


Expression = Callable[[Store], float]


def figure(text: str, word: str) -> float:
    """The number that a figure stands for.

    >>> figure("12,75", "Z-12,75")
    12.75
    """
    if len(text) > 40:
        raise RefusedError(word[:40], "has more digits than any control reads")
    value = float(text.replace(",", "."))
    if value > NUMBER_MAX:
        raise RefusedError(word[:40], "has more than nine digits before the point")
    return value


def constant(value: float) -> Expression:
    """An expression that is always the same."""
    return lambda store: value


def value(text: str, word: str) -> Expression:
    """A figure or a parameter, with its sign.

    >>> value("- 7,5", "X- 7,5")(None)
    -7.5
    """
    match = VALUE_PARTS.fullmatch(text.strip())
    if match is None:
        raise RefusedError(word, "here has to stand a number or a Q parameter")
    sign = -1.0 if match.group(1) == "-" else 1.0
    if match.group(2) is not None:
        return constant(sign * figure(match.group(2), word))
    kind, number = match.group(3), int(match.group(4)[:9])
    if kind == "QS":
        raise RefusedError(word, "a string parameter is no number")
    return lambda store: sign * store.read(kind, number)
