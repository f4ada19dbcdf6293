"""The courier at work: one thread for the broker, and one for each receiver, so that a slow one holds up no other.

Start: what is retained is awaited (a marker published behind the subscriptions comes back last); only then is anything sent.
"""

import json
import logging
import queue
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple
from uuid import uuid4

from processors.alerts.config import AlertsConfig
from processors.alerts.courier.alertmanager import Alertmanager
from processors.alerts.courier.desk import CLAIM, DELIVERY, OUTBOX, Desk, Publish, Send
from processors.alerts.courier.outcome import Outcome, Verdict
from processors.alerts.courier.pushover import Pushover
from processors.alerts.courier.receipts import ACK, RECEIPT, Acknowledge, Ask, Cancel, Receipts
from processors.alerts.courier.service import Service, service_of
from processors.alerts.notification import Notification
from sparkplug.broker import BrokerAddress
from sparkplug.host import HostApplication
from sparkplug.host_session import EventKind, HostEvent
from twin.vocabulary import topics

STATE = topics.ALERT_STATE
MARKER = topics.marker_of("courier")
POLL_S = 0.05
POLLS_S_MIN = 5.0  # of Pushover
SAY_MARKER_AGAIN_S = 2.0
FAREWELL_S_MAX = 10.0
RESULTS_MAX = 100
_log = logging.getLogger(__name__)


class _Work(NamedTuple):
    """A task of a receiver's thread, and the use of its result in the courier's thread."""

    do: Callable[[], Any]
    then: Callable[[Any], None]


