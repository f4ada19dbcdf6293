"""The alarm of a rule: when its condition becomes one, and when that ends; dwell and hysteresis, in event time.

A condition that is over its limit for `dwell_s` without a break raises the alarm; one that is under the lower limit for `clear_s`
without a break ends it; in between, an alarm stays and none is raised. While a rule is excused (the spindle changes its speed)
or its inputs are unknown, neither clock runs, and an alarm stays what it was: nothing has shown that it is over.
"""

from enum import Enum
from typing import NamedTuple


class LimitState(Enum):
    """The position of a rule's value against its limits."""

    OVER = "over"
    BETWEEN = "between"
    UNDER = "under"
    EXCUSED = "excused"
    UNKNOWN = "unknown"


_OVER, _UNDER, _UNKNOWN = LimitState.OVER, LimitState.UNDER, LimitState.UNKNOWN


class Finding(NamedTuple):
    """The value that is over which limit, both in `unit`; `text` says so in words."""

    text: str = ""
    value: float = 0.0
    limit: float = 0.0
    unit: str = ""


NO_FINDING = Finding()


class Judgement(NamedTuple):
    """The judgement of a rule at one moment. `reason`: why it is unknown; `finding`: what is over its limit."""

    limit_state: LimitState
    reason: str = ""
    finding: Finding = NO_FINDING


BETWEEN, UNDER, EXCUSED = Judgement(LimitState.BETWEEN), Judgement(LimitState.UNDER), Judgement(LimitState.EXCUSED)


def unknown(reason: str) -> Judgement:
    """Return the judgement that there is none."""
    return Judgement(_UNKNOWN, reason)


def over(text: str, value: float, limit: float, unit: str) -> Judgement:
    """Return the judgement that a value is over its limit, or under one that is a least."""
    return Judgement(_OVER, "", Finding(text, value, limit, unit))


class Timing(NamedTuple):
    """The time over the limit until it alarms, and under the lower one until it ends."""

    dwell_s: float
    clear_s: float


class Latch(NamedTuple):
    """One rule's alarm.

    alarm_s: since when the condition held that raised it; None = no alarm
    finding, line: what was over which limit, and in which NC line, when it was raised; line None: not known
    over_s, under_s: since when the value has been over, under, without a break
    """

    alarm_s: float | None = None
    finding: Finding = NO_FINDING
    over_s: float | None = None
    under_s: float | None = None
    line: int | None = None

    @property
    def is_alarm(self) -> bool:
        """True while it alarms."""
        return self.alarm_s is not None


IDLE = Latch()


def within(value: float, limit: float, clear_limit: float) -> Judgement | None:
    """Return how `value` stands to a limit and the lower one at which an alarm ends; None where it is over the limit.

    >>> [within(110.0, 110.0, 100.0).limit_state.value, within(99.0, 110.0, 100.0).limit_state.value]
    ['between', 'under']
    >>> within(111.0, 110.0, 100.0) is None
    True
    """
    if value > limit:
        return None
    return BETWEEN if value >= clear_limit else UNDER


def latched(latch: Latch, judgement: Judgement, timing: Timing, at_s: float) -> Latch:
    """The alarm after one more judgement."""
    limit_state, alarm_s = judgement.limit_state, latch.alarm_s
    if alarm_s is None and limit_state is not _OVER:  # what nearly every judgement is
        return rested(latch)
    if limit_state is _OVER:
        over_s = at_s if latch.over_s is None else latch.over_s
        if alarm_s is None and at_s - over_s >= timing.dwell_s:
            return Latch(over_s, judgement.finding, over_s)
        return latch if latch.over_s is not None and latch.under_s is None else latch._replace(over_s=over_s, under_s=None)
    if limit_state is _UNDER:
        under_s = at_s if latch.under_s is None else latch.under_s
        if at_s - under_s >= timing.clear_s:
            return IDLE
        return latch if latch.under_s is not None and latch.over_s is None else latch._replace(over_s=None, under_s=under_s)
    return rested(latch)


def rested(latch: Latch) -> Latch:
    """The alarm as it is, both clocks stopped."""
    return latch if latch.over_s is None and latch.under_s is None else latch._replace(over_s=None, under_s=None)
