"""The watch over all machines: from their rows to their alerts, once a beat."""

import itertools
from collections.abc import Iterator, Mapping, Set
from dataclasses import replace
from typing import NamedTuple

from processors.alerts import lag
from processors.alerts.config import MACHINE_OFFLINE, NAMED, PROCESSORS_BEHIND, RULES, SOURCE_LOST, AlertsConfig, Rule
from processors.alerts.facts import INPUTS as FACT_INPUTS
from processors.alerts.facts import Facts, control_says_high, facts_of
from processors.alerts.phases import Beat, Condition, advanced, begun, condition_of, raised
from processors.alerts.state import ALERTS_MAX, Alert, AlertsState, Phase, Severity, fingerprint, labels_of
from processors.config import Configuration
from sparkplug.metric import Reading
from sparkplug.quality import Quality
from twin.vocabulary.twin_signals import CONTROL_ALARM, SEVERITY, TWIN_PREFIX

INPUTS = frozenset({*NAMED, SEVERITY, *FACT_INPUTS})
SEEN_S_MAX = 5.0  # of one beat: what lies between two that are further apart was not watched
RESOLVED_SHOWN_S = 3600.0
MACHINES_MAX = 2000
OFFLINE = "the machine is offline"
NOT_HEARD = "not heard again since the processors started"
NOT_LOST = Condition(False, "", 0)
_STALE = Quality.STALE

Row = Mapping[str, Reading]


class Watched(NamedTuple):
    """One thing that may be an alert, as it stands now; `facts`: of what is no signal of a machine."""

    machine: str
    name: str
    signal: str
    rule: Rule
    condition: Condition
    facts: Facts | None = None


def next_beat(state: AlertsState, wall_s: float) -> Beat:
    """The beat at `wall_s`: a clock that was set back stands still, and one that leaps is followed."""
    passed_s = max(0.0, wall_s - state.wall_s) if state.wall_s else 0.0
    return Beat(wall_s, state.clock_s + passed_s, min(passed_s, SEEN_S_MAX))


def watched(configuration: Configuration[AlertsConfig], state: AlertsState, cell: Mapping[str, Row], beat: Beat) -> AlertsState:
    """All alerts one beat later."""
    machines = _machines(state, cell, beat, configuration.default.forget_after_s)
    known = {(alert.machine, alert.name): alert for alert in state.alerts.values()}
    alerts: dict[str, Alert] = {}
    overflowed = state.overflowed
    everything = itertools.chain(
        _all(configuration, machines, state, cell, known.keys()), _processors(configuration.default, state, beat, known)
    )
    for one in everything:
        config = configuration.of(one.machine)
        before = alert = known.pop((one.machine, one.name), None)
        if before is not None:
            alert = advanced(before, one.rule, one.condition, beat, config)
        elif len(alerts) < ALERTS_MAX:
            alert = begun(_fresh(one, config), one.rule, one.condition, beat)
        else:
            overflowed += 1
        if alert is not None and one.facts is not None:
            if one.facts and (before is None or before.phase is not alert.phase):  # an end keeps those of its beginning
                alert = replace(alert, facts=one.facts)
        elif alert is not None and (before is None or before.episode != alert.episode):
            alert = replace(alert, facts=facts_of(one.signal, cell.get(one.machine, {}), alert.episode))
        if alert is not None and _is_remembered(alert, state, beat, config):
            alerts[alert.fingerprint] = alert
    for left in known.values():  # neither its machine nor its rule is known any more
        ended = advanced(left, Rule(severity=left.severity), Condition(False, "", 0), beat, configuration.default)
        if ended is not None and _is_remembered(ended, state, beat, configuration.default):
            alerts[ended.fingerprint] = ended
    return replace(
        state,
        wall_s=beat.wall_s,
        clock_s=beat.clock_s,
        machines=machines,
        deaths={machine: at_ms for machine, at_ms in state.deaths.items() if machine in machines and machine not in cell},
        pulses={},
        lags=lag.without_old(state.lags, beat.wall_s),
        alerts=_raised(configuration, alerts, cell, beat),
        overflowed=overflowed,
    )


def _fresh(one: Watched, config: AlertsConfig) -> Alert:
    key = fingerprint(labels_of(one.machine, one.name, one.signal, config.labels))
    return Alert(one.machine, one.name, one.signal, key, one.rule.severity, 0)


def _machines(state: AlertsState, cell: Mapping[str, Row], beat: Beat, forget_after_s: float) -> dict[str, float]:
    """The machines that are known, and when each was last online."""
    known = {name: at_s for name, at_s in state.machines.items() if beat.wall_s - at_s <= forget_after_s}
    new = [name for name in cell if name not in known]
    known.update(dict.fromkeys([name for name in cell if name in known], beat.wall_s))
    known.update(dict.fromkeys(new[: max(MACHINES_MAX - len(known), 0)], beat.wall_s))
    return known


