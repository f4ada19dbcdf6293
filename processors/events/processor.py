"""Execution states as events: what a machine does, how long a program run takes, why it stands, and the record of each part.

MTConnect's words and meaning (`processors/events/execution.py`). A run begins where a program becomes ACTIVE and ends where it is
PROGRAM_COMPLETED, where the control is READY again (it tells no completion), or where another program becomes ACTIVE; what
interrupts it in between is added up by its reason. A state that is not known, or that comes back as it was before (a control that
reconnects says everything again), is no event.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cache, lru_cache
from typing import NamedTuple

from pydantic import Field

from processors.alarms import machine_alarms
from processors.config import ProcessorConfig
from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.events.execution import (
    ACTIVE,
    ALARM,
    CHANGING,
    COMPLETED,
    EXECUTION,
    FEED,
    FEED_OVERRIDE,
    MODE,
    NO_STOP,
    OFFLINE,
    OVERRIDES,
    PROGRAM,
    READY,
    TOOL,
    Execution,
    execution,
    is_held_by_override,
    stop_reason,
    text,
)
from processors.events.record import INPUTS as RECORD_INPUTS
from processors.events.record import record
from processors.events.run import FORCE, VIBRATION, Run, begun, followed, lasted
from processors.events.share import Shares, share_pct, with_time
from sparkplug.datatype import DataType
from twin.vocabulary.twin_signals import PART_RECORD, STOP_REASON, TWIN_PREFIX

STATE, SINCE, STATE_BASIS = f"{TWIN_PREFIX}execution_state", f"{TWIN_PREFIX}execution_since", f"{TWIN_PREFIX}execution_basis"
CYCLE, NUMBER, CYCLE_PROGRAM = f"{TWIN_PREFIX}cycle_time_s", f"{TWIN_PREFIX}cycle_number", f"{TWIN_PREFIX}cycle_program"
INTERRUPTED = f"{TWIN_PREFIX}interrupted_s"
UTILISATION, TODAY = f"{TWIN_PREFIX}utilisation_pct", f"{TWIN_PREFIX}utilisation_today_pct"
STOP, STOP_S, PART = STOP_REASON, f"{TWIN_PREFIX}stop_s", PART_RECORD
WATCHED = frozenset({EXECUTION, PROGRAM, MODE, ALARM, CHANGING, FEED_OVERRIDE})
TOLD_EVERY_S = 60.0
REASONS_MAX = 1000  # whose outputs are remembered
STAMP_MAX_S = 253_402_300_000.0
_DATA, _TICK, _BIRTH, _HOLE = SampleKind.DATA, SampleKind.TICK, SampleKind.BIRTH, SampleKind.HOLE


class Config(ProcessorConfig):
    """The definition of a run, and the window of the share."""

    window_h: float = Field(default=24.0, ge=0.1, le=168.0, description="the rolling window of the utilisation")
    day_begins_h_utc: float = Field(default=0.0, ge=0.0, lt=24.0, description="when a day begins")
    seen_s_min: float = Field(default=600.0, ge=0.0, le=86_400.0, description="of the window, before a share is reported")
    cycle_s_min: float = Field(default=5.0, ge=0.0, le=3600.0, description="a shorter run is no part")
    modes: tuple[str, ...] = Field(default=("AUTOMATIC", "SEMI_AUTOMATIC"), description="a run in another mode is no part")
    feed_mm_min_min: float = Field(default=1.0, gt=0.0, le=1e6, description="without exec_state: ACTIVE from this feed on")


@dataclass(frozen=True, slots=True)
class State:
    """at_s: up to when time is added up; is_blind: what comes after it was not seen; execution: the last state that was known,
    since since_ms; is_known: whether it still is; stop_s: how long the machine has stood; told_s: when shares were last told;
    is_joined: the machine stands as in mid-program, and how it came to that was not heard: going on is no beginning."""

    at_s: float | None = None
    is_blind: bool = False
    execution: str | None = None
    since_ms: int = 0
    is_known: bool = False
    is_held: bool = False
    reason: str = NO_STOP
    stop_s: float = 0.0
    run: Run | None = None
    number: int = 0
    shares: Shares = field(default_factory=Shares)
    told_s: float = 0.0
    is_joined: bool = False

    def having(self, run: Run | None, at_s: float | None, is_blind: bool, stop_s: float, shares: Shares) -> "State":
        """Return the state with these. Spelled out, since `replace` looks up each field, and there are many a second."""
        return State(
            at_s, is_blind, self.execution, self.since_ms, self.is_known, self.is_held, self.reason,
            stop_s, run, self.number, shares, self.told_s, self.is_joined,
        )  # fmt: skip


@cache
def _at_once() -> frozenset[str]:
    """Return the signals that a run takes in with the message that tells them."""
    return frozenset({TOOL, FORCE, *VIBRATION, *machine_alarms()})


def step(config: Config, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Add up the time that has passed, then follow what has changed."""
    if sample.is_history or abs(sample.at_s) > STAMP_MAX_S:
        return state, ()
    kind, changed = sample.kind, sample.changed
    if kind is _HOLE:
        return _over_hole(config, state, sample), ()
    if kind is _DATA and WATCHED.isdisjoint(changed) and not (FEED in changed and _by_feed(sample)):
        if state.run is None or _at_once().isdisjoint(changed):
            return state, ()
        return state.having(followed(state.run, sample), state.at_s, state.is_blind, state.stop_s, state.shares), ()
    state = _lasted(config, state, sample)
    outputs: list[Output] = []
    now = execution(sample, config.feed_mm_min_min)
    if state.run is not None and not _at_once().isdisjoint(changed):
        state = replace(state, run=followed(state.run, sample))
    state = _moved(config, state, sample, now, outputs)
    if kind is _DATA and not outputs and now.state is not None and _why(state, now.state, sample) == state.reason:
        return state, _told_again(state.reason)  # what nearly every message brings: nothing but time has passed
    state = _stopped(state, sample, now, outputs)
    if kind in (_TICK, _BIRTH) and not 0.0 <= sample.at_s - state.told_s < TOLD_EVERY_S:
        state = replace(state, told_s=sample.at_s)
        outputs += _shares(config, state)
        if state.reason != NO_STOP and now.state is not None:
            outputs.append(Output(STOP_S, round(state.stop_s, 1)))
    return state, outputs


