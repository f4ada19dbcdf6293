"""Rules that anybody can check by hand: load over limit, thermal runaway, load without feed, vibration zone.

Each rule is a row of RULES: its name, what it reads, its dwell, and a pure function from the present sample to a judgement: over
its limit, between, under, excused, or unknown with the reason. `processors/rules/alarm.py` makes an alarm of it. A rule whose
inputs are unknown is null, never a silent no. Where a rule alarms, the severity is high; where only the anomaly score does, it is
medium. A new rule is a function in a file `processors/rules/<noun>.py` and a row here.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import NamedTuple

from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.rules.alarm import IDLE, Judgement, Latch, LimitState, Timing, latched, rested
from processors.rules.spindle import (
    EXECUTION,
    FEED,
    LOAD,
    SPEED,
    Motion,
    Spindle,
    SpindleLimits,
    load_over_limit,
    load_without_feed,
    motion,
)
from processors.rules.spindle import followed as spindle_followed
from processors.rules.temperature import TEMPERATURE, TemperatureLimits, Trend, thermal_runaway
from processors.rules.temperature import followed as trend_followed
from processors.rules.vibration import RAMPS, SOURCES, STANDS, VibrationLimits, Zone, velocity, vibration, zone_of
from processors.sample import why_unknown
from sparkplug.datatype import DataType
from twin.vocabulary import twin_signals

ANOMALY, RULE = twin_signals.ANOMALY_ALARM, twin_signals.RULE_PREFIX
ZONE, SEVERITY, DETAIL = "twin/vibration_zone", twin_signals.SEVERITY, twin_signals.RULE_DETAIL
NONE, MEDIUM, HIGH = "none", "medium", "high"


class Config(SpindleLimits, TemperatureLimits, VibrationLimits):
    """The limits of all rules; each is described where its rule is."""


@dataclass(frozen=True, slots=True)
class State:
    """The state of the rules: the spindle's speed, the temperature's trend, the zone, and the alarm of each rule by its name."""

    spindle: Spindle = field(default_factory=Spindle)
    trend: Trend = field(default_factory=Trend)
    zone: Zone | None = None
    latches: Mapping[str, Latch] = field(default_factory=dict)


class Given(NamedTuple):
    """The inputs that a rule may look at."""

    config: Config
    state: State
    moves: Motion
    sample: Sample


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: it is published as `twin/rule_<name>`."""

    name: str
    meaning: str
    reads: frozenset[str]
    timing: Callable[[Config], Timing]
    judge: Callable[[Given], Judgement]

    @property
    def metric(self) -> str:
        """Its metric."""
        return RULE + self.name