class Courier:
    """See the module. Making it reads all secrets, and raises ConfigurationError where one is missing."""

    def __init__(self, broker: BrokerAddress, config: AlertsConfig, group: str = "cnc", member: str = "") -> None:
        """`member`: where the courier moves between computers, whose it is. For as long as two of them overlap, both then stay
        connected, and their claims say who sends what."""
        self._services: dict[str, Service] = {name: service_of(name, one) for name, one in config.receivers.items()}
        self._desk = Desk(uuid4().hex[:12], {name: one.give_up_after_s for name, one in config.receivers.items()})
        polls_s = {name: max(one.poll_s, POLLS_S_MIN) for name, one in config.receivers.items() if one.type == "pushover"}
        self._receipts = Receipts(polls_s)
        resend_s = {name: one.resend_s for name, one in config.receivers.items() if one.type == "alertmanager"}
        self._resend_s, self._resent_s = resend_s, dict.fromkeys(resend_s, 0.0)
        self._host = HostApplication(broker, f"courier-{group}{member and f'-{member}'}", (), publish_state=False)
        self._state: Mapping[str, Any] = {}
        self._works: dict[str, queue.Queue[_Work | None]] = {name: queue.Queue(maxsize=1) for name in self._services}
        self._busy: set[str] = set()
        self._results: queue.Queue[tuple[str, Callable[[Any], None], Any]] = queue.Queue(maxsize=RESULTS_MAX)
        self._stopping = threading.Event()
        self._is_complete = False
        self._marked_s: float | None = None
        self._marker = uuid4().hex.encode()
        self._thread = threading.Thread(target=self._run, name="courier", daemon=True)
        self._senders = [
            threading.Thread(target=self._serve, args=(name,), name=f"courier {name}", daemon=True) for name in self._services
        ]

    def start(self) -> None:
        """Begin; returns at once."""
        for topic in (OUTBOX, CLAIM, DELIVERY, RECEIPT):
            self._host.subscribe_plain(f"{topic}+")
        self._host.subscribe_plain(STATE)
        self._host.subscribe_plain(MARKER)
        self._host.start()
        for thread in [self._thread, *self._senders]:
            thread.start()

    def stop(self, timeout_s: float = FAREWELL_S_MAX + 5.0) -> None:
        """Send nothing new, wait for what is being sent, say what became of it, and end."""
        self._stopping.set()
        self._thread.join(timeout_s)
        self._host.stop()

    @property
    def is_alive(self) -> bool:
        """True while the courier's thread runs."""
        return self._thread.is_alive()

    # The courier's thread.

    def _run(self) -> None:
        while not self._stopping.is_set():
            self._turn_guarded()
        self._desk.close()
        deadline_s = time.monotonic() + FAREWELL_S_MAX
        while time.monotonic() < deadline_s and self._host.online and (self._desk.sending or self._desk.unseen):
            self._turn_guarded()
        for works in self._works.values():
            works.put(None)  # a sender that has not taken its last work yet does so now: there is room at once

    def _turn_guarded(self) -> None:
        """One round. A bug in it must not end the courier, and with it every notification to come."""
        try:
            self._turn()
        except Exception:
            _log.exception("the courier failed in a round, and goes on")
            time.sleep(1.0)

    def _turn(self) -> None:
        for event in self._host.poll(POLL_S):
            if event.kind is EventKind.PLAIN:
                self._take(event)
        while not self._results.empty():
            name, then, result = self._results.get_nowait()
            self._busy.discard(name)
            then(result)
        now_s, wall_s = time.monotonic(), time.time()
        self._mark(now_s)
        free = frozenset() if self._stopping.is_set() else frozenset(self._services.keys() - self._busy)
        self._desk.tick(now_s, wall_s, free)
        self._act()
        if self._is_complete and not self._stopping.is_set():
            self._attend(now_s, wall_s)

    def _mark(self, now_s: float) -> None:
        if self._is_complete or (self._marked_s is not None and now_s - self._marked_s < SAY_MARKER_AGAIN_S):
            return
        if self._host.publish_plain(MARKER, self._marker, qos=1):
            self._marked_s = now_s

    def _take(self, event: HostEvent) -> None:
        topic, payload = event.topic, event.payload
        key = topic.rpartition("/")[2]
        if topic == MARKER:
            if payload == self._marker:
                self._is_complete = True
                self._desk.complete()
        elif topic == STATE:
            self._take_state(payload)
        elif topic.startswith(OUTBOX):
            self._desk.outbox(key, payload)
        elif topic.startswith(CLAIM):
            self._desk.claim(key, payload, time.monotonic())
        elif topic.startswith(DELIVERY):
            self._desk.delivery(key, payload)
        elif topic.startswith(RECEIPT):
            self._receipts.found(key, payload)
        self._act()

    def _take_state(self, payload: bytes) -> None:
        try:
            state = json.loads(payload)
            if isinstance(state, dict):
                self._receipts.state(state)
                self._state = state
        except (ValueError, KeyError, TypeError, RecursionError):
            _log.warning("%s holds no state of alerts", STATE)

    def _act(self) -> None:
        for action in self._desk.take():
            if isinstance(action, Send):
                self._send(action.message)
            else:
                self._publish(action)

    def _publish(self, action: Publish) -> None:
        self._host.publish_plain(action.topic, action.payload, qos=1, retain=True)

    def _send(self, message: Notification) -> None:
        service = self._services[message.receiver]

        def then(outcome: Outcome) -> None:
            if outcome.verdict is not Verdict.DELIVERED:
                _log.warning("notification %s to %s: %s: %s", message.id, message.receiver, outcome.verdict.value, outcome.reason)
            if outcome.receipt:
                receipt, statements = outcome.receipt, message.statements
                self._publish(self._receipts.opened(message.id, message.receiver, receipt, statements, time.time()))
            self._desk.result(message.id, outcome, time.monotonic())
            self._act()

        self._hand(message.receiver, lambda: service.send(message), then)

    def _hand(self, name: str, do: Callable[[], Any], then: Callable[[Any], None]) -> None:
        self._busy.add(name)
        self._works[name].put_nowait(_Work(do, then))

    # Beside notifications: receipts, and what is to be kept firing at an Alertmanager.

    def _attend(self, now_s: float, wall_s: float) -> None:
        free = frozenset(self._services.keys() - self._busy - self._desk.engaged)
        for action in self._receipts.due(now_s, wall_s, free):
            if isinstance(action, Ask | Cancel):
                self._ask(action)
            else:
                self._answer(action)
        for name, resend_s in self._resend_s.items():
            if name in free and name not in self._busy and now_s - self._resent_s[name] >= resend_s:
                self._resent_s[name] = now_s
                self._refresh(name)

    def _ask(self, action: Ask | Cancel) -> None:
        service = self._services[action.receiver]
        if not isinstance(service, Pushover):
            return
        if isinstance(action, Cancel):
            cancelled = self._receipts.cancelled
            self._hand(
                action.receiver,
                lambda: service.cancel(action.receipt),
                lambda is_done: self._answer(*cancelled(action.key, is_done is True)),
            )
        else:
            answered = self._receipts.answered
            self._hand(
                action.receiver,
                lambda: service.ask(action.receipt),
                lambda state: self._answer(*answered(action.key, None if isinstance(state, Outcome) else state)),
            )

    def _answer(self, *actions: Publish | Acknowledge) -> None:
        for action in actions:
            if isinstance(action, Acknowledge):
                self._host.publish_plain(ACK, action.payload, qos=1)
            else:
                self._publish(action)

    def _refresh(self, name: str) -> None:
        service = self._services[name]
        alerts = [alert for alert in self._state.get("alerts", ()) if name in alert.get("told", ())]
        if not alerts or not isinstance(service, Alertmanager):
            return

        def then(outcome: Outcome) -> None:
            if outcome.verdict is not Verdict.DELIVERED:
                _log.warning("alerts are not kept firing at %s: %s", name, outcome.reason)

        self._hand(name, lambda: service.refresh(alerts), then)

    # A receiver's thread.

    def _serve(self, name: str) -> None:
        while (work := self._works[name].get()) is not None:
            try:
                result = work.do()
            except Exception as error:  # whatever a service does, it has an outcome; its text may hold a secret
                result = Outcome(Verdict.UNSURE, f"{type(error).__name__} while sending; it may have arrived")
            self._results.put((name, work.then, result))