def _all(
    configuration: Configuration[AlertsConfig],
    machines: Mapping[str, float],
    state: AlertsState,
    cell: Mapping[str, Row],
    known: Set[tuple[str, str]],
) -> Iterator[Watched]:
    """Yield what stands, and what is an alert already: of a shop in order that is next to nothing."""
    pulses = state.pulses
    for machine, last_s in machines.items():
        config, row = configuration.of(machine), cell.get(machine)
        gone = OFFLINE if machine in state.deaths else NOT_HEARD  # a machine that leaves while we listen tells us by its death
        for signal, rule in config.signals.items():
            if not rule.enabled:
                continue
            reading = None if row is None else row.get(signal)
            pulse_ms = pulses.get(f"{machine}\0{signal}") if pulses else None
            is_up = pulse_ms is not None or (reading is not None and reading.value is True)
            if not is_up and not known:
                continue
            name = signal.removeprefix(TWIN_PREFIX)
            if is_up or (machine, name) in known:
                condition = condition_of(reading) if row is not None else Condition(None, gone, 0)
                if pulse_ms is not None and not condition.stands and rule.for_s == 0.0:
                    condition = Condition(True, "", pulse_ms)
                if condition.stands or (machine, name) in known:
                    yield Watched(machine, name, signal, rule, condition)
        offline, source_lost = config.machine_offline, config.alarm_source_lost
        if offline is not None and offline.enabled and (row is None or (machine, MACHINE_OFFLINE) in known):
            died_ms = state.deaths.get(machine, round(last_s * 1000))
            yield Watched(machine, MACHINE_OFFLINE, "", offline, Condition(row is None, "", died_ms))
        if source_lost is not None and source_lost.enabled:
            lost = _source(config, row) if row is not None else Condition(None, gone, 0)
            if lost.stands or (machine, SOURCE_LOST) in known:
                yield Watched(machine, SOURCE_LOST, "", source_lost, lost)


def _processors(
    config: AlertsConfig, state: AlertsState, beat: Beat, known: Mapping[tuple[str, str], Alert]
) -> Iterator[Watched]:
    """Yield the one alert of all processors that are behind."""
    rule, before = config.processors_behind, known.get((lag.PLANT, PROCESSORS_BEHIND))
    if rule is None or not rule.enabled:
        return
    condition, facts = lag.condition_of(state, beat, rule.caught_up_s if before is not None and before.is_on else rule.behind_s)
    if condition.stands or before is not None:
        yield Watched(lag.PLANT, PROCESSORS_BEHIND, "", rule, condition, facts)


def _source(config: AlertsConfig, row: Row) -> Condition:
    """Return whether a processor that gave alarm signals has gone while the machine is there: nobody watches then, and no alarm
    is no good news."""
    readings = (row.get(signal) for signal, rule in config.signals.items() if rule.enabled)
    lost = [reading.timestamp_ms for reading in readings if reading is not None and reading.quality is _STALE]
    return Condition(True, "", max(lost)) if lost else NOT_LOST


def _raised(
    configuration: Configuration[AlertsConfig], alerts: dict[str, Alert], cell: Mapping[str, Row], beat: Beat
) -> dict[str, Alert]:
    """Raise the alerts that a rule confirms by firing on the same machine, and those that the control itself calls severe."""
    by_rule = {alert.machine for alert in alerts.values() if alert.is_on and alert.signal in RULES}
    said_high = {machine for machine, row in cell.items() if _says_high(row.get(SEVERITY))}
    worse = by_rule | said_high
    rises = {}
    for key, alert in alerts.items():
        is_severe = alert.signal == CONTROL_ALARM and alert.is_on and control_says_high(cell.get(alert.machine, {}))
        if not is_severe and not (alert.is_on and alert.machine in worse):
            continue
        rule = configuration.of(alert.machine).rule_of(alert.name, alert.signal)
        if rule is not None and ((rule.raised_by_rule and alert.machine in worse) or (rule.raised_by_control and is_severe)):
            rises[key] = raised(alert, Severity.HIGH, beat)
    return alerts | rises


def _says_high(reading: Reading | None) -> bool:
    return reading is not None and reading.quality is Quality.GOOD and reading.value == Severity.HIGH.value


def _is_remembered(alert: Alert, state: AlertsState, beat: Beat, config: AlertsConfig) -> bool:
    """A resolved alert is kept while somebody believes that it fires, while it may flap, and for an hour to look at."""
    if alert.phase is not Phase.RESOLVED:
        return True
    if (
        beat.clock_s - alert.resolved_s <= RESOLVED_SHOWN_S
        or beat.clock_s - max(alert.rises_s, default=0.0) <= config.flap_window_s
    ):
        return True
    return any(
        receiver.told[alert.fingerprint].is_firing for receiver in state.receivers.values() if alert.fingerprint in receiver.told
    )
