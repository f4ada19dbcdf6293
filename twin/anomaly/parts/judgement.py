"""The judgement of a machine at a tick."""

from typing import NamedTuple

from twin.anomaly.parts.alarms.why import Why


class Judged(NamedTuple):
    """score: in tails of healthy parts, None where it is not known, for `reason`; own_score: before the peers
    is_idle: nothing new was told at this tick (a gate, a spindle that stands), so it counts neither for nor against an alarm
    why: what the score rests on most; None where the score is next to nothing
    knows: what is known of the operation that runs, as "12 parts", "the twin only", "nothing: program O12 is new"
    shared: what the peers feel, by signal, for the next tick (`shared.py`); () = as it was
    signature: what is left beside the peers, in tails, signed: signal by signal, each on all scales
    """

    score: float | None
    own_score: float | None
    reason: str | None = None
    is_idle: bool = False
    why: Why | None = None
    knows: str = ""
    signature: tuple[float, ...] = ()
    shared: tuple[float, ...] = ()
