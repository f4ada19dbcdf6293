"""Rules on the spindle's drive: load over limit, and load without feed. Both are excused while the spindle changes its speed.

A spindle that runs up or brakes takes up to twice its rated power for a second or two, and that is what it is built for. From one
reported speed to the next, over at most a second,

    |Δn| / min(max(Δt, 0.1 s), 1 s) > ramp_rpm_per_s

is a ramp: a speed that is reported by exception has last been seen long ago, and changed just now. The slow drift of a lathe
at constant surface speed is none. A ramp that does not end within `ramp_s_max` excuses nothing. The commanded speed is no
help: at constant surface speed the control's actual speed is far from it, and a spindle that stalls is too.
"""

from typing import NamedTuple, Self

from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from processors.config import ProcessorConfig
from processors.rules.alarm import EXCUSED, UNDER, Judgement, over, unknown, within
from processors.sample import Sample, why_unknown
from twin.vocabulary.bounds import SPINDLE_LOAD_PCT_MAX, SPINDLE_RPM_MAX

LOAD, SPEED, FEED, EXECUTION = "spindle_load_pct", "spindle_rpm", "feed_mm_min", "exec_state"
NOT_OFFERED = f"{EXECUTION} is not offered"
REPORT_S_MIN, REPORT_S_MAX = 0.1, 1.0
Known = tuple[float | None, str | None]
"""A number, or None with the reason."""


class SpindleLimits(ProcessorConfig):
    """Limits of the load, and what a ramp is."""

    load_limit_pct: PositiveFloat = 110.0
    load_clear_pct: PositiveFloat = 100.0
    load_dwell_s: NonNegativeFloat = 5.0
    load_clear_s: NonNegativeFloat = 5.0
    no_feed_load_pct: PositiveFloat = 60.0
    no_feed_clear_pct: PositiveFloat = 50.0
    no_feed_mm_min: PositiveFloat = 1.0
    no_feed_dwell_s: NonNegativeFloat = 5.0
    no_feed_clear_s: NonNegativeFloat = 2.0
    exec_states: tuple[str, ...] = ("ACTIVE",)
    spindle_rpm_min: PositiveFloat = 100.0
    ramp_rpm_per_s: PositiveFloat = 200.0
    ramp_settle_s: NonNegativeFloat = 2.0
    ramp_s_max: PositiveFloat = 20.0

    @model_validator(mode="after")
    def _alarms_end_below_where_they_begin(self) -> Self:
        if self.load_clear_pct > self.load_limit_pct:
            raise ValueError(f"load_clear_pct {self.load_clear_pct:g} is above load_limit_pct {self.load_limit_pct:g}")
        if self.no_feed_clear_pct > self.no_feed_load_pct:
            raise ValueError(f"no_feed_clear_pct {self.no_feed_clear_pct:g} is above no_feed_load_pct {self.no_feed_load_pct:g}")
        return self


class Spindle(NamedTuple):
    """The spindle's speed as it was last reported, and its ramp.

    rpm: None while it is unknown, with the reason; seen_s: when it was reported
    ramp_s, ramped_s: when the present ramp began and when it was last seen; None = no ramp yet
    """

    rpm: float | None = None
    why_not: str = f"no {SPEED} yet"
    seen_s: float = 0.0
    ramp_s: float | None = None
    ramped_s: float | None = None


class Motion(NamedTuple):
    """The motion of the spindle now. `rpm` None: unknown, with the reason."""

    rpm: float | None
    why_not: str
    is_turning: bool
    is_ramping: bool