def _by_feed(sample: Sample) -> bool:
    return EXECUTION not in sample.row


def _over_hole(config: Config, state: State, sample: Sample) -> State:
    """Time up to a hole was spent as it was; what is jumped over is unknown. A clock that was set back goes on from there."""
    if state.at_s is not None and sample.at_s > state.at_s:
        state = _lasted(config, state, sample)
    run = state.run if state.run is None else replace(state.run, holes=state.run.holes + 1)
    return replace(state, at_s=sample.at_s, is_blind=sample.gap_s > 0.0, run=run)


def _lasted(config: Config, state: State, sample: Sample) -> State:
    """The state with the time since it was last looked at, spent as it then was."""
    before_s, at_s = state.at_s, sample.at_s
    if before_s is None or at_s <= before_s:
        return state if at_s == before_s else replace(state, at_s=at_s, is_blind=False)
    dt_s = at_s - before_s
    is_seen = state.is_known and not state.is_blind and state.execution not in (None, OFFLINE)
    shares, run, stop_s = state.shares, state.run, state.stop_s
    if is_seen:
        is_active = state.execution == ACTIVE
        window_s, begins_s = config.window_h * 3600.0, config.day_begins_h_utc * 3600.0
        shares = with_time(shares, at_s, dt_s, is_active=is_active, window_s=window_s, day_begins_s=begins_s)
    if run is not None:
        reason = "" if state.execution == ACTIVE and not state.is_held else state.reason
        run = lasted(run, sample, state.execution if is_seen else None, reason, dt_s)
    if state.reason != NO_STOP:
        stop_s += dt_s
    return state.having(run, at_s, False, stop_s, shares)


