"""A frame judged part by part: each cut beside the same cut of earlier parts and the twin, less what the peers share.

    own = told_after(own, told);  judged(own, peers);  alarm;  learned(own, judged, alarm)

See `twin/anomaly/parts/`; this file brings a row of the broker to the first two, `parts_member.py` what comes of them back.
"""

from collections.abc import Mapping

from processors.joint_anomaly.frames import Frame
from processors.joint_anomaly.member import NO_PEER, Adjustment, Member
from processors.joint_anomaly.moment import told_of
from processors.joint_anomaly.scoring import Scoring
from twin.anomaly.parts.following import told_after
from twin.anomaly.parts.judging import judged
from twin.anomaly.parts.own import Own

NO_PARTS = "the model was not trained for common_mode = parts"


def adjusted_by_parts(scorings: Mapping[str, Scoring], frame: Frame, members: Mapping[str, Member]) -> dict[str, Adjustment]:
    """Return the score of each machine of a frame, of one tick."""
    owns: dict[str, Own] = {}
    for name, scoring in scorings.items():
        scored, label = frame[name]
        if scoring.parts is not None and scored.moment is not None:
            told = told_of(scored.moment, scoring.expectations, scored.tick, label.is_on is True)
            owns[name] = told_after(scoring.parts, _before(scoring, members[name]), told)
    return {name: _adjustment(scoring, frame, owns) for name, scoring in scorings.items()}


def _before(scoring: Scoring, member: Member) -> Own:
    """Return the state of a machine's parts; one of another model is of no use."""
    parts = member.parts
    return scoring.begun if parts is None or parts.model != scoring.parts_id else parts.own


def _adjustment(scoring: Scoring, frame: Frame, owns: Mapping[str, Own]) -> Adjustment:
    name = scoring.machine
    own, (scored, label) = owns.get(name), frame[name]
    if own is None or scoring.parts is None:
        return Adjustment(None, False, NO_PEER, 0, why=scored.reason or NO_PARTS)
    peers = {peer: other for peer, other in owns.items() if peer != name}
    found = judged(scoring.parts, own, tuple(peers.values()))
    if found.why is not None and found.why.peers:
        names = tuple(peers)
        found = found._replace(why=found.why._replace(peers=tuple(names[int(place)] for place in found.why.peers)))
    threshold = None if scoring.rule is None else scoring.rule.threshold
    score, alone = found.score, found.own_score
    is_common = threshold is not None and score is not None and alone is not None and score < threshold <= alone
    peer = found.why.peers[0] if is_common and found.why is not None and found.why.peers else NO_PEER
    score = 0.0 if score is not None and label.is_on is True else score
    return Adjustment(score, is_common, peer, len(peers), why=found.reason, is_idle=found.is_idle, parts=(own, found))
