"""A figure of the validation: what it is, how sure, of how much, and whether it is within its budget. Plain JSON."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Verdict(StrEnum):
    """In the order in which one of them speaks for several."""

    OVER = "over"
    WITHIN = "within"
    TOO_LITTLE = "not enough data"
    UNSEEN = "not observable"


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure.

    quantity: temperature, force, …; measure: mae, rmse, mape, r, …; on: axis or program, "" where there is one only
    low, high: 95 % by block bootstrap, None where there are too few blocks that are independent
    samples, hours, blocks: what it rests on; basis: what was compared with what; reason: why there is no figure
    hours_needed: of hours, where there are too few of them
    """

    quantity: str
    measure: str
    unit: str
    budget: float
    verdict: Verdict
    value: float | None = None
    low: float | None = None
    high: float | None = None
    samples: int = 0
    hours: float = 0.0
    blocks: int = 0
    on: str = ""
    basis: str = ""
    reason: str | None = None
    hours_needed: float | None = None

    @property
    def name(self) -> str:
        """As metrics and tables call it."""
        return f"{self.quantity}_{self.measure}"

    @property
    def key(self) -> str:
        """Its name, and what it is of."""
        return f"{self.name}/{self.on}" if self.on else self.name

    def as_json(self) -> dict[str, Any]:
        """Digits that mean something."""
        told = asdict(self) | {"verdict": str(self.verdict)}
        for name in ("value", "low", "high", "hours"):
            told[name] = rounded(told[name])
        return told


def rounded(value: float | None) -> float | None:
    """To five digits; None where it is no number."""
    return float(f"{value:.5g}") if value is not None and math.isfinite(value) else None


def judged(value: float, budget: float, *, at_least: bool = False) -> Verdict:
    """Within where the value is at most (at least) the budget.

    >>> judged(1.9, 2.0), judged(0.8, 0.85, at_least=True)
    (<Verdict.WITHIN: 'within'>, <Verdict.OVER: 'over'>)
    """
    return Verdict.WITHIN if (value >= budget if at_least else value <= budget) else Verdict.OVER


def together(verdicts: Iterable[Verdict | str]) -> Verdict:
    """One word for several: over where one is over.

    >>> together(["not observable", "within", "not enough data"])
    <Verdict.WITHIN: 'within'>
    """
    order = list(Verdict)
    return min((Verdict(one) for one in verdicts), key=order.index, default=Verdict.UNSEEN)


def unseen(quantity: str, measures: Sequence[tuple[str, str, float]], reason: str, on: str = "") -> list[Figure]:
    """Figures that there are not. measures: name, unit, budget of each."""
    return [Figure(quantity, name, unit, budget, Verdict.UNSEEN, on=on, reason=reason) for name, unit, budget in measures]