RULES = (
    Rule(
        "load_over_limit",
        "the spindle's load is over its limit, at a speed that is not being changed",
        frozenset({LOAD, SPEED}),
        lambda config: Timing(config.load_dwell_s, config.load_clear_s),
        lambda given: load_over_limit(given.config, given.moves, given.sample),
    ),
    Rule(
        "thermal_runaway",
        "the spindle's temperature rises faster than it may",
        frozenset({TEMPERATURE}),
        lambda config: Timing(config.runaway_dwell_s, config.runaway_clear_s),
        lambda given: thermal_runaway(given.config, given.state.trend, given.sample),
    ),
    Rule(
        "load_without_feed",
        "the spindle turns under load while the program runs and nothing is fed",
        frozenset({LOAD, SPEED, FEED, EXECUTION}),
        lambda config: Timing(config.no_feed_dwell_s, config.no_feed_clear_s),
        lambda given: load_without_feed(given.config, given.moves, given.sample),
    ),
    Rule(
        "vibration",
        "the velocity of vibration is in a zone that alarms",
        frozenset({SPEED, *SOURCES}),
        lambda config: Timing(config.vibration_dwell_s, config.vibration_clear_s),
        lambda given: vibration(given.config, given.moves, given.state.zone, given.sample),
    ),
)


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Judge every sample: what is held counts as long as it is held."""
    if sample.kind is SampleKind.HOLE:
        if sample.gap_s >= config.gap_s_max:
            return State(), _outputs(State(), {}, Judgement(LimitState.UNKNOWN, sample.detail), sample)
        state = _over_hole(state, sample)
    spindle = spindle_followed(state.spindle, config, sample)
    moves = motion(spindle, config, sample.at_s)
    zone, no_zone = _zone(config, state.zone, moves, sample)
    state = State(spindle, trend_followed(state.trend, config, sample), zone, state.latches)
    given = Given(config, state, moves, sample)
    judged, latches, is_moved = {}, {}, False
    for rule in RULES:
        judged[rule.name] = judgement = rule.judge(given)
        before = state.latches.get(rule.name, IDLE)
        latches[rule.name] = latch = latched(before, judgement, rule.timing(config), sample.at_s)
        is_moved = is_moved or latch is not before
    if is_moved:
        state = State(spindle, state.trend, zone, latches)
    return state, _outputs(state, judged, Judgement(LimitState.UNKNOWN, no_zone), sample)


def _over_hole(state: State, sample: Sample) -> State:
    """Return the state after a short hole: no dwell runs on; a trend whose points lie ahead of the clock now is let go."""
    latches = {name: rested(latch) for name, latch in state.latches.items()}
    newest_s = max((at_s for at_s, _ in state.trend.points), default=sample.at_s)
    is_ahead = max(newest_s, state.trend.stray_s or newest_s) > sample.at_s
    return State(Spindle(), Trend() if is_ahead else state.trend, state.zone, latches)


def _zone(config: Config, before: Zone | None, moves: Motion, sample: Sample) -> tuple[Zone | None, str]:
    """The zone of vibration; None with the reason."""
    velocity_mm_s, why_not = velocity(sample)
    if velocity_mm_s is None or moves.rpm is None:
        return None, why_not or moves.why_not
    if not moves.is_turning or moves.is_ramping:
        return None, RAMPS if moves.is_turning else STANDS
    return zone_of(config, velocity_mm_s, before), ""


def _outputs(state: State, judged: Mapping[str, Judgement], no_zone: Judgement, sample: Sample) -> tuple[Output, ...]:
    """All metrics. Without judgements nothing is known, for the reason that there is no zone."""
    outputs, alarms, unknown = [], [], []
    for rule in RULES:
        judgement = judged.get(rule.name, no_zone)
        latch = state.latches.get(rule.name, IDLE)
        if judgement.limit_state is LimitState.UNKNOWN:
            unknown.append(rule.name)
            outputs.append(Output.null(rule.metric, judgement.reason))
            continue
        outputs.append(Output(rule.metric, latch.is_alarm))
        if latch.alarm_s is not None:
            alarms.append(f"{rule.name}: {latch.finding}, since {_utc(latch.alarm_s)}")
    outputs.append(Output(ZONE, state.zone.value) if state.zone is not None else Output.null(ZONE, no_zone.reason))
    anomaly, no_anomaly = _anomaly(sample)
    if len(unknown) == len(RULES):
        reason = judged.get(RULES[0].name, no_zone).reason
        outputs.append(Output.null(DETAIL, reason))
        if anomaly is None:
            return (*outputs, Output.null(SEVERITY, f"no rule and no score can be judged: {reason}; {no_anomaly}"))
    else:
        left = f" (not judged: {', '.join(unknown)})" if unknown else ""
        outputs.append(Output(DETAIL, "; ".join(alarms or [NONE]) + left))
    return (*outputs, Output(SEVERITY, HIGH if alarms else MEDIUM if anomaly else NONE))


def _anomaly(sample: Sample) -> tuple[bool | None, str]:
    """Return True if the anomaly score alarms; None with the reason."""
    reading = sample.row.get(ANOMALY)
    reason = f"{ANOMALY} is not offered" if reading is None else why_unknown(reading)
    if reading is None or reason is not None:
        return None, reason or ""
    return (reading.value, "") if isinstance(reading.value, bool) else (None, f"{ANOMALY} is no BOOLEAN")


def _utc(at_s: float) -> str:
    """A moment as people read it, to the second."""
    try:
        return f"{datetime.fromtimestamp(at_s, UTC).isoformat(timespec='seconds').removesuffix('+00:00')}Z"
    except (ValueError, OverflowError, OSError):
        return f"{at_s:.0f} s"


_INFERRED = Provenance.INFERRED
PROCESSOR = Processor(
    name="rules",
    version=1,
    inputs=frozenset({ANOMALY}).union(*(rule.reads for rule in RULES)),
    outputs=(
        *(OutputSpec(rule.metric, DataType.BOOLEAN, None, rule.meaning, _INFERRED, is_alarm=True) for rule in RULES),
        OutputSpec(ZONE, DataType.STRING, None, "ISO zone of the vibration's velocity, A to D", _INFERRED),
        OutputSpec(SEVERITY, DataType.STRING, None, "none; medium: only the anomaly score alarms; high: a rule does", _INFERRED),
        OutputSpec(DETAIL, DataType.STRING, None, "which rules alarm: value, limit, since when; and which cannot say", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
