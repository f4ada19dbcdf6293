"""Champion and challenger: what a challenger has to show.

Both are judged on the same moments, of a day that neither was trained on. d = loss of the champion − loss of the challenger at
each moment; the mean of d has an interval of 95 % by a bootstrap over blocks of time (both losses are drawn together, so what
makes a day hard for both cancels). The challenger wins where the interval lies above 0 and on the golden week its mean loss is
not worse than the champion's by more than the tolerance. Else the champion stays, and it is said why.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cnctwin.errors import UsageError
from cnctwin.validation.block_bootstrap import BLOCKS_MIN, block_samples, block_sums, bootstrapped
from cnctwin.validation.figure import rounded

Floats = NDArray[np.float64]
HOURS_MIN = 24.0
TOLERANCE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Losses:
    """Loss of both at evenly spaced moments, (n,), NaN where it is not judged; every_s: between two of them."""

    champion: Floats
    challenger: Floats
    every_s: float

    @property
    def both(self) -> NDArray[np.bool_]:
        """The moments at which both have a loss."""
        return np.asarray(np.isfinite(self.champion) & np.isfinite(self.challenger))

    @property
    def hours(self) -> float:
        """The hours of moments that count."""
        return float(self.both.sum()) * self.every_s / 3600.0

    def means(self) -> tuple[float, float]:
        """Return the mean loss of champion and challenger on the moments that count. Raises UsageError where there is none."""
        both = self.both
        if not both.any():
            raise UsageError("there is no moment at which both models can be judged: other data, or other features")
        return float(self.champion[both].mean()), float(self.challenger[both].mean())


@dataclass(frozen=True, slots=True)
class Outcome:
    """Mean losses; difference: champion less challenger, with its interval; golden: challenger over champion, less 1, in %."""

    wins: bool
    reason: str
    hours: float
    blocks: int
    champion_loss: float
    challenger_loss: float
    difference: float
    low: float | None
    high: float | None
    golden_change_pct: float | None

    def as_json(self) -> dict[str, Any]:
        """For the record."""
        return {k: rounded(v) if isinstance(v, float) else v for k, v in asdict(self).items()}


def outcome(holdout: Losses, golden: Losses | None, *, tolerance: float = TOLERANCE, hours_min: float = HOURS_MIN) -> Outcome:
    """Decide who wins. Raises UsageError where nothing can be judged.

    A challenger whose loss is lower at each moment wins; one that is the same does not.

    >>> worse, better = np.full(90_000, 2.0), np.full(90_000, 1.0) + 0.1 * np.random.default_rng(1).standard_normal(90_000)
    >>> outcome(Losses(worse, better, 1.0), None).wins, outcome(Losses(worse, worse, 1.0), None).wins
    (True, False)
    """
    champion, challenger = holdout.means()
    apart = np.where(holdout.both, holdout.champion - holdout.challenger, np.nan)
    sums = block_sums(np.column_stack([apart, np.where(holdout.both, 1.0, np.nan)]), block_samples(apart))
    found = bootstrapped(sums, lambda s: s[:, 0] / s[:, 1])
    change = None if golden is None else _change_pct(*golden.means())
    reason = ""
    if holdout.hours < hours_min:
        reason = f"{holdout.hours:.3g} h were judged; {hours_min:g} h are needed"
    elif found.low is None or found.high is None:
        reason = f"the difference is correlated over so long that there are {found.blocks} blocks only; {BLOCKS_MIN} are needed"
    elif found.high < 0.0:
        reason = "the challenger is worse on the holdout"
    elif found.low <= 0.0:
        reason = "the difference is none for sure: its interval holds 0"
    elif change is not None and change > 100.0 * tolerance:
        reason = f"the challenger is worse on the golden week by {change:.3g} %, {100 * tolerance:g} % are tolerated"
    wins = not reason
    said = reason or "the challenger is better on the holdout, and not worse on the golden week beyond the tolerance"
    if wins and golden is None:
        said = "the challenger is better on the holdout; there is no golden week (cnctwin model golden freezes one)"
    return Outcome(*(wins, said, holdout.hours, found.blocks, champion, challenger, found.value, found.low, found.high, change))


def _change_pct(champion: float, challenger: float) -> float:
    """In % of the champion's loss; of a champion without a loss, that of the challenger is all too much."""
    if champion <= 0.0:
        return 0.0 if challenger <= 0.0 else 1e9
    return 100.0 * (challenger / champion - 1.0)
