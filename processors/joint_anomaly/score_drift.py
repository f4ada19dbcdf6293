"""Drift of a machine's raw scores from its golden week: hourly means on the chart of `processors/gap/growth.py`.

A threshold holds for machines that score as they did when it was fitted. Means over an hour of scores that were not gated are
charted against those of the golden week, with the correlation of neighbouring hours in it; what goes up or down for good is
drift: the model wants to be trained again, or the machine has changed. A year of scores like those of the golden week brings
`FALSE_ALARMS_A_YEAR`.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from processors.contract import Output
from processors.gap.growth import Baseline, Chart, charted, learned, rule_of
from twin.vocabulary import twin_signals

if TYPE_CHECKING:
    from twin.anomaly.calibration import Calibration

DRIFT = twin_signals.SCORE_DRIFT
BLOCK_S = 3600.0
JUDGED_S_MIN = 600.0  # of an hour, for its mean to count
FALSE_ALARMS_A_YEAR = 0.5
WORTH_SPREADS = 0.5
"""The smallest drift that matters, in robust spreads of single scores."""
NO_GOLDEN_WEEK = "the model is not calibrated; cnctwin train anomaly does that"
TOO_SHORT = "the golden week has too few hours, or hours too much alike, to judge drift by"


class Drift(NamedTuple):
    """The present hour, and the chart of those before."""

    block: int = 0
    ticks: int = 0
    mean: float = 0.0
    chart: Chart = Chart()


def drifted(drift: Drift, calibration: "Calibration | None", raw: float | None, at_s: float) -> tuple[Drift, Sequence[Output]]:
    """The drift after one more score, None where it was gated or not known; what there is to say at the end of an hour."""
    if calibration is None:
        return drift, ()
    block = int(at_s // BLOCK_S)
    if block == drift.block:
        if raw is None:
            return drift, ()
        ticks = drift.ticks + 1
        return Drift(block, ticks, drift.mean + (raw - drift.mean) / ticks, drift.chart), ()
    baseline = _baseline(calibration.hourly_means)
    rule = rule_of(baseline, WORTH_SPREADS * calibration.raw_spread, 2.0 * 8766.0 / FALSE_ALARMS_A_YEAR)
    begun = Drift(block, int(raw is not None), raw or 0.0, drift.chart)
    if rule is None:
        return begun, [Output.null(DRIFT, TOO_SHORT, at_s=at_s)]
    if drift.ticks * calibration.tick_s < JUDGED_S_MIN:
        return begun, ()
    chart = charted(drift.chart, rule, baseline, drift.mean, drift.block * BLOCK_S)
    return begun._replace(chart=chart), [Output(DRIFT, chart.grows != 0, at_s=at_s)]


@lru_cache(maxsize=1000)
def _baseline(hourly_means: tuple[float, ...]) -> Baseline:
    baseline, before = Baseline(), None
    for mean in hourly_means:
        baseline = learned(baseline, mean, before)
        before = mean
    return baseline
