"""The reason of a score: the signal and the scale that it rests on most, what was measured there and what was expected.

measured = expected · exp(s / weight)        of a ratio; expected + s / weight of a temperature
"""

import math
from collections.abc import Sequence

from twin.anomaly.parts import scales
from twin.anomaly.parts.alarms.why import Why
from twin.anomaly.parts.model import PartsModel
from twin.anomaly.parts.own import Own, usual_of
from twin.anomaly.parts.quantity import UNITS, Kind
from twin.anomaly.parts.residuals import cut_share

PEER_SHOWS = 0.5
"""A peer shows it too where its residual is at least half as large."""


def why_of(model: PartsModel, own: Own, peers: Sequence[Own], left: Sequence[float], knows: str) -> Why:
    """Return the reason of a score; left: in tails, signal by signal, each on all scales. Peers are named by their place."""
    most, least = max(left), min(left)
    index = left.index(most if most >= -least else least)
    at, scale = divmod(index, scales.COUNT)
    place, plan, s = own.place, model.plan, own.smooth[index]
    usual = usual_of(model, own, place.key)
    section = max(0, place.section)
    kind = Kind(plan.kinds[at])
    is_known = usual is not None and section < len(usual.marks) and not own.is_new
    lines = None
    if usual is not None and is_known:
        here = usual.marks[section][0]
        after = usual.marks[section + 1][0] if section + 1 < len(usual.marks) else usual.end[0]
        lines = (here, max(here, after)) if here >= 0 else None
    elif place.line >= 0:
        lines = (place.line, place.line)
    centre = 0.0
    if usual is not None and is_known and kind is not Kind.TEMPERATURE:
        centre = usual.centre[section][at] + own.level[at] * cut_share(plan, usual.centre[section])
    away = s / plan.over_spread[at]
    if plan.cuts[at] and scale >= scales.OPERATION and own.gathered.weight[at]:
        away = own.gathered.total[at] / own.gathered.weight[at] / plan.over_spread[at]
    is_share = not is_known and kind not in (Kind.TEMPERATURE, Kind.PLAIN)
    expected, measured = (100.0, round(100.0 * math.exp(away), 2)) if is_share else _in_units(model, own, at, centre, away)
    shows = [
        str(n) for n, peer in enumerate(peers) if peer.smooth[index] * s > 0.0 and abs(peer.smooth[index]) > PEER_SHOWS * abs(s)
    ]
    return Why(
        model.signals[at],
        scales.SCALES[scale],
        place.program,
        place.tool,
        lines,
        section,
        measured,
        expected,
        "% of expected" if is_share else UNITS[kind],
        abs(s),
        max(0.0, (own.tick - own.high_since) * model.tick_s) if own.high_since > 0 else 0.0,
        knows if is_known else "the twin",
        peers=tuple(shows),
    )


def _in_units(model: PartsModel, own: Own, at: int, centre: float, away: float) -> tuple[float, float]:
    """Return what was expected and what was measured, in the unit of the signal."""
    kind, floor = Kind(model.plan.kinds[at]), model.plan.floors[at]
    if kind in (Kind.TEMPERATURE, Kind.PLAIN):
        base = (own.heat.base[at] or 0.0) if kind is Kind.TEMPERATURE else centre
        return round(base, 4), round(base + away, 4)
    idle = model.idle_at(own.rpm) if at == model.plan.load_at else 0.0
    expected, measured = (max(0.0, math.exp(value) - floor) + idle for value in (centre, centre + away))
    return round(expected, 4), round(measured, 4)
