"""The publications of the alerts processor: its state as one JSON, three metrics for each machine."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Any

from processors.alerts.body import as_alert, iso
from processors.alerts.config import AlertsConfig
from processors.alerts.notices import silenced_alerts
from processors.alerts.phases import flapping_of
from processors.alerts.state import Alert, AlertsState, Phase, ReceiverState, Silence
from processors.alerts.words.wording import Wording, began_ms
from processors.alerts.words.wordings import wording_of
from processors.config import Configuration
from processors.contract import Output, PlainOutput
from twin.vocabulary import topics
from twin.vocabulary.twin_signals import ALERT_STATE, TWIN_PREFIX

STATE, FIRING, SUMMARY = ALERT_STATE, f"{TWIN_PREFIX}alerts_firing", f"{TWIN_PREFIX}alert_summary"
STATE_TOPIC = topics.ALERT_STATE
SHOWN_MAX = 1000
SUMMARY_MAX = 500
REPUBLISH_S = 60.0
NONE = "none"
_ORDER = {Phase.FIRING: 3, Phase.ACKNOWLEDGED: 2, Phase.PENDING: 1, Phase.RESOLVED: 0}


# The metrics.


def machine_outputs(
    configuration: Configuration[AlertsConfig], state: AlertsState, online: Sequence[str], at_s: float
) -> tuple[AlertsState, list[Output]]:
    """Return the metrics that changed, of the machines that are online."""
    alerts: dict[str, list[Alert]] = {}
    for alert in state.alerts.values():
        alerts.setdefault(alert.machine, []).append(alert)
    outputs: list[Output] = []
    shown = {}
    for machine in online:
        phase, firing, summary = _of_machine(alerts.get(machine, ()))
        shown[machine] = f"{phase}\n{firing}\n{summary}"
        if state.shown.get(machine) != shown[machine]:
            outputs += [
                Output(STATE, phase, machine=machine, at_s=at_s),
                Output(FIRING, firing, machine=machine, at_s=at_s),
                Output(SUMMARY, summary, machine=machine, at_s=at_s),
            ]
    return replace(state, shown=shown), outputs


def _of_machine(alerts: Sequence[Alert]) -> tuple[str, int, str]:
    if not alerts:  # of nearly every machine
        return NONE, 0, NONE
    live = sorted(
        (a for a in alerts if a.phase is not Phase.RESOLVED), key=lambda a: (-_ORDER[a.phase], -a.severity.rank, a.name)
    )
    if not live:
        return NONE, 0, NONE
    return live[0].phase.value, sum(alert.is_on for alert in live), "; ".join(map(_said, live))[:SUMMARY_MAX]


def _said(alert: Alert) -> str:
    by = f" by {alert.acknowledged_by}" if alert.acknowledged_by else ""
    unknown = ", now unknown" if alert.unknown else ""
    return f"{alert.severity.value}: {alert.name} {alert.phase.value}{by} since {iso(began_ms(alert))}{unknown}"


# The state.


def state_output(configuration: Configuration[AlertsConfig], state: AlertsState) -> tuple[AlertsState, list[PlainOutput]]:
    """The state, where it has changed, and once a minute all the same, so that a reader sees that it is kept up."""
    document = _document(configuration, state)
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, sort_keys=True)
    digest = sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    if digest == state.published and state.clock_s - state.published_s < REPUBLISH_S:
        return state, []
    document = {"at": iso(round(state.wall_s * 1000)), **document}
    payload = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode("utf-8", "replace")
    return replace(state, published=digest, published_s=state.clock_s), [PlainOutput(STATE_TOPIC, payload)]


def _document(configuration: Configuration[AlertsConfig], state: AlertsState) -> dict[str, Any]:
    config = configuration.default
    configs = {alert.machine: configuration.of(alert.machine) for alert in state.alerts.values()}
    silenced = silenced_alerts(state, configs)
    ordered = sorted(state.alerts.values(), key=lambda a: (-_ORDER[a.phase], -a.severity.rank, a.machine, a.name))
    words = wording_of(configuration)
    shown = [
        _alert(alert, configs[alert.machine], state, words, silenced.get(alert.fingerprint, "")) for alert in ordered[:SHOWN_MAX]
    ]
    waiting = _waiting(state)
    return {
        "alerts": shown,
        "alerts_not_shown": len(ordered) - len(shown),
        "silences": [_silence(silence) for silence in state.silences],
        "receivers": {
            name: _receiver(state.receivers.get(name, ReceiverState()), waiting.get(name, 0)) for name in config.receivers
        },
        "failures": [
            {"id": one.id, "receiver": one.receiver, "reason": one.reason, "at": _wall(one.wall_s), "says": list(one.says[:20])}
            for one in state.failures
        ],
        "commands": [
            {"id": one.id, "command": one.command, "by": one.by, "done": one.is_done, "text": one.text, "at": _wall(one.wall_s)}
            for one in state.outcomes
        ],
        "malformed": state.malformed,
        "overflowed": state.overflowed,
    }


def _alert(alert: Alert, config: AlertsConfig, state: AlertsState, words: Wording, silence: str) -> dict[str, Any]:
    told = {name: known.told[alert.fingerprint] for name, known in state.receivers.items() if alert.fingerprint in known.told}
    flapping = flapping_of(alert, state.clock_s, config)
    return {
        **as_alert(alert, config, words, flapping and flapping.in_steps()),
        "phase": alert.phase.value,
        "severity": alert.severity.value,
        "severities": [severity.value for severity in alert.severities],
        "since": _wall(alert.since_wall_s),
        "unknown": alert.unknown,
        "flapping": flapping is not None,
        "acknowledged_by": alert.acknowledged_by,
        "comment": alert.comment,
        "silenced_by": silence,
        "undelivered": alert.undelivered,
        "told": sorted(name for name, one in told.items() if one.is_firing and one.episode == alert.episode),
    }


def _receiver(known: ReceiverState, waiting: int) -> dict[str, Any]:
    return {
        "delivered": known.delivered,
        "failed": known.failed,
        "waiting": waiting,
        "held_back": known.held_back,
        "muted": known.is_muted,
        "last_error": f"not taken yet ({known.not_taken}); it will be tried again" if known.not_taken else known.last_error,
        "not_taken": known.not_taken,
        "last_delivered": _wall(known.last_delivered_wall_s) if known.last_delivered_wall_s else None,
    }


def _silence(silence: Silence) -> dict[str, Any]:
    return {
        "id": silence.id,
        "matchers": silence.matchers,
        "starts": _wall(silence.starts_s),
        "ends": _wall(silence.ends_s),
        "by": silence.by,
        "comment": silence.comment,
    }


def _waiting(state: AlertsState) -> Mapping[str, int]:
    counts: dict[str, int] = {}
    for made in state.outbox.values():
        counts[made.receiver] = counts.get(made.receiver, 0) + 1
    return counts


def _wall(wall_s: float) -> str:
    return iso(round(wall_s * 1000))


__all__ = ["FIRING", "STATE", "STATE_TOPIC", "SUMMARY", "machine_outputs", "state_output"]
