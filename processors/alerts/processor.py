"""Alerts: from alarm signals of all machines to notifications, once each, for people who are to keep them switched on.

Its state follows from the messages of all machines alone. Once a second (a beat of the wall clock) each alarm is looked at, each
alert goes a step (`phases.py`), and what each receiver has to be told (`notices.py`) goes into the outbox (`outbox.py`), a
retained message for each notification, which the courier (`courier/`) sends. What became of it comes back; only then is it
cleared.
"""

from collections.abc import Sequence
from dataclasses import replace

from processors.alarms import alarm_signals
from processors.alerts import lag
from processors.alerts.body import Notice
from processors.alerts.config import AlertsConfig
from processors.alerts.messages import CLAIM, COMMAND, DELIVERY, OUTBOX, TOPIC, taken
from processors.alerts.notices import notified
from processors.alerts.outbox import emitted, made
from processors.alerts.report import FIRING, STATE, SUMMARY, machine_outputs, state_output
from processors.alerts.state import AlertsState
from processors.alerts.watch import INPUTS, next_beat, watched
from processors.alerts.words.wordings import read_wordings
from processors.config import Configuration
from processors.contract import CellProcessor, Output, OutputSpec, PlainOutput, PlainSpec, Provenance, Sample, SampleKind
from sparkplug.datatype import DataType
from twin.vocabulary.topics import LAG

HEARTBEAT = "heartbeat"
PULSES_MAX = 5000
DEATHS_MAX = 2000


def step(
    configuration: Configuration[AlertsConfig], state: AlertsState, sample: Sample
) -> tuple[AlertsState, Sequence[Output | PlainOutput]]:
    """Beats do everything; what comes in between is noted for the next one."""
    if sample.is_history:
        return state, ()
    if sample.kind is SampleKind.BEAT:
        return _beat(configuration, state, sample)
    if sample.kind is SampleKind.PLAIN:
        if sample.topic.startswith(LAG):
            return lag.heard(state, sample.topic, sample.detail, sample.at_s), ()
        known = state if state.wall_s else replace(state, wall_s=sample.at_s)
        return taken(configuration, known, sample.topic, sample.detail), ()
    if sample.kind in (SampleKind.DATA, SampleKind.BIRTH):
        return _pulsed(configuration.of(sample.machine), state, sample), ()
    if sample.kind is SampleKind.DEATH and len(state.deaths) < DEATHS_MAX:
        return replace(state, deaths=state.deaths | {sample.machine: round(sample.at_s * 1000)}), ()
    return state, ()


def _pulsed(config: AlertsConfig, state: AlertsState, sample: Sample) -> AlertsState:
    """An alarm that came up: it may be gone again before the next beat, and is not to be missed."""
    up = {
        f"{sample.machine}\0{name}": sample.row[name].timestamp_ms
        for name in sample.changed
        if (rule := config.signals.get(name)) is not None
        and rule.enabled
        and name in sample.row
        and sample.row[name].value is True
    }
    if not up or len(state.pulses) >= PULSES_MAX:
        return state
    return replace(state, pulses=state.pulses | up)


def _beat(
    configuration: Configuration[AlertsConfig], before: AlertsState, sample: Sample
) -> tuple[AlertsState, Sequence[Output | PlainOutput]]:
    state = watched(configuration, before, sample.cell, next_beat(before, sample.at_s))
    state = _beaten(configuration, notified(configuration, state))
    state, outbox = emitted(state)
    state, metrics = machine_outputs(configuration, state, tuple(sample.cell), sample.at_s)
    state, told = state_output(configuration, state)
    return state, (*outbox, *metrics, *told)


def _beaten(configuration: Configuration[AlertsConfig], state: AlertsState) -> AlertsState:
    """The heartbeat of this slot of time, where the last one is gone."""
    heartbeat = configuration.default.heartbeat
    name, every_s = heartbeat.receiver, heartbeat.every_s
    slot = int(state.wall_s // every_s)
    if not name or slot == state.heartbeat_slot or any(item.kind == HEARTBEAT for item in state.outbox.values()):
        return state
    notice = Notice(name, HEARTBEAT, HEARTBEAT, {"alertname": "cnctwin_heartbeat"}, (), (f"{HEARTBEAT}.{slot}",), (), every_s)
    item = made(notice, configuration, state.wall_s, state.clock_s)
    outbox = state.outbox if item.id in state.settled else state.outbox | {item.id: item}
    return replace(state, heartbeat_slot=slot, outbox=outbox)


PROCESSOR = CellProcessor(
    name="alerts",
    version=3,
    inputs=INPUTS,
    alarms=alarm_signals,
    outputs=(
        OutputSpec(
            STATE, DataType.STRING, None, "none, pending, firing or acknowledged: of the worst alert", Provenance.INFERRED
        ),
        OutputSpec(FIRING, DataType.INT64, "alerts", "alerts that fire, acknowledged ones too", Provenance.INFERRED),
        OutputSpec(
            SUMMARY, DataType.STRING, None, "what fires or pends, since when, and who acknowledged it", Provenance.INFERRED
        ),
    ),
    plain=(PlainSpec(TOPIC, "the state of all alerts, and the outbox", qos=1),),
    config=AlertsConfig,
    state=AlertsState,
    initial=lambda _: AlertsState(),
    step=step,
    reads=read_wordings,
    listens=(f"{COMMAND}#", f"{CLAIM}+", f"{DELIVERY}+", f"{OUTBOX}+", f"{LAG}+"),
    beats=True,
)
