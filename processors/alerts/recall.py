"""After a crash: what an earlier life told is known again, out of the outbox that the broker kept.

The state is that of the last snapshot, up to a few seconds old. What was told since then stays so: an alert that was told as
firing fires, so that its end is told too, and an episode whose end was told is over, so that an alarm that stands again is an
episode of its own.
"""

from collections.abc import Mapping
from dataclasses import replace

from processors.alerts.phases import Beat, caught_up
from processors.alerts.routing import OVER, Said
from processors.alerts.state import ALERTS_MAX, OUTBOX_MAX, Alert, AlertsState, Item, ReceiverState, Told


def recalled(state: AlertsState, made: Item, written: Mapping[str, Alert], *, is_later: bool) -> AlertsState:
    """The state that knows of a notification of ours: `written` are the alerts in it, without their episodes.

    Where it was made later than the state (`is_later`), the alerts are at least as far as it says; an older one says only what
    was told.
    """
    known = state.receivers.get(made.receiver, ReceiverState())
    told, alerts = dict(known.told), dict(state.alerts)
    beat = Beat(state.wall_s, state.clock_s, 0.0)
    for said in filter(None, map(Said.of, made.says)):
        before, count = told.get(said.fingerprint), said.told_before + 1
        if before is not None and (before.episode, before.count) >= (said.episode, count):
            continue
        is_over = said.what in OVER
        told[said.fingerprint] = Told(said.episode, said.severity, not is_over, state.clock_s, count)
        shown = written.get(said.fingerprint)
        alert = alerts.get(said.fingerprint, shown)
        if not is_later or shown is None or alert is None or (alert is shown and len(alerts) >= ALERTS_MAX):
            continue
        alerts[said.fingerprint] = caught_up(alert, said.severity, said.episode, shown.ended_ms if is_over else None, beat)
    outbox = state.outbox
    if made.id not in state.settled and len(outbox) < OUTBOX_MAX:
        outbox = outbox | {made.id: made}
    return replace(state, receivers=state.receivers | {made.receiver: replace(known, told=told)}, outbox=outbox, alerts=alerts)
