"""A cell of machines over recorded ticks, with the very functions of the stream: training, thresholds and benchmarks use it.

for each tick:  own = told_after(own, told);  judged(own, peers);  alarm;  learned(own)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from twin.anomaly.alarm import AlarmState, after_tick
from twin.anomaly.parts import scales
from twin.anomaly.parts.alarms.why import Why
from twin.anomaly.parts.following import told_after
from twin.anomaly.parts.judging import judged
from twin.anomaly.parts.learning import learned
from twin.anomaly.parts.model import OPERATIONS_MAX, PartsModel
from twin.anomaly.parts.own import Own, begun, usual_of
from twin.anomaly.parts.quantity import SPREAD_LEAST, Kind
from twin.anomaly.parts.record import CutRecord
from twin.anomaly.parts.recorded import EXPECTED, Line, Recorded
from twin.anomaly.parts.shared import HARDER_GAIN, gain_of
from twin.anomaly.parts.told import Told

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from twin.anomaly.alarm import AlarmRule

__all__ = ["ALL", "EXPECTED", "Ablation", "Line", "Recorded", "Replayed", "fit", "replayed"]
YOUNG = 4
"""The first fourth of the recordings gives spreads; tails are those of the rest."""
SEEN_S = 5.0
MATURE_PARTS, MATURE_SHARE = 8, 0.3
"""Tails come from operations that so many parts have taught, where they are so much of what was seen."""
SPREAD_PARTS_MIN = 2
LOOSE_TAILS = (6.0, 3.0, 8.0, 6.0, 5.0)
"""Tails so wide that only what stands out is kept from being learned, before the real ones are known."""
STEADY_QUANTILE = 0.35
"""About half of the sections are edges, which spread further."""


class Ablation(NamedTuple):
    """The knowledge that a replay takes into account."""

    has_parts: bool = True
    has_twin: bool = True
    has_peers: bool = True
    has_gates: bool = True


ALL = Ablation()


class Seen(NamedTuple):
    """The remainder beside the peers at a tick, in tails. parts: that had taught the operation by then.

    felt, shared: by the machine, and by its peers (`shared.py`)
    """

    tick: int
    left: tuple[float, ...]
    parts: int
    felt: tuple[tuple[float, float], ...]
    shared: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Replayed:
    """scores, own_scores: (T, N), NaN = not known, held while idle; is_idle, is_alarm: (T, N)
    whys: (tick, machine's place, why) at each onset of an alarm; records: (machine's place, record) in order
    owns: the states at the end, from which a later stretch goes on
    """

    scores: "NDArray[np.float64]"
    own_scores: "NDArray[np.float64]"
    is_idle: "NDArray[np.bool_]"
    is_alarm: "NDArray[np.bool_]"
    whys: tuple[tuple[int, int, Why], ...]
    records: tuple[tuple[int, CutRecord], ...]
    owns: tuple[Own, ...]


def fit(cell: Sequence[Recorded], ablation: Ablation = ALL) -> tuple[PartsModel, ...]:
    """Learn a model for each machine of a cell from recordings of healthy parts over the same ticks.

    Idle load, heat and the twin's error come from the arrays; the rest from a replay, in which each part is judged by the earlier
    ones only, so that tails are those of the future. Raises ValueError where nothing can be learned from a recording.
    """
    from twin.anomaly.parts.training import prepared  # noqa: PLC0415  numpy comes with it

    wide = [LOOSE_TAILS * len(one.signals) for one in cell]
    models = [
        prepared(one).changed(follows_parts=ablation.has_parts, up=tails, down=tails)
        for one, tails in zip(cell, wide, strict=True)
    ]
    young = [one.until(max(1, len(one.values) // YOUNG)) for one in cell]
    _, owns, seen = _run(models, young, None, ablation, SEEN_S)
    models = [_with_spreads(model, own, rows) for model, own, rows in zip(models, owns, seen, strict=True)]
    _, owns, seen = _run(models, cell, None, ablation, SEEN_S)
    return tuple(_taught(model, own, rows) for model, own, rows in zip(models, owns, seen, strict=True))


def replayed(
    models: Sequence[PartsModel],
    cell: Sequence[Recorded],
    rules: "Sequence[AlarmRule | None] | None" = None,
    ablation: Ablation = ALL,
    owns: Sequence[Own] | None = None,
) -> Replayed:
    """Judge a cell tick by tick, learning as the stream does; rules: of the alarms, one a machine, None = never an alarm.

    Without an alarm rule a part whose score is suspicious for long is not learned either. owns: states to go on from.
    """
    return _run(models, cell, rules, ablation, 0.0, owns)[0]


def _run(
    models: Sequence[PartsModel],
    cell: Sequence[Recorded],
    rules: "Sequence[AlarmRule | None] | None",
    ablation: Ablation,
    seen_s: float,
    owns: Sequence[Own] | None = None,
) -> "tuple[Replayed, list[Own], list[list[Seen]]]":
    """Replay a cell; return what came of it, the states at the end, and what was left beside the peers every seen_s, by tick."""
    import numpy as np  # noqa: PLC0415  the stream needs none

    count, ticks = len(cell), len(cell[0].values)
    scores, own_scores = np.full((ticks, count), np.nan), np.full((ticks, count), np.nan)
    is_idle, is_alarm = np.zeros((ticks, count), dtype=np.bool_), np.zeros((ticks, count), dtype=np.bool_)
    states = [begun(model) for model in models] if owns is None else list(owns)
    alarms = [AlarmState()] * count
    every = max(1, round(seen_s / cell[0].tick_s)) if seen_s else 0
    seen: list[list[Seen]] = [[] for _ in cell]
    whys, records = [], []
    for tick, told in enumerate(zip(*(one.told() for one in cell), strict=True)):
        for place, one in enumerate(told):
            if one is not None:
                now = one if ablation == ALL else _ablated(one, ablation)
                states[place] = told_after(models[place], states[place], now)
        before = tuple(states)
        for place, model in enumerate(models):
            if told[place] is None:
                is_idle[tick, place] = True
                continue
            own = before[place]
            peers = (*before[:place], *before[place + 1 :]) if ablation.has_peers else ()
            judgement = judged(model, own, peers)
            rule = None if rules is None else rules[place]
            was_on = alarms[place].is_on
            if rule is not None:
                alarms[place] = after_tick(rule, alarms[place], judgement.score, judgement.is_idle)
            states[place], record = learned(model, own, judgement, alarms[place].is_on)
            scores[tick, place] = np.nan if judgement.score is None else judgement.score
            own_scores[tick, place] = np.nan if judgement.own_score is None else judgement.own_score
            is_idle[tick, place], is_alarm[tick, place] = judgement.is_idle, alarms[place].is_on
            if record is not None:
                records.append((place, record))
            if alarms[place].is_on and not was_on and judgement.why is not None:
                whys.append((tick, place, judgement.why))
            if every and tick % every == 0 and not judgement.is_idle and judgement.signature:
                usual = usual_of(model, own, own.place.key)
                parts = 0 if usual is None else usual.parts
                seen[place].append(Seen(tick, judgement.signature, parts, own.felt, judgement.shared))
    return Replayed(scores, own_scores, is_idle, is_alarm, tuple(whys), tuple(records), tuple(states)), states, seen


def _ablated(told: Told, ablation: Ablation) -> Told:
    if not ablation.has_twin and told.expected is not None:
        told = told._replace(expected=None)
    return told if ablation.has_gates or not told.is_gated else told._replace(is_gated=False)


def _with_spreads(model: PartsModel, own: Own, seen: "list[Seen]") -> PartsModel:
    """Return the model with the spreads of a tick that its first parts had."""
    import numpy as np  # noqa: PLC0415

    spread = [1.0 / value for value in model.plan.over_spread]
    rows = np.array([one.left for one in seen]) if seen else np.zeros((0, len(spread) * scales.COUNT))
    for at, kind in enumerate(model.plan.kinds):
        known = [
            variance[at]
            for usual in own.usual.values()
            for variance, told in zip(usual.variance, usual.told, strict=True)
            if told[at] >= SPREAD_PARTS_MIN
        ]
        if known:
            spread[at] = max(float(np.quantile(known, STEADY_QUANTILE)) ** 0.5, SPREAD_LEAST[Kind(kind)])
        elif kind == Kind.TEMPERATURE and len(rows):
            away = rows[:, at * scales.COUNT + scales.CUT] * LOOSE_TAILS[scales.CUT]
            spread[at] = max(float(np.sqrt(np.mean(away**2))) * spread[at], SPREAD_LEAST[Kind(kind)])
    return model.changed(spread=tuple(spread), gain=_gains(model, seen))


def _gains(model: PartsModel, seen: "list[Seen]") -> tuple[float, ...]:
    """Return how many times as much as its peers the machine feels, by signal."""
    found = []
    for at, kind in enumerate(model.plan.kinds):
        pairs = [(one.felt[at][0], one.shared[at]) for one in seen if one.shared]
        found.append(gain_of(pairs) if kind == Kind.VIBRATION else HARDER_GAIN)
    return tuple(found)


def _taught(model: PartsModel, own: Own, seen: "list[Seen]") -> PartsModel:
    """Return the model with all that the replay has taught it, and with the tails of what was left beside the peers.

    Raises ValueError where no tick was judged.
    """
    import numpy as np  # noqa: PLC0415

    old = [one for one in seen if one.parts >= MATURE_PARTS]
    late = old if len(old) >= MATURE_SHARE * len(seen) else [one for one in seen if one.tick >= seen[-1].tick // YOUNG]
    if not late:
        raise ValueError("no tick is judged outside of tool changes in an operation that came twice: record more parts")
    left = np.array([one.left for one in late]) * np.array([LOOSE_TAILS * len(model.signals)])
    blocks = np.array([one.tick for one in late]) // max(1, round(scales.BLOCK_S / model.tick_s))
    return model.changed(
        up=tuple(scales.tails(left, blocks).tolist()),
        down=tuple(scales.tails(-left, blocks).tolist()),
        usual=dict(list(own.usual.items())[-OPERATIONS_MAX:]),
        material=own.material,
        tools={name: tool.level for name, tool in own.tools.items()},
    )
