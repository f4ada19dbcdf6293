"""The golden week of a machine, from what the processor made of its recordings."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cnctwin.training.anomaly.recorded_cell import Stretch
from cnctwin.training.anomaly.regimes import Ticks, held_run, standardised
from cnctwin.training.anomaly.track import Track
from twin.anomaly.alarm import is_alarm, onsets
from twin.anomaly.common_mode import CommonModeRule, Method
from twin.anomaly.golden import GoldenWeek
from twin.anomaly.golden_check import frozen, peers_of
from twin.anomaly.model import AnomalyModel

Floats = NDArray[np.float64]


def segments(track: Track, tick_s: float) -> list[slice]:
    """Runs of ticks without a jump of time."""
    breaks = np.flatnonzero(np.diff(track.t_s) > 1.5 * tick_s) + 1
    edges = [0, *breaks.tolist(), len(track.t_s)]
    return [slice(a, b) for a, b in pairwise(edges) if b > a]


def frozen_week(
    machine: str,
    models: Mapping[str, AnomalyModel],
    stretches: Sequence[Stretch],
    tracks: Sequence[Mapping[str, Track]],
    ticks: Ticks,
) -> tuple[GoldenWeek, int]:
    """The golden week, and how many alarms the processor's own scores bring."""
    model = models[machine]
    found = model.calibration
    assert found is not None
    rows, gated, peers, alerts = [], [], [], 0
    alarm = found.rule
    for stretch, scored in zip(stretches, tracks, strict=True):
        if machine not in scored:
            continue
        track = scored[machine]
        held = held_run(stretch[machine], ticks)
        at = np.searchsorted(held.at_ms, np.rint(track.t_s * 1000.0).astype(np.int64))
        values = held.rows[at] if model.preparation is None else standardised(model.preparation, held)[0][at]
        beside = peers_beside(machine, scored, models)
        for piece in segments(track, found.tick_s):
            alerts += len(onsets(is_alarm(alarm, track.adjusted[piece], track.skipped[piece])))
            rows += [values[piece], np.full((1, len(model.features)), np.nan)]  # a row that is not known parts what is not one
            gated += [track.skipped[piece], np.zeros(1, np.bool_)]
            peers += [beside[piece], np.full(1, np.nan)]
    return frozen(model, np.concatenate(rows), np.concatenate(gated), np.concatenate(peers)), alerts


def peers_beside(machine: str, scored: Mapping[str, Track], models: Mapping[str, AnomalyModel]) -> Floats:
    """(T,) at the ticks of a machine, what it was judged beside; where features are judged, what that left."""
    if models[machine].preparation is not None:
        return scored[machine].adjusted
    own = np.rint(scored[machine].t_s * 1000.0).astype(np.int64)
    names = [machine, *(name for name in scored if name != machine)]
    raw, gated = np.full((len(own), len(names)), np.nan), np.zeros((len(own), len(names)), dtype=np.bool_)
    for column, name in enumerate(names):
        track = scored[name]
        _, mine, theirs = np.intersect1d(own, np.rint(track.t_s * 1000.0).astype(np.int64), return_indices=True)
        found = models[name].calibration
        assert found is not None
        score = track.raw[theirs]
        if found.common_mode is Method.RESIDUAL:
            score = (score - found.raw_center) / found.raw_spread
        raw[mine, column], gated[mine, column] = score, track.gated[theirs]
    found = models[machine].calibration
    assert found is not None
    rule = CommonModeRule(found.common_mode, found.common_mode_factor, found.exclude_gated_peers)
    return peers_of(rule, raw, gated, 0)
