"""The recording of a machine, a row a tick, as its control tells it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from twin.anomaly.parts.told import Expects, Told

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

EXPECTED = ("cut_load_pct", "load_pct", "feed_mm_min", "spindle_rpm", "force_n", "time_s")
"""The columns of `Recorded.expected`."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """One machine, a row a tick; row i is tick `first_tick + i`.

    values: (T, F) in the order of `signals`, NaN = not known
    programs: names, of which `program` (T,) is the place, −1 = not known
    tool, line: (T,), −1 = not known; overrides: (T,) in %, NaN = not known; gated: (T,)
    expected: (T, 6) in the order of `EXPECTED` at programmed feed and speed, NaN = none; None = no expectation at all
    is_known: (T,), False where the machine told nothing at that tick (a gap); None = always told
    """

    machine: str
    tick_s: float
    signals: tuple[str, ...]
    values: "NDArray[np.float64]"
    programs: tuple[str, ...]
    program: "NDArray[np.integer]"
    tool: "NDArray[np.integer]"
    line: "NDArray[np.integer]"
    feed_override_pct: "NDArray[np.float64]"
    spindle_override_pct: "NDArray[np.float64]"
    gated: "NDArray[np.bool_]"
    expected: "NDArray[np.float64] | None" = None
    is_known: "NDArray[np.bool_] | None" = None
    first_tick: int = 0

    def until(self, ticks: int) -> "Recorded":
        """Return the first ticks of it."""
        return self.between(0, ticks)

    def between(self, start: int, stop: int) -> "Recorded":
        """Return its rows from start to before stop."""
        part = slice(start, stop)
        return replace(
            self,
            values=self.values[part],
            program=self.program[part],
            tool=self.tool[part],
            line=self.line[part],
            feed_override_pct=self.feed_override_pct[part],
            spindle_override_pct=self.spindle_override_pct[part],
            gated=self.gated[part],
            expected=None if self.expected is None else self.expected[part],
            is_known=None if self.is_known is None else self.is_known[part],
            first_tick=self.first_tick + start,
        )

    def told(self) -> Iterator[Told | None]:
        """Yield what is told at each tick; None where the machine told nothing."""
        import numpy as np  # noqa: PLC0415

        held = self.values.astype(object)
        held[np.isnan(self.values)] = None
        rows = held.tolist()
        feed, speed = (_or_none(one) for one in (self.feed_override_pct, self.spindle_override_pct))
        known = [True] * len(rows) if self.is_known is None else self.is_known.tolist()
        program, tool, line, gated = (one.tolist() for one in (self.program, self.tool, self.line, self.gated))
        expected = [None] * len(rows) if self.expected is None else self._expected(self.expected)
        for at, row in enumerate(rows):
            if not known[at]:
                yield None
                continue
            yield Told(
                self.first_tick + at,
                row,
                self.programs[program[at]] if program[at] >= 0 else None,
                tool[at] if tool[at] >= 0 else None,
                line[at] if line[at] >= 0 else None,
                feed[at],
                speed[at],
                expected[at],
                gated[at],
            )

    @staticmethod
    def _expected(columns: "NDArray[np.float64]") -> list[Expects | None]:
        """Return the expectation of each tick; those that are alike are one."""
        import numpy as np  # noqa: PLC0415

        known, place = np.unique(columns[:, : len(EXPECTED)], axis=0, return_inverse=True)
        made = [None if math.isnan(row[0]) and math.isnan(row[2]) else Line(*row) for row in known.tolist()]
        return [made[at] for at in place.ravel().tolist()]


def _or_none(column: "NDArray[np.float64]") -> list[float | None]:
    return [None if value != value else value for value in column.tolist()]  # noqa: PLR0124  NaN alone differs from itself


class Line(NamedTuple):
    """The twin's expectation at a line, as recorded."""

    cut_load_pct: float
    load_pct: float
    feed_mm_min: float
    spindle_rpm: float
    force_n: float
    time_s: float
