"""The score of a machine beside its peers, in tails of healthy parts, and the reason of it.

    u = left / tail(signal, scale, side)           left: what the peers do not share (`beside.py`)
    score = largest over the scales of  √(Σ over signals of u²)

One signal speaks for itself, and several that rise together speak earlier. The score is held while nothing is told: in a gate,
and while the spindle stands.
"""

import math
from collections.abc import Sequence

from twin.anomaly.parts import scales
from twin.anomaly.parts.alarms.limits import limits_of
from twin.anomaly.parts.alarms.reason import why_of
from twin.anomaly.parts.beside import left_over
from twin.anomaly.parts.judgement import Judged
from twin.anomaly.parts.model import PartsModel, Plan
from twin.anomaly.parts.own import NEVER, Own, usual_of
from twin.anomaly.parts.quantity import Kind
from twin.anomaly.parts.shared import harder, shaken

__all__ = ["Judged", "judged"]
SMALL = 0.5
"""A residual below this share of its tail is taken as it is, without the peers; where none is larger, it is the score."""
WHY_FROM = 1.0
FEELS, FEELS_ENERGY = 0.3, 0.2
"""A machine asks what its peers feel where its load is so many spreads away, its vibration's energy so much above the usual."""
NOTHING_TOLD = "no known cut has been reported yet"


def judged(model: PartsModel, own: Own, peers: Sequence[Own]) -> Judged:
    """Judge a machine as of a tick that its peers have come to as well; while it is idle, the judgement is held."""
    if own.held is not None:
        return own.held
    plan = model.plan
    usual = usual_of(model, own, own.place.key)
    knows = _knows(own, usual is None, 0 if usual is None else usual.parts)
    if max(own.told_at) == NEVER:
        return Judged(None, None, NOTHING_TOLD, True, None, knows)
    u = [s * up if s > 0.0 else s * down for s, up, down in zip(own.smooth, plan.over_up, plan.over_down, strict=True)]
    shared = _shared(plan, own, peers)
    most, least = max(u), min(u)
    if most < SMALL and least > -SMALL:
        most = max(most, -least)
        return Judged(most, most, None, own.is_idle, None, knows, tuple(u), shared)
    own_score = _length(u)
    if peers:
        for index in [at for at in plan.by_peers if u[at] > SMALL or u[at] < -SMALL]:
            left = left_over(own, peers, index, plan.memory_ticks)
            u[index] = left * (plan.over_up[index] if left > 0.0 else plan.over_down[index])
    left_in_tails = tuple(u)
    if own.memory.tolerated and own.place.key is not None:
        u = _tolerated(model, own, u)
    score = _length(u)
    why = why_of(model, own, peers, u, knows) if score >= WHY_FROM else None
    return Judged(score, own_score, None, own.is_idle, why, knows, left_in_tails, shared)


def _shared(plan: Plan, own: Own, peers: Sequence[Own]) -> tuple[float, ...]:
    """Return what the peers feel of the signals that the machine itself feels something of."""
    found = plan.flat
    for at in plan.levelled if peers else ():
        kind, first = plan.kinds[at], at * scales.COUNT
        energy, quiet = own.felt[at]
        if kind == Kind.VIBRATION and energy > FEELS_ENERGY * quiet:
            value = shaken(peers, at, own.tick - plan.fresh_ticks[0])
        elif kind == Kind.LOAD and not -FEELS < own.smooth[first + scales.CUT] < FEELS:
            value = harder(peers, at, own.tick - plan.fresh_ticks[1])
        else:
            continue
        if value:
            found = (*found[:at], value, *found[at + 1 :])
    return found


def _length(u: list[float]) -> float:
    """Return the score of what is left, in tails: signal by signal, each on all scales."""
    squares = [value * value for value in u]
    return math.sqrt(max([sum(squares[scale :: scales.COUNT]) for scale in range(scales.COUNT)]))


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
