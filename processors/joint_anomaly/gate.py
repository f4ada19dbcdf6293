"""The tool-change gate of one machine, in event time: from the look-back before a change to the tail after its end.

    gated(t) = rise − look_back < t ≤ fall + tail   of any change, tail and look-back being whole ticks

The tail runs from the falling edge. A tick at the time of an edge does not see it yet, as it sees no other value of that time, so
that the gate is that of `twin/anomaly/gate.py` over the ticks; one difference: a change that comes and goes between two ticks is
none there. A change whose end is never told stops gating after `gate_s_max`: a switch that sticks must not mute a machine for
good. What nobody tells is unknown, and gates nothing.
"""

from typing import NamedTuple

from processors.tool_change_detector.context import NONE, STALE, ToolChangeContext

CHANGES_MAX = 64  # that are remembered, while scores wait for what a late label says of them
HALF_MS_S = 0.0005  # event times are whole ms, which floats of seconds are not


class GateRule(NamedTuple):
    """All in s of event time."""

    tail_s: float
    look_back_s: float
    gate_s_max: float


class Change(NamedTuple):
    """A tool change; fall_s None while it lasts."""

    rise_s: float
    fall_s: float | None = None


class Gate(NamedTuple):
    """The changes that may still matter, oldest first, and what is said now."""

    changes: tuple[Change, ...] = ()
    said: ToolChangeContext = ToolChangeContext(None, NONE, reason="nothing is known yet")


class Gated(NamedTuple):
    """The gate at a score: `is_on` None = nobody can tell, with the reason; the source says who did."""

    is_on: bool | None
    source: str
    reason: str | None = None


def followed(gate: Gate, rule: GateRule, said: ToolChangeContext, at_s: float) -> Gate:
    """The gate after what is said at `at_s`; an edge counts from its own time, which is never later."""
    if said == gate.said:
        return gate
    changes = gate.changes
    last = changes[-1] if changes else None
    since_s = min(said.since_s, at_s)
    if said.active and (last is None or last.fall_s is not None):
        changes = (*(change for change in changes if _matters(change, rule, at_s)), Change(since_s))[-CHANGES_MAX:]
    elif said.active is False and said.source != STALE and last is not None and last.fall_s is None:
        changes = (*changes[:-1], Change(last.rise_s, max(since_s, last.rise_s)))
    return Gate(changes, said)


def restarted(gate: Gate, at_s: float) -> Gate:
    """The gate after event time has jumped: a change that lasts goes on, as of now; what is over is forgotten."""
    return Gate((Change(at_s),) if gate.changes and gate.changes[-1].fall_s is None else (), gate.said)


def gated(gate: Gate, rule: GateRule, at_s: float) -> Gated:
    """Return whether a score as of `at_s` is gated, as far as is known by now.

    >>> rule = GateRule(tail_s=8.0, look_back_s=10.0, gate_s_max=180.0)
    >>> gate = followed(Gate(), rule, ToolChangeContext(True, "controller", 100.0), 100.0)
    >>> gate = followed(gate, rule, ToolChangeContext(False, "controller", 104.0), 104.5)
    >>> [at_s for at_s in range(88, 115) if gated(gate, rule, at_s).is_on][::21]
    [91, 112]
    """
    said = gate.said
    for rise_s, fall_s in gate.changes:
        until_s = rise_s + rule.gate_s_max if fall_s is None else fall_s + rule.tail_s
        if rise_s - rule.look_back_s + HALF_MS_S < at_s < until_s + HALF_MS_S:
            return Gated(True, STALE if said.active is None else said.source)  # what was said of the change still holds
    if said.active is None or said.source == STALE:
        return Gated(None, said.source, f"not gated: {said.reason}")
    if said.active and gate.changes and gate.changes[-1].rise_s <= at_s:
        return Gated(None, STALE, f"not gated: a tool change has not ended within {rule.gate_s_max:g} s")
    return Gated(False, said.source)


def _matters(change: Change, rule: GateRule, at_s: float) -> bool:
    """Return True if a score that still waits may be gated by it."""
    if change.fall_s is None:
        return True
    return change.fall_s + rule.tail_s > at_s - 2.0 * (rule.look_back_s + rule.gate_s_max)