def followed(spindle: Spindle, limits: SpindleLimits, sample: Sample) -> Spindle:
    """The spindle as of this sample."""
    rpm, reason = sample.number(SPEED)
    if rpm is None or abs(rpm) > SPINDLE_RPM_MAX:
        why_not = reason or f"{SPEED} is beyond any spindle"
        return spindle if spindle.rpm is None and spindle.why_not == why_not else Spindle(None, why_not, sample.at_s)
    at_s, before_rpm = sample.at_s, spindle.rpm
    if before_rpm is None:
        return Spindle(rpm, "", at_s)
    if rpm == before_rpm:
        if SPEED not in sample.changed:
            return spindle
        return Spindle(before_rpm, spindle.why_not, at_s, spindle.ramp_s, spindle.ramped_s)
    passed_s = at_s - spindle.seen_s
    report_s = REPORT_S_MIN if passed_s < REPORT_S_MIN else REPORT_S_MAX if passed_s > REPORT_S_MAX else passed_s
    if abs(rpm - before_rpm) <= limits.ramp_rpm_per_s * report_s:
        return tuple.__new__(Spindle, (rpm, spindle.why_not, at_s, spindle.ramp_s, spindle.ramped_s))
    goes_on = spindle.ramped_s is not None and at_s - spindle.ramped_s <= limits.ramp_settle_s
    return Spindle(rpm, "", at_s, spindle.ramp_s if goes_on else at_s, at_s)


def motion(spindle: Spindle, limits: SpindleLimits, at_s: float) -> Motion:
    """Return the motion of the spindle at `at_s`."""
    rpm, ramp_s, ramped_s = spindle.rpm, spindle.ramp_s, spindle.ramped_s
    if rpm is None:
        return Motion(None, spindle.why_not, False, False)
    ramping = False
    if ramp_s is not None and ramped_s is not None:
        ramping = at_s - ramped_s <= limits.ramp_settle_s and at_s - ramp_s <= limits.ramp_s_max
    return tuple.__new__(Motion, (rpm, "", abs(rpm) >= limits.spindle_rpm_min, ramping))


def spindle_load(sample: Sample) -> Known:
    """Return the load, whatever the direction of the torque."""
    load_pct, reason = sample.number(LOAD)
    if load_pct is None:
        return None, reason
    load_pct = abs(load_pct)
    return (None, f"{LOAD} is beyond any spindle") if load_pct > SPINDLE_LOAD_PCT_MAX else (load_pct, None)


def load_over_limit(limits: SpindleLimits, moves: Motion, load: Known) -> Judgement:
    """Load over its limit."""
    load_pct, why_not = load
    if load_pct is None or moves.rpm is None:
        return unknown(why_not or moves.why_not)
    if moves.is_ramping:
        return EXCUSED
    judgement = within(load_pct, limits.load_limit_pct, limits.load_clear_pct)
    return judgement or over(f"{LOAD} {load_pct:.0f} % over {limits.load_limit_pct:g} %", load_pct, limits.load_limit_pct, "%")


def load_without_feed(limits: SpindleLimits, moves: Motion, load: Known, sample: Sample) -> Judgement:
    """Load on a spindle that turns at its speed while the program runs and nothing is fed: it rubs, or something is wound up."""
    load_pct, why_not = load
    feed, no_feed = sample.number(FEED)
    running, not_known = _is_running(limits, sample)
    if load_pct is None or feed is None or running is None or moves.rpm is None:
        return unknown(why_not or no_feed or not_known or moves.why_not)
    if moves.is_ramping:
        return EXCUSED
    if not running or not moves.is_turning or abs(feed) >= limits.no_feed_mm_min:
        return UNDER
    judgement = within(load_pct, limits.no_feed_load_pct, limits.no_feed_clear_pct)
    if judgement is not None:
        return judgement
    limit = f"{load_pct:.0f} % over {limits.no_feed_load_pct:g} %"
    text = f"{LOAD} {limit} with {FEED} below {limits.no_feed_mm_min:g} mm/min"
    return over(text, load_pct, limits.no_feed_load_pct, "%")


def _is_running(limits: SpindleLimits, sample: Sample) -> tuple[bool | None, str]:
    """Return True if the program runs; None with the reason. Without any state to ask for, it is taken to run."""
    if not limits.exec_states:
        return True, ""
    reading = sample.row.get(EXECUTION)
    if reading is None:
        return None, NOT_OFFERED
    reason = why_unknown(reading)
    return (reading.value in limits.exec_states, "") if reason is None else (None, reason)
