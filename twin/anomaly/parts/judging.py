"""The score of a machine beside its peers, in tails of healthy parts, and the reason of it.

    u = left / tail(signal, scale, side)           left: what the peers do not share (`beside.py`)
    score = largest over the scales of  (Σ over signals of u⁴)^(1/4)

The fourth power lets one signal speak for itself, and several that rise together a little earlier. The score is held while
nothing is told: in a gate, and while the spindle stands.
"""

from collections.abc import Sequence
from typing import NamedTuple

from twin.anomaly.parts import scales
from twin.anomaly.parts.beside import left_over
from twin.anomaly.parts.limits import limits_of
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import NEVER, Own, usual_of
from twin.anomaly.parts.reason import why_of
from twin.anomaly.parts.why import Why

SMALL = 0.5
"""A residual below this share of its tail is taken as it is, without the peers; where none is larger, it is the score."""
WHY_FROM = 1.0
NOTHING_TOLD = "nothing was told yet of a cut that is known"


class Judged(NamedTuple):
    """score: in tails of healthy parts, None where it is not known, for `reason`; own_score: before the peers
    is_idle: nothing new was told at this tick (a gate, a spindle that stands), so it counts neither for nor against an alarm
    why: what the score rests on most; None where the score is next to nothing
    knows: what is known of the operation that runs, as "12 parts", "the twin only", "nothing: program O12 is new"
    signature: what is left beside the peers, in tails, signed: signal by signal, each on all scales
    """

    score: float | None
    own_score: float | None
    reason: str | None = None
    is_idle: bool = False
    why: Why | None = None
    knows: str = ""
    signature: tuple[float, ...] = ()


def judged(model: PartsModel, own: Own, peers: Sequence[Own]) -> Judged:
    """Judge a machine as of a tick that its peers have come to as well."""
    plan = model.plan
    usual = usual_of(model, own, own.place.key)
    knows = _knows(own, usual is None, 0 if usual is None else usual.parts)
    if max(own.told_at) == NEVER:
        return Judged(None, None, NOTHING_TOLD, True, None, knows)
    u = [s * up if s > 0.0 else s * down for s, up, down in zip(own.smooth, plan.over_up, plan.over_down, strict=True)]
    most, least = max(u), min(u)
    if most < SMALL and least > -SMALL:
        most = max(most, -least)
        return Judged(most, most, None, own.is_idle, None, knows, tuple(u))
    own_score = _length(u)
    if peers:
        for index in [at for at, value in enumerate(u) if value > SMALL or value < -SMALL]:
            left = left_over(own, peers, index, plan.memory_ticks)
            u[index] = left * (plan.over_up[index] if left > 0.0 else plan.over_down[index])
    left_in_tails = tuple(u)
    if own.memory.tolerated and own.place.key is not None:
        u = _tolerated(model, own, u)
    score = _length(u)
    why = why_of(model, own, peers, u, knows) if score >= WHY_FROM else None
    return Judged(score, own_score, None, own.is_idle, why, knows, left_in_tails)


def _length(u: list[float]) -> float:
    """Return the score of what is left, in tails: signal by signal, each on all scales."""
    fourth = [value * value * value * value for value in u]
    return max([sum(fourth[scale :: scales.COUNT]) for scale in range(scales.COUNT)]) ** 0.25


def _tolerated(model: PartsModel, own: Own, u: list[float]) -> list[float]:
    """Return what is left where a person has called such an alarm false: less by the limit that was raised."""
    limits = limits_of(own.memory.tolerated, own.place.key or "", own.tick * model.tick_s)
    names = ((signal, scale) for signal in model.signals for scale in scales.SCALES)
    return [
        value / limits.get((signal, scale, 1 if value > 0.0 else -1), 1.0)
        for (signal, scale), value in zip(names, u, strict=True)
    ]


def _knows(own: Own, is_new: bool, parts: int) -> str:
    if own.place.key is None:
        return "nothing: the control tells neither program nor tool"
    if not is_new:
        return f"{parts} part{'' if parts == 1 else 's'}"
    if own.expected[2]:
        return "the twin only"
    return f"nothing: {own.place.key} is new, and there is no expectation of it"
