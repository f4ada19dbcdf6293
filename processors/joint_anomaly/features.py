"""A frame judged feature by feature: what of a machine's smoothed features those of its peers do not share.

See `twin/anomaly/preparation.py` and `twin/anomaly/common_features.py`. A machine whose spindle stands, or that changes its tool,
is not judged and learns nothing; in a regime without a baseline its score is not known. Common mode here: alone the machine would
be at the threshold, beside its peers it is not.
"""

from collections.abc import Mapping
from typing import NamedTuple

from processors.joint_anomaly.frames import Frame
from processors.joint_anomaly.member import NO_PEER, Adjustment, Member
from processors.joint_anomaly.scoring import Scoring
from twin.anomaly.common_features import MEMORY_S, left_over, length
from twin.anomaly.preparation import STANDS, Preparation, Smoothed, smoothed_after, unsmoothed

NO_PREPARATION = "the model was not trained for common_mode = features"


class _One(NamedTuple):
    """A machine of the frame that has features."""

    scoring: Scoring
    preparation: Preparation
    smoothed: Smoothed
    is_gated: bool
    why: str | None


def adjusted_by_features(scorings: Mapping[str, Scoring], frame: Frame, members: Mapping[str, Member]) -> dict[str, Adjustment]:
    """Return the score of each machine of a frame, of one tick."""
    known = {name: one for name, scoring in scorings.items() if (one := _of(scoring, frame, members[name])) is not None}
    found: dict[str, Adjustment] = {}
    for name, scoring in scorings.items():
        scored, _ = frame[name]
        one = known.get(name)
        if one is None:
            found[name] = Adjustment(
                None, False, NO_PEER, 0, smoothed=members[name].smoothed, why=scored.reason or NO_PREPARATION
            )
        else:
            peers = {other: peer.smoothed for other, peer in known.items() if other != name}
            found[name] = _judged(one, peers, scored.tick, scoring.tick_s)
    return found


def _of(scoring: Scoring, frame: Frame, member: Member) -> _One | None:
    scored, label = frame[scoring.machine]
    preparation = None if scoring.model is None else scoring.model.preparation
    if preparation is None or scored.now is None:
        return None
    before = member.smoothed or unsmoothed(preparation)
    is_gated = label.is_on is True
    smoothed = smoothed_after(preparation, before, scored.now, is_gated, scored.tick, scoring.tick_s)
    return _One(scoring, preparation, smoothed, is_gated, scored.now.unknown)


def _judged(one: _One, peers: Mapping[str, Smoothed], tick: int, tick_s: float) -> Adjustment:
    oldest = tick - round(MEMORY_S / tick_s)
    fresh = {name: peer for name, peer in peers.items() if max(peer.ticks) >= oldest}
    if one.is_gated or one.why is not None:
        is_known = one.is_gated or one.why == STANDS
        return Adjustment(0.0 if is_known else None, False, NO_PEER, len(fresh), smoothed=one.smoothed, why=one.why, is_idle=True)
    left = length(one.preparation, left_over(one.smoothed, list(fresh.values()), tick, tick_s))
    threshold = None if one.scoring.rule is None else one.scoring.rule.threshold
    is_common = threshold is not None and left < threshold <= length(one.preparation, one.smoothed.values)
    return Adjustment(left, is_common, _loudest(one, fresh) if is_common else NO_PEER, len(fresh), smoothed=one.smoothed)


def _loudest(one: _One, peers: Mapping[str, Smoothed]) -> str:
    """The peer that goes furthest where this machine goes furthest."""
    tails = zip(one.smoothed.values, one.preparation.up, one.preparation.down, strict=True)
    shares = [value / up if value > 0.0 else value / down for value, up, down in tails]
    feature = max(range(len(shares)), key=lambda place: abs(shares[place]))
    sign = 1.0 if shares[feature] > 0.0 else -1.0
    return max(peers, key=lambda name: sign * peers[name].values[feature], default=NO_PEER)