def _moved(config: Config, state: State, sample: Sample, now: Execution, outputs: list[Output]) -> State:
    """Follow the execution state; what comes back as it was has not changed."""
    if now.state is None or now.state == OFFLINE:
        if state.is_known:
            unknown = Output(STATE, OFFLINE) if now.state else Output.null(STATE, now.reason or "unknown")
            outputs.append(unknown)
        elif state.execution is None:
            outputs.append(Output.null(STATE, now.reason or "offline"))
        return replace(state, is_known=False, is_held=False) if state.is_known or state.is_held else state
    before, was_known = state.execution, state.is_known
    is_held = now.state == ACTIVE and is_held_by_override(sample)
    if not was_known or is_held is not state.is_held:
        state = replace(state, is_known=True, is_held=is_held)
    program = text(sample.row, PROGRAM)
    if now.state == before and was_known:
        return _named(state, program)
    outputs += [Output(STATE, now.state), Output(STATE_BASIS, now.basis)]
    if now.state == before and not _is_another(state.run, program):
        return _named(state, program)  # said again after a while in which nothing was heard
    is_seen = was_known and before is not None and sample.kind is not _BIRTH  # a birth says what holds, not since when
    if now.state != before:
        at_ms = round(sample.at_s * 1000)
        state = replace(state, execution=now.state, since_ms=at_ms)
        outputs.append(Output(SINCE, _utc(at_ms), reason=None if is_seen else "at the latest: it was not heard before"))
    return _with_run(config, state, _Turn(sample, now.state, program, is_seen, outputs))


def _named(state: State, program: str | None) -> State:
    """A run whose program is told a little later has that name."""
    run = state.run
    if run is None or run.program is not None or program is None:
        return state
    return replace(state, run=replace(run, program=program))


def _is_another(run: Run | None, program: str | None) -> bool:
    return run is not None and program is not None and run.program is not None and run.program != program


class _Turn(NamedTuple):
    """A change of state: to `now`, of this program; whether the moment of it was seen; and what is to be told."""

    sample: Sample
    now: str
    program: str | None
    is_seen: bool
    outputs: list[Output]


def _with_run(config: Config, state: State, turn: _Turn) -> State:
    """A run begins, is interrupted, or ends."""
    run = state.run
    if turn.now in (READY, COMPLETED):
        state = replace(state, is_joined=False)
        return state if run is None else _ended(config, state, run, turn, "completed" if turn.now == COMPLETED else "ready")
    if turn.now != ACTIVE:
        if run is None:
            return state if turn.is_seen else replace(state, is_joined=True)
        return replace(state, run=replace(run, interruptions=run.interruptions + turn.is_seen))
    if run is not None and _is_another(run, turn.program):
        state = _ended(config, state, run, turn, "next start")
    if state.run is None:
        mode = text(turn.sample.row, MODE)
        is_begin_seen = turn.is_seen and not state.is_joined
        return replace(state, is_joined=False, run=begun(turn.sample, turn.program, mode, is_begin_seen=is_begin_seen))
    return state


def _ended(config: Config, state: State, run: Run, turn: _Turn, ended_by: str) -> State:
    """The run is over: a part, where it was long enough and in a mode that makes parts."""
    state = replace(state, run=None)
    if run.seconds < config.cycle_s_min or not (run.mode is None or run.mode in config.modes):
        return state
    number, sample = state.number + 1, turn.sample
    is_whole = run.is_begin_seen and turn.is_seen
    why = "its end was not seen" if run.is_begin_seen else "its beginning was not seen"
    at_ms = round(sample.at_s * 1000)
    turn.outputs.extend(
        (
            Output(NUMBER, number),
            Output(CYCLE, round(run.seconds, 3)) if is_whole else Output.null(CYCLE, why),
            Output(CYCLE_PROGRAM, run.program)
            if run.program is not None
            else Output.null(CYCLE_PROGRAM, "the program is not told"),
            Output(INTERRUPTED, round(run.interrupted_s, 3)),
            Output(PART, record(run, sample, number=number, ended_by=ended_by, is_end_seen=turn.is_seen, ended_ms=at_ms)),
        )
    )
    return replace(state, number=number)


