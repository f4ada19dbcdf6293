"""One run of a program while it lasts: what was done with which tool, and the figures of it, in bounded space.

Seconds are added up by what the machine was doing, so that a clock that is set does not change them. Numbers are looked at once a
tick (a second), values held; peaks of force and vibration at each message.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

from processors.alarms import machine_alarms
from processors.events.execution import ACTIVE, OVERRIDES, tool
from processors.sample import Sample, SampleKind
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals

TEMPERATURE, FORCE, SCORE = "spindle_temp_c", twin_signals.CUTTING_FORCE_N, twin_signals.ADJUSTED_SCORE
VIBRATION = ("vibration_velocity_mm_s", twin_signals.VIBRATION_VELOCITY_MM_S)
GAPS = (
    f"{twin_signals.GAP_PREFIX}spindle_temp_c",
    f"{twin_signals.GAP_PREFIX}spindle_load_pct",
    f"{twin_signals.GAP_PREFIX}spindle_rpm",
    *(f"{twin_signals.GAP_PREFIX}axis_{axis}_load_pct" for axis in "xyzabc"),
)
BASES = (
    twin_signals.SPINDLE_TEMP_BASIS,
    twin_signals.CUTTING_FORCE_BASIS,
    twin_signals.GAP_BASIS,
    twin_signals.ANOMALY_BASIS,
    twin_signals.RESIDUAL_BASIS,
)
FIGURES_BESIDE = (SCORE, *VIBRATION, *OVERRIDES, *GAPS)
FIGURES = (TEMPERATURE, *FIGURES_BESIDE)
TOOLS_MAX, REASONS_MAX, FLAGS_MAX, PROFILE_MAX = 24, 12, 40, 240
OTHER_TOOLS = -1
MINUTE_S = 60.0
FIGURE_MAX = 1e9
_DATA, _GOOD = SampleKind.DATA, Quality.GOOD


@dataclass(frozen=True, slots=True)
class Figure:
    """A number over the run: weighted by time, with its extremes and its last value."""

    low: float
    high: float
    last: float
    seconds: float = 0.0
    sum: float = 0.0

    @property
    def mean(self) -> float:
        """The mean over time; of no time, the last value."""
        return self.sum / self.seconds if self.seconds > 0.0 else self.last


@dataclass(frozen=True, slots=True)
class ToolUse:
    """A tool (None: none or not known; OTHER_TOOLS: beyond the bound): how often it was put in, seconds ACTIVE, its force."""

    number: int | None
    changes: int = 0
    active_s: float = 0.0
    force: Figure | None = None


@dataclass(frozen=True, slots=True)
class Raised:
    """A flag that rose during the run."""

    flag: str
    at_ms: int


@dataclass(frozen=True, slots=True)
class Run:
    """See the module. profile: the mean temperature of each `profile_s`, None where it was not known."""

    program: str | None
    mode: str | None
    began_ms: int
    is_begin_seen: bool
    active_s: float = 0.0
    interrupted_s: float = 0.0
    unknown_s: float = 0.0
    holes: int = 0
    interruptions: int = 0
    reasons: Mapping[str, float] = field(default_factory=dict)
    tools: tuple[ToolUse, ...] = ()
    tool: int | None = None
    tool_changes: int = 0
    figures: Mapping[str, Figure] = field(default_factory=dict)
    raised: tuple[Raised, ...] = ()
    raised_more: int = 0
    profile: tuple[float | None, ...] = ()
    profile_s: float = MINUTE_S
    minute_s: float = 0.0
    minute_sum: float = 0.0
    minute_seen_s: float = 0.0

    @property
    def seconds(self) -> float:
        """The seconds since it began."""
        return self.active_s + self.interrupted_s + self.unknown_s

    def having(self, tools: tuple[ToolUse, ...], figures: Mapping[str, Figure]) -> "Run":
        """Return the run with these. Spelled out, since `replace` looks up each field, and there are many a second."""
        return Run(
            self.program, self.mode, self.began_ms, self.is_begin_seen,
            self.active_s, self.interrupted_s, self.unknown_s, self.holes, self.interruptions, self.reasons,
            tools, self.tool, self.tool_changes, figures, self.raised, self.raised_more,
            self.profile, self.profile_s, self.minute_s, self.minute_sum, self.minute_seen_s,
        )  # fmt: skip


def begun(sample: Sample, program: str | None, mode: str | None, *, is_begin_seen: bool) -> Run:
    """A run that begins now."""
    number = tool(sample.row)
    return Run(program, mode, round(sample.at_s * 1000), is_begin_seen, tool=number, tools=(ToolUse(number),))


def lasted(run: Run, sample: Sample, state: str | None, reason: str, dt_s: float) -> Run:
    """The run after `dt_s` in a state (None: unknown), for a reason where it is not ACTIVE."""
    if state is None:
        return replace(run, unknown_s=run.unknown_s + dt_s)
    active_s, interrupted_s, reasons, tools = run.active_s, run.interrupted_s, run.reasons, run.tools
    if state == ACTIVE and not reason:
        active_s += dt_s
        tools = _with_tool_time(run, sample, dt_s)
    else:
        told = reason if reason in reasons or len(reasons) < REASONS_MAX else "other"
        reasons = {**reasons, told: reasons.get(told, 0.0) + dt_s}
        interrupted_s += dt_s
    figures, row = dict(run.figures), sample.row
    temperature = figure_of(sample, TEMPERATURE)
    if temperature is not None:
        figures[TEMPERATURE] = with_value(figures.get(TEMPERATURE), temperature, dt_s)
    for name in FIGURES_BESIDE:
        if name in row and (value := figure_of(sample, name)) is not None:
            figures[name] = with_value(figures.get(name), value, dt_s)
    return Run(
        run.program, run.mode, run.began_ms, run.is_begin_seen,
        active_s, interrupted_s, run.unknown_s, run.holes, run.interruptions, reasons,
        tools, run.tool, run.tool_changes, figures, run.raised, run.raised_more,
        *_profiled(run, temperature, dt_s),
    )  # fmt: skip


def followed(run: Run, sample: Sample) -> Run:
    """Take what a message tells at once: another tool, a peak, a flag that rises."""
    changed = sample.changed
    if "tool_number" in changed:
        number = tool(sample.row)
        if number is not None and number != run.tool:
            run = replace(run, tool=number, tool_changes=run.tool_changes + 1, tools=_with_change(run.tools, number))
    if FORCE in changed and (force := figure_of(sample, FORCE)) is not None:
        run = run.having(_with_force(run, force, 0.0), run.figures)
    for name in VIBRATION:
        if name in changed and (value := figure_of(sample, name)) is not None:
            run = run.having(run.tools, {**run.figures, name: with_value(run.figures.get(name), value, 0.0)})
    if sample.kind is not _DATA or _alarms().isdisjoint(changed):
        return run  # a birth only says again what stands
    for name in changed:
        if name in _alarms() and _is_up(sample.row[name]):
            if len(run.raised) < FLAGS_MAX:
                run = replace(run, raised=(*run.raised, Raised(name, sample.row[name].timestamp_ms)))
            else:
                run = replace(run, raised_more=run.raised_more + 1)
    return run


@cache
def _alarms() -> frozenset[str]:
    return frozenset(machine_alarms())


def figure_of(sample: Sample, name: str) -> float | None:
    """A number that sums can be made of."""
    value, _ = sample.number(name)
    return value if value is not None and abs(value) <= FIGURE_MAX else None


def with_value(known: Figure | None, value: float, dt_s: float) -> Figure:
    """A figure with one more value, held for `dt_s`.

    >>> with_value(with_value(None, 20.0, 1.0), 26.0, 1.0).mean
    23.0
    """
    if known is None:
        return Figure(value, value, value, dt_s, value * dt_s)
    low, high = known.low, known.high
    if not low <= value <= high:
        low, high = min(low, value), max(high, value)
    return Figure(low, high, value, known.seconds + dt_s, known.sum + value * dt_s)


def _is_up(reading: Reading) -> bool:
    return reading.quality is _GOOD and reading.value is True


def _with_change(tools: tuple[ToolUse, ...], number: int) -> tuple[ToolUse, ...]:
    if any(use.number == number for use in tools):
        return tuple(replace(use, changes=use.changes + 1) if use.number == number else use for use in tools)
    if len(tools) < TOOLS_MAX:
        return (*tools, ToolUse(number, 1))
    return _with_change(tools, OTHER_TOOLS) if number != OTHER_TOOLS else (*tools, ToolUse(OTHER_TOOLS, 1))


def _with_tool_time(run: Run, sample: Sample, dt_s: float) -> tuple[ToolUse, ...]:
    force, number = figure_of(sample, FORCE) if FORCE in sample.row else None, _kept_as(run)
    return tuple(
        [
            ToolUse(
                use.number, use.changes, use.active_s + dt_s, use.force if force is None else with_value(use.force, force, dt_s)
            )
            if use.number == number
            else use
            for use in run.tools
        ]
    )


def _with_force(run: Run, force: float, dt_s: float) -> tuple[ToolUse, ...]:
    number = _kept_as(run)
    return tuple(
        ToolUse(use.number, use.changes, use.active_s, with_value(use.force, force, dt_s)) if use.number == number else use
        for use in run.tools
    )


def _kept_as(run: Run) -> int | None:
    number = run.tool
    for use in run.tools:
        if use.number == number:
            return number
    return OTHER_TOOLS


_Profile = tuple[tuple[float | None, ...], float, float, float, float]
"""profile, profile_s, minute_s, minute_sum, minute_seen_s"""


def _profiled(run: Run, value: float | None, dt_s: float) -> _Profile:
    """The mean temperature of each minute; where there are too many, of twice as long."""
    minute_s = run.minute_s + dt_s
    seen_s = run.minute_seen_s + (0.0 if value is None else dt_s)
    minute_sum = run.minute_sum + (0.0 if value is None else value * dt_s)
    if minute_s < run.profile_s:
        return run.profile, run.profile_s, minute_s, minute_sum, seen_s
    mean = round(minute_sum / seen_s, 2) if seen_s > 0.0 else None
    profile, profile_s = (*run.profile, mean), run.profile_s
    if len(profile) > PROFILE_MAX:
        pairs = zip(profile[::2], profile[1::2], strict=False)
        profile, profile_s = tuple(_mean(first, second) for first, second in pairs), 2.0 * profile_s
    return profile, profile_s, 0.0, 0.0, 0.0


def _mean(first: float | None, second: float | None) -> float | None:
    known = [value for value in (first, second) if value is not None]
    return round(sum(known) / len(known), 2) if known else None
