"""The check of a model against its golden week: does it still give the frozen scores and alerts?

A challenger is not held to the frozen scores but to the number of alerts that its threshold stands for.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from twin.anomaly.alarm import is_alarm, onsets
from twin.anomaly.calibration import Calibration
from twin.anomaly.common_mode import CommonModeRule, Method, adjust_frames
from twin.anomaly.errors import ModelError
from twin.anomaly.golden import GoldenWeek
from twin.anomaly.golden_parts import Told, recorded_again, scores_alone, told_columns
from twin.anomaly.model import AnomalyModel
from twin.anomaly.parts.replay import Recorded

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
TICKS_MAX = 604_800
"""A week at a tick of a second."""
SAME = 1e-9
"""Scores on another processor may differ in their last bit: the power function of numpy is not the same on all of them."""


@dataclass(frozen=True, slots=True)
class GoldenCheck:
    """differ: ticks whose scores are not the frozen ones; largest: the largest difference; alerts, frozen_alerts: now, and then;
    alerts_max: what the budget allows in that time; faults: what is wrong, in words
    """

    ticks: int
    weeks: float
    differ: int
    largest: float
    alerts: int
    frozen_alerts: int
    alerts_max: int
    faults: tuple[str, ...]

    @property
    def passes(self) -> bool:
        """Return True where nothing is wrong."""
        return not self.faults


def frozen(model: AnomalyModel, rows: Floats, gated: Flags, peers: Floats) -> GoldenWeek:
    """The golden week of these ticks, the latest where they are more than a week's.

    Raises ModelError where the model has no calibration.
    """
    found = _calibration(model)
    rows, gated, peers = rows[-TICKS_MAX:], gated[-TICKS_MAX:], peers[-TICKS_MAX:]
    scores = scores_of(model, rows)
    alerts = alerts_of(found, scores, gated, peers)
    return GoldenWeek(model.features, rows, scores, gated, peers, alerts, found.tick_s)


def frozen_parts(model: AnomalyModel, recorded: Recorded, skipped: Flags, adjusted: Floats) -> GoldenWeek:
    """The golden week of a model that compares parts; skipped, adjusted: (n,), at the ticks that the machine told of.

    Raises ModelError where the model has no calibration.
    """
    found = _calibration(model)
    rows, told = told_columns(recorded, TICKS_MAX)
    skipped, adjusted = skipped[-TICKS_MAX:], adjusted[-TICKS_MAX:]
    scores = _scores_again(model, rows, told, found.tick_s)
    alerts = alerts_of(found, adjusted, skipped, adjusted)
    return GoldenWeek(model.features, rows, scores, skipped, adjusted, alerts, found.tick_s, told)


def _scores_again(model: AnomalyModel, rows: Floats, told: Told, tick_s: float) -> Floats:
    if model.parts is None:
        raise ModelError("the golden week is that of parts, the model compares none: check it on recordings")
    return scores_alone(model.parts, recorded_again(model.features, tick_s, rows, told))


def scores_of(model: AnomalyModel, rows: Floats) -> Floats:
    """Scores (n,) of rows (n, features), NaN where a feature is not known."""
    known = np.isfinite(rows).all(axis=1)
    scores = np.full(len(rows), np.nan)
    scores[known] = model.scores(rows[known])
    return scores


def peers_of(rule: CommonModeRule, scores: Floats, gated: Flags, place: int) -> Floats:
    """(T,) what the machine in one column was judged beside, of scores (T, N): raw ones for `source`, z for `residual`."""
    if rule.method is Method.SOURCE:
        counted = np.where(gated, np.nan, scores) if rule.leaves_gated_peers_out else scores
        others = np.delete(counted, place, axis=1)
        largest = np.where(np.isnan(others), -np.inf, others).max(axis=1, initial=-np.inf)
        return np.where(np.isinf(largest), np.nan, largest)
    ungated = gated.copy()
    ungated[:, place] = False
    own = scores.copy()
    own[:, place] = 0.0  # so that what is subtracted is left, whether the own score is known or not
    return 0.0 - adjust_frames(rule, own, ungated)[0][:, place]


def adjusted_by_peers(found: Calibration, scores: Floats, gated: Flags, peers: Floats) -> Floats:
    """Adjusted scores (n,), of raw scores and what the peers were; the same as twin/anomaly/common_mode.py."""
    none = np.isnan(peers)
    if found.common_mode in {Method.FEATURES, Method.PARTS}:
        left = peers
    elif found.common_mode is Method.SOURCE:
        common = (scores > 0.0) & ~none & (np.where(none, -np.inf, peers) >= found.common_mode_factor * scores)
        left = np.where(common, 0.0, scores)
    else:
        left = (scores - found.raw_center) / found.raw_spread - np.maximum(0.0, np.where(none, 0.0, peers))
    return np.where(gated & ~np.isnan(scores), 0.0, left)


def alerts_of(found: Calibration, scores: Floats, gated: Flags, peers: Floats) -> int:
    """Return the number of alarms that come on."""
    rule = found.rule
    return len(onsets(is_alarm(rule, adjusted_by_peers(found, scores, gated, peers), gated)))


def checked(model: AnomalyModel, golden: GoldenWeek, is_challenger: bool = False) -> GoldenCheck:
    """Check that a model gives the frozen scores and alerts; of a challenger, that its alerts are what its threshold stands for.

    Raises ModelError where the model looks at signals that were not frozen, or has no calibration.
    """
    found = _calibration(model)
    if missing := [name for name in model.features if name not in golden.features]:
        raise ModelError(f"the golden week has no {missing[0]}: it was frozen with {', '.join(golden.features)}")
    if found.tick_s != golden.tick_s:
        raise ModelError(
            f"the golden week has a tick of {golden.tick_s:g} s, the model of {found.tick_s:g} s: they cannot be compared"
        )
    if is_challenger and (model.preparation is not None or model.parts is not None):
        raise ModelError("what was left beside the peers is frozen for the model that left it: check another on recordings")
    rows = golden.rows[:, [golden.features.index(name) for name in model.features]]
    scores = scores_of(model, rows) if golden.told is None else _scores_again(model, rows, golden.told, found.tick_s)
    off = np.abs(scores - golden.scores)
    differ, largest = (
        int((off > SAME).sum() + (np.isnan(scores) != np.isnan(golden.scores)).sum()),
        float(np.nanmax(off, initial=0.0)),
    )
    alerts = alerts_of(found, scores if golden.told is None else golden.peers, golden.gated, golden.peers)
    most = most_alerts(found.alerts_per_week * golden.weeks)
    faults = []
    if is_challenger and alerts > most:
        faults.append(f"{alerts} alerts in {golden.weeks:.2g} machine-weeks; {found.alerts_per_week:g} a week allow {most}")
    if not is_challenger and differ:
        faults.append(f"{differ} of {len(scores)} scores are not the frozen ones, by up to {largest:.2g}")
    if not is_challenger and alerts != golden.alerts:
        faults.append(f"{alerts} alerts, {golden.alerts} were frozen")
    return GoldenCheck(len(scores), golden.weeks, differ, largest, alerts, golden.alerts, most, tuple(faults))


def most_alerts(expected: float) -> int:
    """The most alerts that still go with so many expected ones, in 95 of 100 cases (Poisson; its normal form from 200 on).

    >>> most_alerts(1.0), most_alerts(0.0)
    (3, 0)
    """
    if expected > 200.0:
        return math.ceil(expected + 1.645 * math.sqrt(expected))
    count, share = 0, math.exp(-expected)
    total = share
    while total < 0.95:
        count += 1
        share *= expected / count
        total += share
    return count


def _calibration(model: AnomalyModel) -> Calibration:
    if model.calibration is None:
        raise ModelError("the model has no threshold, so no alerts to count: cnctwin train anomaly fits one")
    return model.calibration