@lru_cache(maxsize=REASONS_MAX)
def _told_again(reason: str) -> tuple[Output, ...]:
    """Return the output of a reason, always the same tuple: whoever sends it sees at a glance that it is not new."""
    return (Output(STOP, reason),)


def _why(state: State, now: str, sample: Sample) -> str:
    """Return why the machine stands, or that it does not."""
    return NO_STOP if now == ACTIVE and not state.is_held else stop_reason(now, sample)


def _stopped(state: State, sample: Sample, now: Execution, outputs: list[Output]) -> State:
    """Why the machine stands: the first reason that is told, or an alarm that comes while it stands."""
    if now.state is None:
        outputs.append(Output.null(STOP, now.reason or "unknown"))
        return state
    reason = _why(state, now.state, sample)
    if reason == NO_STOP:
        if state.reason != NO_STOP:
            outputs.append(Output(STOP_S, round(state.stop_s, 1)))
        outputs += _told_again(NO_STOP)
        return state if state.reason == NO_STOP else replace(state, reason=NO_STOP, stop_s=0.0)
    if reason != state.reason:
        if state.reason != NO_STOP and state.stop_s > 0.0:
            outputs.append(Output(STOP_S, round(state.stop_s, 1)))
        state = replace(state, reason=reason, stop_s=0.0)
    outputs += _told_again(reason)
    return state


def _shares(config: Config, state: State) -> list[Output]:
    """The shares, as far as enough was seen."""
    found = []
    for name, slots in ((UTILISATION, state.shares.slots), (TODAY, (state.shares.day,))):
        share, seen_s = share_pct(slots)
        if share is None or seen_s < config.seen_s_min:
            found.append(Output.null(name, f"the state was known for less than {config.seen_s_min:g} s"))
        else:
            found.append(Output(name, round(share, 1)))
    return found


def _utc(at_ms: int) -> str:
    return datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


_TEXT, _NUMBER, _MEASURED = DataType.STRING, DataType.DOUBLE, Provenance.MEASURED
PROCESSOR = Processor(
    name="events",
    version=2,
    inputs=frozenset({EXECUTION, PROGRAM, MODE, ALARM, TOOL, CHANGING, FEED, *OVERRIDES}) | RECORD_INPUTS,
    alarms=machine_alarms,
    outputs=(
        OutputSpec(STATE, _TEXT, None, "MTConnect's execution state, or OFFLINE; null while it is not known", _MEASURED),
        OutputSpec(SINCE, _TEXT, None, "since when, UTC", _MEASURED),
        OutputSpec(STATE_BASIS, _TEXT, None, "who tells the state", _MEASURED),
        OutputSpec(CYCLE, _NUMBER, "s", "the last program run, from ACTIVE to its end, with its interruptions", _MEASURED),
        OutputSpec(NUMBER, DataType.INT64, None, "program runs that have ended", _MEASURED),
        OutputSpec(CYCLE_PROGRAM, _TEXT, None, "the program of the last run", _MEASURED),
        OutputSpec(INTERRUPTED, _NUMBER, "s", "of the last run, in which it was interrupted", _MEASURED),
        OutputSpec(UTILISATION, _NUMBER, "%", "share of ACTIVE in the rolling window, of the time that was seen", _MEASURED, 0.5),
        OutputSpec(TODAY, _NUMBER, "%", "share of ACTIVE today, of the time that was seen", _MEASURED, 0.5),
        OutputSpec(STOP, _TEXT, None, "why the machine stands, as far as reported; none while it works", Provenance.INFERRED),
        OutputSpec(STOP_S, _NUMBER, "s", "how long it stands, or the last stop lasted", _MEASURED),
        OutputSpec(PART, DataType.TEXT, None, "as-built record of the last part, JSON", Provenance.INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
)
