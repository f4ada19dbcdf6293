"""Rules that anybody can check by hand: load, thermal runaway, load without feed, vibration zone, the cut beside the twin's.

Each rule is a row of RULES: its name, what it reads, its dwell, and a pure function from the present sample to a judgement: over
its limit, between, under, excused, or unknown with the reason. `processors/rules/alarm.py` makes an alarm of it. A rule whose
inputs are unknown is null, never a silent no. Where a rule alarms, the severity is high; where only the anomaly score does, it is
medium. A new rule is a function in a file `processors/rules/<noun>.py` and a row here.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from typing import NamedTuple

from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.rules.alarm import IDLE, Judgement, Latch, LimitState, Timing, latched, rested
from processors.rules.broken_tool import Evidence
from processors.rules.expected import CUT, LEAST, MOST, RATIO, ExpectedLimits, load_over_expected, tool_broken
from processors.rules.expected import followed as cut_followed
from processors.rules.spindle import (
    EXECUTION,
    FEED,
    LOAD,
    SPEED,
    Known,
    Motion,
    Spindle,
    SpindleLimits,
    load_over_limit,
    load_without_feed,
    motion,
    spindle_load,
)
from processors.rules.spindle import followed as spindle_followed
from processors.rules.temperature import TEMPERATURE, TemperatureLimits, Trend, thermal_runaway
from processors.rules.temperature import followed as trend_followed
from processors.rules.vibration import RAMPS, SOURCES, STANDS, VibrationLimits, Zone, velocity, vibration, zone_of
from processors.sample import why_unknown
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

ANOMALY, RULE = twin_signals.ANOMALY_ALARM, twin_signals.RULE_PREFIX
ZONE, SEVERITY = "twin/vibration_zone", twin_signals.SEVERITY
DETAIL, FINDINGS = twin_signals.RULE_DETAIL, twin_signals.RULE_FINDINGS
LINE = "nc_line"
NONE, MEDIUM, HIGH = "none", "medium", "high"
NO_ANOMALY = f"{ANOMALY} is not offered"
_HOLE, _GOOD, _OVER, _UNKNOWN = SampleKind.HOLE, Quality.GOOD, LimitState.OVER, LimitState.UNKNOWN


class Config(SpindleLimits, TemperatureLimits, VibrationLimits, ExpectedLimits):
    """The limits of all rules; each is described where its rule is."""

    @cached_property
    def rules(self) -> "tuple[tuple[str, Callable[[Given], Judgement], Timing], ...]":
        """The name, the judgement and the timing of each of RULES."""
        return tuple((rule.name, rule.judge, rule.timing(self)) for rule in RULES)


@dataclass(frozen=True, slots=True)
class State:
    """The state of the rules: the spindle's speed, the temperature's trend, the zone, and the alarm of each rule by its name."""

    spindle: Spindle = field(default_factory=Spindle)
    trend: Trend = field(default_factory=Trend)
    zone: Zone | None = None
    latches: Mapping[str, Latch] = field(default_factory=dict)
    cut: Evidence = field(default_factory=Evidence)


class Given(NamedTuple):
    """The inputs that a rule may look at, each read once."""

    config: Config
    sample: Sample
    moves: Motion
    load: Known
    temperature: Known
    trend: Trend
    velocity: Known
    zone: Zone | None
    cut: Evidence


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: it is published as `twin/rule_<name>`.

    shows: the signal that a person should look at
    is_of_programs: it needs an expectation of the NC program; `twin/rule_detail` does not name it where there is none
    """

    name: str
    meaning: str
    reads: frozenset[str]
    timing: Callable[[Config], Timing]
    judge: Callable[[Given], Judgement]
    shows: str
    is_of_programs: bool = False

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
        lambda given: load_over_limit(given.config, given.moves, given.load),
        LOAD,
    ),
    Rule(
        "thermal_runaway",
        "the spindle's temperature rises faster than it may",
        frozenset({TEMPERATURE}),
        lambda config: Timing(config.runaway_dwell_s, config.runaway_clear_s),
        lambda given: thermal_runaway(given.config, given.trend, given.temperature),
        TEMPERATURE,
    ),
    Rule(
        "load_without_feed",
        "the spindle turns under load while the program runs and nothing is fed",
        frozenset({LOAD, SPEED, FEED, EXECUTION}),
        lambda config: Timing(config.no_feed_dwell_s, config.no_feed_clear_s),
        lambda given: load_without_feed(given.config, given.moves, given.load, given.sample),
        LOAD,
    ),
    Rule(
        "vibration",
        "the velocity of vibration is in a zone that alarms",
        frozenset({SPEED, *SOURCES}),
        lambda config: Timing(config.vibration_dwell_s, config.vibration_clear_s),
        lambda given: vibration(given.config, given.moves, given.zone, given.velocity),
        SOURCES[0],
    ),
    Rule(
        "tool_broken",
        "the twin expects a cut, and the spindle runs as in air",
        frozenset({CUT, LEAST, MOST, RATIO, SPEED, FEED}),
        lambda config: Timing(0.0, config.tool_broken_clear_s),
        lambda given: tool_broken(given.config, given.moves, given.sample, given.cut),
        LOAD,
        is_of_programs=True,
    ),
    Rule(
        "load_over_expected",
        "the cut takes far more than the twin expects: a collision, packed chips",
        frozenset({CUT, MOST, RATIO, SPEED}),
        lambda config: Timing(config.over_expected_s, config.over_expected_clear_s),
        lambda given: load_over_expected(given.config, given.moves, given.sample),
        LOAD,
        is_of_programs=True,
    ),
)


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Judge every sample: what is held counts as long as it is held."""
    if sample.kind is _HOLE:
        if sample.gap_s >= config.gap_s_max:
            return State(), _outputs((sample.detail,) * len(RULES), False, sample.detail, _anomaly(sample))
        state = _over_hole(state, sample)
    at_s, latches = sample.at_s, state.latches
    spindle = spindle_followed(state.spindle, config, sample)
    moves, load, speed_mm_s = motion(spindle, config, at_s), spindle_load(sample), velocity(sample)
    temperature = sample.number(TEMPERATURE)
    trend = trend_followed(state.trend, config, temperature[0], at_s)
    zone, no_zone = _zone(config, state.zone, moves, speed_mm_s)
    cut = cut_followed(state.cut, config, moves, sample)
    given = tuple.__new__(Given, (config, sample, moves, load, temperature, trend, speed_mm_s, zone, cut))
    stands: list[Stand] = []
    for name, judge, timing in config.rules:
        judgement = judge(given)
        limit_state, latch = judgement.limit_state, latches.get(name, IDLE)
        if latch is not IDLE or limit_state is _OVER:  # an idle alarm stays idle otherwise, as nearly always
            before, latch = latch, latched(latch, judgement, timing, at_s)
            if latch is not before:
                if before.alarm_s is None and latch.alarm_s is not None:
                    latch = latch._replace(line=_line(sample))
                latches = {rule.name: latches.get(rule.name, IDLE) for rule in RULES} | {name: latch}
        stands.append(judgement.reason if limit_state is _UNKNOWN else None if latch.alarm_s is None else latch)
    zone_name = no_zone if zone is None else zone.value
    return State(spindle, trend, zone, latches, cut), _outputs(tuple(stands), zone is not None, zone_name, _anomaly(sample))


def _over_hole(state: State, sample: Sample) -> State:
    """Return the state after a short hole: no dwell runs on; a trend whose points lie ahead of the clock now is let go."""
    latches = {name: rested(latch) for name, latch in state.latches.items()}
    newest_s = max((at_s for at_s, _ in state.trend.points), default=sample.at_s)
    is_ahead = max(newest_s, state.trend.stray_s or newest_s) > sample.at_s
    cut = Evidence(noise_pct2=state.cut.noise_pct2, misled=state.cut.misled)
    return State(Spindle(), Trend() if is_ahead else state.trend, state.zone, latches, cut)


def _zone(config: Config, before: Zone | None, moves: Motion, found: Known) -> tuple[Zone | None, str]:
    """The zone of vibration; None with the reason."""
    velocity_mm_s, why_not = found
    if velocity_mm_s is None or moves.rpm is None:
        return None, why_not or moves.why_not
    if not moves.is_turning or moves.is_ramping:
        return None, RAMPS if moves.is_turning else STANDS
    return zone_of(config, velocity_mm_s, before), ""


Stand = Latch | str | None
"""A rule as it stands: its alarm, None without one, or the reason why it is not judged."""


@lru_cache(maxsize=2000)
def _outputs(stands: tuple[Stand, ...], has_zone: bool, zone: str, anomaly: bool | str) -> tuple[Output, ...]:
    """All metrics; `zone` says why there is none where there is none. The same objects are the answer while nothing changes."""
    outputs: list[Output] = []
    alarms: list[str] = []
    findings: dict[str, dict[str, float | int | str]] = {}
    unknown: list[str] = []
    judged = False
    for rule, stand in zip(RULES, stands, strict=True):
        if isinstance(stand, str):
            if not (rule.is_of_programs and stand.startswith(CUT)):
                unknown.append(rule.name)
            outputs.append(Output.null(rule.metric, stand))
            continue
        judged = True
        outputs.append(Output(rule.metric, stand is not None))
        if stand is not None and stand.alarm_s is not None:
            text, value, limit, unit = stand.finding
            alarms.append(f"{rule.name}: {text}, since {_utc(stand.alarm_s)}")
            at_ms = round(stand.alarm_s * 1000)
            found = findings[rule.name] = {"value": round(value, 3), "limit": round(limit, 3), "unit": unit, "since": at_ms}
            found["signal"] = rule.shows
            if stand.line is not None:
                found["line"] = stand.line
    outputs.append(Output(ZONE, zone) if has_zone else Output.null(ZONE, zone))
    if not judged:
        reason = outputs[0].reason or ""
        outputs += [Output.null(DETAIL, reason), Output.null(FINDINGS, reason)]
        if isinstance(anomaly, str):
            return (*outputs, Output.null(SEVERITY, f"no rule and no score can be judged: {reason}; {anomaly}"))
    else:
        left = f" (not judged: {', '.join(unknown)})" if unknown else ""
        outputs.append(Output(DETAIL, "; ".join(alarms or [NONE]) + left))
        outputs.append(Output(FINDINGS, json.dumps(findings, separators=(",", ":")) if findings else "{}"))
    return (*outputs, Output(SEVERITY, HIGH if alarms else MEDIUM if anomaly is True else NONE))


def _anomaly(sample: Sample) -> bool | str:
    """Return True if the anomaly score alarms; the reason where that is not known."""
    reading = sample.row.get(ANOMALY)
    if reading is None:
        return NO_ANOMALY
    value = reading.value
    if type(value) is bool and reading.quality is _GOOD:
        return value
    return why_unknown(reading) or f"{ANOMALY} is no BOOLEAN"


def _line(sample: Sample) -> int | None:
    reading = sample.row.get(LINE)
    value = None if reading is None or reading.quality is not _GOOD else reading.value
    return value if isinstance(value, int) else None


def _utc(at_s: float) -> str:
    """A moment as people read it, to the second."""
    try:
        return f"{datetime.fromtimestamp(at_s, UTC).isoformat(timespec='seconds').removesuffix('+00:00')}Z"
    except (ValueError, OverflowError, OSError):
        return f"{at_s:.0f} s"


_INFERRED = Provenance.INFERRED
PROCESSOR = Processor(
    name="rules",
    version=3,
    inputs=frozenset({ANOMALY, LINE}).union(*(rule.reads for rule in RULES)),
    outputs=(
        *(OutputSpec(rule.metric, DataType.BOOLEAN, None, rule.meaning, _INFERRED, is_alarm=True) for rule in RULES),
        OutputSpec(ZONE, DataType.STRING, None, "ISO zone of the vibration's velocity, A to D", _INFERRED),
        OutputSpec(SEVERITY, DataType.STRING, None, "none; medium: only the anomaly score alarms; high: a rule does", _INFERRED),
        OutputSpec(DETAIL, DataType.STRING, None, "which rules alarm: value, limit, since when; and which cannot say", _INFERRED),
        OutputSpec(FINDINGS, DataType.STRING, None, "JSON: value, limit, unit, since when of each rule that alarms", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
