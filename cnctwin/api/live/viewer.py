"""The interface's ear on the broker: a thread that feeds the live plant and hands on what its readers are to be told."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

from cnctwin.api.live.batches import Batch
from cnctwin.api.live.documents import AlertsState, DocumentError, read_document
from cnctwin.api.live.jobs import LiveJobs
from cnctwin.api.live.loops import LiveLoops
from cnctwin.api.live.plant import LivePlant
from cnctwin.plant.descriptions import LiveDescriptions
from cnctwin.plant.watch import viewer
from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.broker import BrokerAddress
from sparkplug.clock import now_ms
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.values import PropertySet
from twin.vocabulary.topics import ALERT_STATE, DESCRIPTION

FLUSH_S = 0.1
POLL_S = 0.05
GATHER_S = 0.02
"""Between two looks at the broker: to wake for each message costs more than the message."""
OUTBOX_MAX = 100
_log = logging.getLogger(__name__)


class Viewer:
    """Between `start` and `stop` the plant and the jobs are kept up to date. `on_batches` is called from the thread."""

    def __init__(self, broker: BrokerAddress, group: str, live: LivePlant, limits: Limits = DEFAULTS) -> None:
        self.url = broker.url
        self.group = group
        self.on_batches: Callable[[list[Batch]], None] = lambda _: None
        self.jobs = LiveJobs()
        self.loops = LiveLoops()
        self.descriptions = LiveDescriptions()
        self._live = live
        self._host = viewer(broker, group, limits)
        for topic in (ALERT_STATE, *LiveDescriptions.filters, *LiveJobs.filters, *LiveLoops.filters):
            self._host.subscribe_plain(topic)
        self._outbox: deque[tuple[str, bytes, bool]] = deque(maxlen=OUTBOX_MAX)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="viewer", daemon=True)

    def start(self) -> None:
        """Begin to connect and to listen; returns at once."""
        self._host.start()
        self._thread.start()

    def stop(self) -> None:
        """Stop listening and disconnect."""
        self._stop.set()
        self._thread.join(5.0)
        self._host.stop()

    @property
    def alive(self) -> bool:
        """True if the thread runs."""
        return self._thread.is_alive()

    @property
    def online(self) -> bool:
        """True if the broker has accepted us."""
        return self._host.online

    @property
    def trouble(self) -> str:
        """Why there is no connection; empty while there is one."""
        return "" if self._host.online else self._host.last_error or f"no connection to {self.url} yet"

    def counts(self) -> dict[str, int]:
        """Return the counts of the session, with what the inbox dropped, how much waits in it, and connections made again."""
        host = self._host
        return {**host.counts, "dropped": host.dropped, "queue": host.queue_depth, "reconnects": host.reconnects}

    def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> bool:
        """Have a plain message sent; False where there is no connection or too much waits."""
        if not self._host.online or len(self._outbox) >= OUTBOX_MAX:
            return False
        self._outbox.append((topic, payload, retain))
        return True

    def _run(self) -> None:
        flushed_s = time.monotonic()
        while not self._stop.is_set():
            try:
                if events := self._host.poll(POLL_S):
                    self._take(events)
                    self._stop.wait(GATHER_S)
                while self._outbox:
                    topic, payload, retain = self._outbox.popleft()
                    self._host.publish_plain(topic, payload, qos=1, retain=retain)
                now_s = time.monotonic()
                if now_s - flushed_s >= FLUSH_S:
                    flushed_s = now_s
                    if batches := self._live.flush(now_ms()):
                        self.on_batches(batches)
            except Exception:
                # One message that we cannot digest is no reason to show nothing any more.
                _log.exception("the view failed at a message; it goes on with the next")
                self._live.counts["failures"] += 1
                self._stop.wait(POLL_S)

    def _take(self, events: list[HostEvent]) -> None:
        self._live.take(events, now_ms(), self._describe)
        for event in (one for one in events if one.kind is EventKind.PLAIN):
            try:
                self._take_document(event)
            except DocumentError as error:
                self._live.refuse("documents_refused", f"{event.topic}: {error}")

    def _take_document(self, event: HostEvent) -> None:
        if event.topic.startswith(DESCRIPTION):
            self.descriptions.take(event.topic, event.payload)
            self._live.description_faults = tuple((machine, fault.text) for machine, fault in self.descriptions.faults())
        elif event.topic != ALERT_STATE:
            self.jobs.take(event.topic, event.payload)
            self.loops.take(event.topic, event.payload)
        elif event.payload:
            self._live.take_alerts(read_document(event.payload, AlertsState))

    def _describe(self, node: NodeId, device: str | None) -> Mapping[str, PropertySet]:
        picture = self._host.picture(node)
        owner = None if picture is None else picture.owner(device)
        return {} if owner is None else owner.properties
