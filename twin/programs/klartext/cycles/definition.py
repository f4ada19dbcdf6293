"""A cycle's definition: `CYCL DEF 200 DRILLING` with its parameters `Q200=2`, and what the cycle reads of them."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from twin.programs.klartext.numbers import VALUE, Expression, value
from twin.programs.klartext.source import Source
from twin.programs.refusal import RefusedError

PARAMETER: Final = re.compile(
    rf"Q([0-9]++)[ \t]*+=[ \t]*+(?:({VALUE})|(F?MAX|F?AUTO)|(F[UZ])[ \t]*+({VALUE})|(\S++))"
    rf"[ \t]*+(?=Q[0-9]++[ \t]*+=|$)"
)
RAPID: Final = math.inf
RAPID_FROM: Final = 99_999.0
"""From this figure on a feed of a cycle is rapid traverse."""
SECONDS_MAX: Final = 3600.0
OPTIONAL: Final[Mapping[int, float]] = {
    **{205: 0.0, 208: 0.0, 210: 0.0, 211: 0.0, 212: 0.0, 213: 0.0, 214: 0.0, 215: 0.0, 220: 0.0, 224: 0.0, 247: 0.0, 255: 0.0},
    **{256: 0.2, 257: 0.0, 258: 0.2, 259: 0.2, 301: 1.0, 336: 0.0, 338: 0.0, 342: 0.0, 343: 0.0, 351: 1.0, 365: 0.0, 366: 0.0},
    **{367: 0.0, 368: 0.0, 369: 0.0, 370: 1.0, 374: 0.0, 377: 1.0, 378: 0.0, 379: 0.0, 395: 0.0, 403: 1.0, 439: 0.0},
}
"""Values of parameters that an older definition does not have: the cycle as it was before it had them."""


@dataclass(frozen=True, slots=True)
class Definition:
    """A defined cycle.

    values: parameters by number, in program units; a feed of FMAX is infinite, F AUTO a NaN
    name: of cycle 12's program; raised_mm: of CYCL CALL POS, by which the surface lies higher
    line, lines: of CYCL DEF, and of its parameters by number, in the text of `program`: where a fault is
    """

    number: int
    values: Mapping[int, float]
    unit_mm: float
    feed_unit: float
    tool_feed_mm_min: float | None = None
    name: str = ""
    raised_mm: float = 0.0
    line: int | None = None
    lines: Mapping[int, int] = field(default_factory=dict)
    program: str | None = None

    @property
    def text(self) -> str:
        return f"CYCL DEF {self.number}"

    def value(self, number: int) -> float:
        """A parameter as it stands; RefusedError where the definition does not have it and the cycle cannot do without."""
        found = self.values.get(number, OPTIONAL.get(number))
        if found is None:
            raise self.refusal(None, f"needs Q{number}")
        return found

    def refusal(self, number: int | None, reason: str) -> RefusedError:
        """Return the error of a parameter, or of the definition as a whole, where it stands in the text."""
        line = self.line if number is None else self.lines.get(number, self.line)
        place = None if line is None else (line, self.program)
        return RefusedError(self.text if number is None else f"Q{number}", reason, place)

    def number_of(self, number: int, low: int, high: int) -> int:
        """A parameter that counts or chooses."""
        found = self.value(number)
        if not math.isfinite(found) or not found.is_integer() or not low <= found <= high:
            raise self.refusal(number, f"has to be a whole number from {low} to {high} in {self.text}")
        return int(found)

    def length(self, number: int, least: float = -math.inf) -> float:
        """A parameter in mm. RefusedError below `least`."""
        found = self.value(number) * self.unit_mm
        if not math.isfinite(found) or found < least:
            raise self.refusal(number, f"has to be at least {least:g} in {self.text}")
        return found

    def positive(self, number: int) -> float:
        """A parameter in mm that is more than 0."""
        found = self.length(number)
        if found <= 0.0:
            raise self.refusal(number, f"has to be more than 0 in {self.text}")
        return found

    def seconds(self, number: int) -> float:
        found = self.value(number)
        if not 0.0 <= found <= SECONDS_MAX:
            raise self.refusal(number, f"is a time from 0 to {SECONDS_MAX:g} s")
        return found

    def feed(self, number: int, instead: int | None = None) -> float:
        """A feed in mm/min, infinite for FMAX. instead: the parameter that stands in where this one is 0."""
        found = self.value(number)
        if found == 0.0 and instead is not None:
            return self.feed(instead)
        if math.isnan(found):
            if self.tool_feed_mm_min is None:
                raise self.refusal(number, "TOOL CALL gave no feed for FAUTO; write F there, or a figure here")
            return self.tool_feed_mm_min
        if found <= 0.0:
            raise self.refusal(number, "a feed is more than 0")
        return RAPID if found >= RAPID_FROM else found * self.feed_unit

    def cutting_feed(self, number: int) -> float:
        """A feed in mm/min that is not rapid."""
        found = self.feed(number)
        if not math.isfinite(found):
            raise self.refusal(number, "this cut cannot be in rapid; write a feed")
        return found

    def surface_mm(self) -> float:
        """Q203, with what CYCL CALL POS adds."""
        return self.length(203) + self.raised_mm

    def depth_mm(self, number: int = 201) -> float:
        """A depth as a positive figure; 0: the cycle is not run. RefusedError for one that points out of the workpiece."""
        found = self.length(number)
        if found > 0.0:
            raise self.refusal(number, "the control refuses a depth that is not negative")
        return -found

    def with_values(self, changed: Mapping[int, float]) -> "Definition":
        return replace(self, values={**self.values, **changed})


def parameters(source: Source, begin: int) -> dict[int, tuple[Expression, str, int]]:
    """The parameters of a definition by number: value, text and line."""
    found: dict[int, tuple[Expression, str, int]] = {}
    for part in source.parts:
        body = part.body
        first = re.search(r"Q[0-9]++[ \t]*+=", body)
        at = first.start() if first is not None else len(body)
        while at < len(body):
            match = PARAMETER.match(body, at)
            if match is None or match.group(6) is not None:
                raise RefusedError(part.written[at : at + 24].strip(), "is not a parameter of a cycle", (part.line, None))
            number, text = int(match.group(1)[:9]), part.written[at : match.end()].strip()
            if match.group(4) is not None:
                raise RefusedError(text, "a cycle's feed by revolution or tooth is not read; write mm/min", (part.line, None))
            if match.group(3) is not None:
                infinite = "MAX" in match.group(3)
                found[number] = ((lambda store: RAPID) if infinite else (lambda store: math.nan), text, part.line)
            else:
                found[number] = (value(match.group(2), text), text, part.line)
            at = match.end()
    return found
