"""Production figures of a machine by shift: OEE with its parts, stops by reason, parts with their energy.

Runs, parts and stops are those of `events`, folded here once more (one definition); time is added up by the time elements of
ISO 22400-2 and split at the borders of the shift calendar. Time in which the machine was not heard is unknown, never running.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from processors.contract import Output, OutputSpec, Processor, Provenance, Sample, SampleKind
from processors.events.execution import ALARM, CHANGING, EXECUTION, FEED, FEED_OVERRIDE, MODE, PROGRAM
from processors.events.processor import PART, WATCHED
from processors.events.processor import State as Runs
from processors.events.processor import step as runs_step
from processors.production.calendar import Slot
from processors.production.config import Config
from processors.production.doing import UNKNOWN, Doing, doing
from processors.production.given import Given, given, read_files
from processors.production.ratios import ratios
from processors.production.record import part_record, shift_record, sums_of
from processors.production.state import Energy, LastPart, Pending, State
from processors.production.tally import Tally, opened, spent, with_part, with_quality
from sparkplug.datatype import DataType
from sparkplug.quality import Quality
from twin.vocabulary import twin_signals
from twin.vocabulary.twin_signals import PART_ENERGY_KWH, PRODUCTION, PRODUCTION_NOW, STOPS, TWIN_PREFIX

POWER, LOAD, PART_QUALITY = "spindle_power_kw", "spindle_load_pct", "part_quality"
SHIFT = f"{TWIN_PREFIX}shift"
PARTS = {"made": f"{TWIN_PREFIX}parts_made", "good": f"{TWIN_PREFIX}parts_good", "scrap": f"{TWIN_PREFIX}parts_scrap"}
RATIOS = {
    "availability": twin_signals.AVAILABILITY,
    "performance": twin_signals.PERFORMANCE,
    "quality": twin_signals.QUALITY,
    "oee": twin_signals.OEE,
}
SECONDS = {
    name: f"{TWIN_PREFIX}{name}"
    for name in ("planned_s", "production_s", "setup_s", "delay_s", "down_s", "unknown_s", "ideal_s", "judged_s")
}
ENERGY = f"{TWIN_PREFIX}shift_energy_kwh"
STAMP_MAX_S = 250_000_000_000.0  # a calendar ends with the year 9999
SLOTS_MAX = 200  # that one step of time may bring; what is longer is left out, since nobody heard it
POWER_KW_MAX = 1e4
NO_POWER = "spindle_power_kw is not known, nor the load and rated power of the spindle"
GOOD, SCRAP = "GOOD", "SCRAP"
_HOLE, _DATA, _TICK, _BIRTH = SampleKind.HOLE, SampleKind.DATA, SampleKind.TICK, SampleKind.BIRTH
_WAKES = WATCHED | {PART_QUALITY}


def step(means: Given, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
    """Add up the time that has passed, then follow what has changed."""
    if sample.is_history or not 0.0 <= sample.at_s <= STAMP_MAX_S or sample.kind is SampleKind.PLAIN:
        return state, ()
    config = means.configuration.of(sample.machine)
    outputs: list[Output] = []
    state = _lasted(means, config, state, sample, outputs)
    before = state.runs
    runs, said = runs_step(config.runs, before, sample)
    state = state.with_runs(runs, sample.kind is _HOLE and sample.gap_s > 0.0)
    if _is_another_run(before, runs):
        ended = next((one.value for one in said if one.name == PART), None)
        state = settled(state)
        if isinstance(ended, str) and before.run is not None:
            state = _with_part(means, state, sample, json.loads(ended), before.run.began_ms, outputs)
        state = replace(state, energy=Energy())
    if sample.kind is _DATA and PART_QUALITY in sample.changed:
        state = _with_quality(state, sample, outputs)
    now = UNKNOWN if state.is_blind else doing(runs, sample, config.modes)
    if now.kind is not state.kind or now.reason != state.reason:
        state = replace(settled(state), kind=now.kind, reason=now.reason, is_new=True)
    is_due = sample.kind in (_TICK, _BIRTH) and not 0.0 <= sample.at_s - state.told_s < config.told_s
    if is_due or outputs:
        state = replace(settled(state), told_s=sample.at_s)
        if state.tally is not None:
            outputs += _figures(means, state.tally, sample.machine, config.known_share_min)
    return state, outputs


def _is_another_run(before: Runs, now: Runs) -> bool:
    if before.run is None or now.run is None:
        return before.run is not now.run
    return before.run.began_ms != now.run.began_ms


def settled(state: State) -> State:
    """Return the state with all time that has passed in its tally, and in the energy of its run."""
    pending, tally, energy = state.pending, state.tally, state.energy
    if pending.seconds <= 0.0 or tally is None:
        return state
    slot = Slot(tally.shift, tally.begin_s, tally.end_s, pending.until_s, pending.is_planned)
    tally = spent(tally, slot, Doing(state.kind, state.reason), pending.seconds, is_new=state.is_new)
    if pending.known_s > 0.0:
        tally = replace(tally, energy_kwh=tally.energy_kwh + pending.kwh, energy_s=tally.energy_s + pending.known_s)
    energy = Energy(energy.kwh + pending.kwh, energy.known_s + pending.known_s, energy.seconds + pending.seconds)
    return replace(
        state, tally=tally, energy=energy, is_new=False, pending=Pending(pending.until_s, is_planned=pending.is_planned)
    )


def _lasted(means: Given, config: Config, state: State, sample: Sample, outputs: list[Output]) -> State:
    """The state with the time since it was last looked at, spent as the machine then did, split at the borders of shifts."""
    before_s, at_s, kw, pending = state.at_s, sample.at_s, _power_kw(means, sample), state.pending
    if before_s is None or at_s < before_s:
        return _joined(means, config, replace(settled(state), at_s=at_s, kw=kw), sample.machine, outputs)
    if at_s == before_s:
        return state if kw == state.kw else state.having(at_s, kw, pending)
    if state.is_blind:
        state = replace(settled(state), kind=UNKNOWN.kind, reason=UNKNOWN.reason, is_new=state.kind is not UNKNOWN.kind)
    mean_kw = None if kw is None or state.kw is None or state.is_blind else 0.5 * (kw + state.kw)
    for _ in range(SLOTS_MAX):
        until_s = min(at_s, state.pending.until_s)
        state = state.having(until_s, kw, _longer(state.pending, until_s - before_s, mean_kw))
        if until_s >= at_s:
            return state
        before_s = until_s
        state = _joined(means, config, settled(state), sample.machine, outputs)
    return _joined(means, config, replace(settled(state), at_s=at_s), sample.machine, outputs)


def _longer(pending: Pending, seconds: float, mean_kw: float | None) -> Pending:
    until_s, is_planned = pending.until_s, pending.is_planned
    if mean_kw is None:
        return Pending(until_s, is_planned, pending.seconds + seconds, pending.kwh, pending.known_s)
    kwh = pending.kwh + mean_kw * seconds / 3600.0
    return Pending(until_s, is_planned, pending.seconds + seconds, kwh, pending.known_s + seconds)


def _joined(means: Given, config: Config, state: State, machine: str, outputs: list[Output]) -> State:
    """Return a state in which all time is settled, in the slot that holds its moment; a shift that is over is told."""
    assert state.at_s is not None, "there is a moment"
    slot = means.slot(machine, state.at_s)
    tally = state.tally
    if tally is None or not tally.is_of(slot):
        if tally is not None and not tally.is_empty:
            record = shift_record(machine, tally, config.known_share_min, means.time_zone, is_over=True)
            outputs.append(Output(PRODUCTION, record, at_s=min(tally.end_s, state.at_s)))
        tally = _opened(means, machine, slot, state.at_s)
    return replace(state, tally=tally, pending=Pending(slot.until_s, is_planned=slot.is_planned))


def _opened(means: Given, machine: str, slot: Slot, at_s: float) -> Tally:
    """Return the tally of a shift that is joined now; its planned time before that is unknown."""
    tally = opened(slot, at_s, has_calendar=means.calendar is not None)
    seen_s = slot.begin_s
    while tally.has_calendar and seen_s < at_s:
        part = means.slot(machine, seen_s)
        until_s = min(at_s, part.until_s)
        tally = spent(tally, part, UNKNOWN, until_s - seen_s, is_new=False)
        seen_s = until_s
    return tally


def _power_kw(means: Given, sample: Sample) -> float | None:
    """Return the power of the spindle: measured, else its load of the rated power that is described."""
    kw, _ = sample.number(POWER)
    if kw is None and POWER not in sample.row and means.rated_kw is not None:
        load_pct, _ = sample.number(LOAD)
        kw = None if load_pct is None else 0.01 * load_pct * means.rated_kw
    return kw if kw is not None and abs(kw) <= POWER_KW_MAX else None


def _with_part(  # noqa: PLR0917
    means: Given, state: State, sample: Sample, record: dict[str, Any], began_ms: int, outputs: list[Output]
) -> State:
    """A run has ended that is a part: count it to the shift in which it ended."""
    tally, cycle, run = state.tally, record["cycle"], state.energy
    assert tally is not None, "time was added up before"
    ideal_s = means.ideal_s(sample.machine, record["program"])
    is_known = run.known_s > 0.0 and run.known_s >= means.configuration.default.known_share_min * run.seconds
    part = LastPart(
        id=record["id"],
        program=record["program"],
        shift=tally.shift,
        shift_begin=round(tally.begin_s * 1000),
        begin=began_ms,
        end=round(sample.at_s * 1000),
        complete=record["complete"],
        ideal_s=ideal_s,
        active_s=cycle["active_s"],
        interrupted_s=cycle["interrupted_s"],
        unknown_s=cycle["unknown_s"],
        energy_kwh=round(run.kwh, 5) if is_known else None,
    )
    tally = with_part(tally, active_s=part.active_s if part.complete else None, ideal_s=ideal_s)
    outputs.append(_part_output(sample.machine, part))
    if part.energy_kwh is None:
        outputs.append(Output.null(PART_ENERGY_KWH, NO_POWER))
    else:
        outputs.append(Output(PART_ENERGY_KWH, part.energy_kwh))
    return replace(state, tally=tally, part=part)


def _with_quality(state: State, sample: Sample, outputs: list[Output]) -> State:
    """Take what a message says of the part that ended last; anything but good and scrap says nothing."""
    reading = sample.row[PART_QUALITY]
    if state.part is None or reading.quality is not Quality.GOOD or not isinstance(reading.value, str):
        return state
    word = (reading.value.split(maxsplit=1) or [""])[0].upper()
    if word not in (GOOD, SCRAP) or state.part.is_good is (word == GOOD):
        return state
    part, tally = replace(state.part, is_good=word == GOOD), state.tally
    if tally is not None and tally.shift == part.shift and round(tally.begin_s * 1000) == part.shift_begin:
        tally = with_quality(tally, state.part.is_good, word == GOOD)
    outputs.append(_part_output(sample.machine, part))
    return replace(state, part=part, tally=tally)


def _part_output(machine: str, part: LastPart) -> Output:
    names = (
        "id",
        "program",
        "shift",
        "shift_begin",
        "begin",
        "end",
        "complete",
        "ideal_s",
        "active_s",
        "interrupted_s",
        "unknown_s",
    )
    told = {name: getattr(part, name) for name in (*names, "energy_kwh", "quality")}
    return Output(PRODUCTION, part_record(machine, told))


def _figures(means: Given, tally: Tally, machine: str, known_share_min: float) -> list[Output]:
    """Return the figures of the shift so far."""
    found = ratios(sums_of(tally), known_share_min)
    outputs = [
        Output.null(RATIOS[name], ratio.why) if ratio.value is None else Output(RATIOS[name], round(ratio.value, 4))
        for name, ratio in found.items()
    ]
    outputs += [Output(signal, round(getattr(tally, name), 1)) for name, signal in SECONDS.items()]
    outputs += [Output(signal, getattr(tally, name)) for name, signal in PARTS.items()]
    outputs.append(Output.null(SHIFT, "outside all shifts") if tally.shift is None else Output(SHIFT, tally.shift))
    if tally.energy_s > 0.0:
        outputs.append(Output(ENERGY, round(tally.energy_kwh, 4)))
    else:
        outputs.append(Output.null(ENERGY, NO_POWER))
    now = shift_record(machine, tally, known_share_min, means.time_zone, is_over=False)
    return [*outputs, Output(STOPS, json.dumps(json.loads(now)["stops"], ensure_ascii=False)), Output(PRODUCTION_NOW, now)]


_NUMBER, _INFERRED = DataType.DOUBLE, Provenance.INFERRED
_RATIO_MEANING = {
    "availability": "availability of the shift: production time over planned busy time, of what was heard (ISO 22400-2)",
    "performance": "performance of the shift: ideal over actual production time of its parts (ISO 22400-2 effectiveness)",
    "quality": "quality ratio of the shift: good parts over parts that were judged (ISO 22400-2)",
    "oee": "OEE index of the shift: availability times performance times quality (ISO 22400-2)",
}
_SECONDS_MEANING = {
    "planned_s": "planned busy time of the shift so far, PBT",
    "production_s": "production time within planned time, APT",
    "setup_s": "time in a mode that is not automatic, AUST",
    "delay_s": "time that it stands without an alarm, ADET",
    "down_s": "time that it stands with an alarm, ADOT",
    "unknown_s": "planned time in which the machine was not heard",
    "ideal_s": "ideal time of the parts of the shift, PRI times PQ",
    "judged_s": "production time of these parts",
}
PROCESSOR = Processor(
    name="production",
    version=2,
    inputs=frozenset({EXECUTION, PROGRAM, MODE, ALARM, CHANGING, FEED, FEED_OVERRIDE, POWER, LOAD, PART_QUALITY}),
    outputs=(
        *(OutputSpec(signal, _NUMBER, None, _RATIO_MEANING[name], _INFERRED, 0.001) for name, signal in RATIOS.items()),
        *(OutputSpec(signal, _NUMBER, "s", _SECONDS_MEANING[name], _INFERRED, 0.1) for name, signal in SECONDS.items()),
        *(OutputSpec(signal, DataType.INT64, None, f"parts of the shift: {name}", _INFERRED) for name, signal in PARTS.items()),
        OutputSpec(SHIFT, DataType.STRING, None, "the shift that runs, as the calendar names it", _INFERRED),
        OutputSpec(ENERGY, _NUMBER, "kWh", "energy of the spindle drive in the shift", _INFERRED, 0.0001),
        OutputSpec(PART_ENERGY_KWH, _NUMBER, "kWh", "energy of the spindle drive of the last part", _INFERRED),
        OutputSpec(STOPS, DataType.TEXT, None, "stops of the shift by reason, JSON", _INFERRED),
        OutputSpec(
            PRODUCTION, DataType.TEXT, None, "record of a shift that is over or of a part that has ended, JSON", _INFERRED
        ),
        OutputSpec(PRODUCTION_NOW, DataType.TEXT, None, "record of the shift that runs, so far, JSON", _INFERRED),
    ),
    config=Config,
    state=State,
    initial=lambda _: State(),
    step=step,
    wakes=_WAKES,
    reads=read_files,
    described=given,
)
