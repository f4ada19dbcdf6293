"""The loop of a process: one host session for all of its processors, each message folded by those that read it.

    read what has come ──► each processor that reads its node folds it ──► send once for each connection

Where more comes than can be folded, what waits longer than IN_ORDER_S_MAX is folded sender by sender, and a sender that has more
than its share waiting has its data conflated (processors/running/backlog.py). A recorder is given each message as it comes.

Start: subscribe to the snapshots, then publish a marker behind them: when it comes back, all retained snapshots have come. Only
then is anything folded; what comes before waits.

The order is the broker's, for what the processors of this process say of each other too: so all processes, and a historian among
them, see one order. A message is folded by its readers in the order of their names, before the next one is looked at.
"""

import logging
import os
import socket
import time
from collections import deque
from collections.abc import Sequence
from threading import Event

from processors.description_folder import DescriptionFolder
from processors.errors import ProcessorsFailedError
from processors.lag_report import SPOKEN_OF_S, LagReport, topic_of
from processors.running.backlog import Backlog
from processors.running.cycles import seldom_looked_for
from processors.running.descriptions import Descriptions
from processors.running.engine import Way
from processors.running.lag import Lag
from processors.running.ledger import DropReason
from processors.running.overload import Overload
from processors.running.picks import stream_of
from processors.running.ports import HostPort
from processors.running.quarantine import quarantine_health
from processors.running.worker import Shared, Worker
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from twin.vocabulary import topics
from twin.vocabulary.nodes import is_twin_node

PROCESS = f"{socket.gethostname()}:{os.getpid()}"
POLL_S = 0.05
GATHER_S = 0.02  # what comes within it is read together: at the rates of a cell it is waking up that costs most
REPORT_S = 1.0
IN_ORDER_S_MAX = 0.5  # of work; what goes beyond it is folded as the backlog says
WAITING_IN_ORDER_MAX = 1000  # messages, behind those that were read
READ_S_MAX = 0.25  # to read what has come, before what waits is folded
WORK_S = 0.1  # to fold what waits, before what has come is read
RESTORE_S_MAX = 1.0  # to wait for the next snapshot, or for our own nodes
FINISH_S_MAX = 3.0  # to fold what waits, before the end
STALL_S = 1.0  # a longer pause of this process is no silence of the machine
WAITING_MAX = 100_000  # events, while the snapshots are awaited
_DATA, _PLAIN, _REFUSED = EventKind.DATA, EventKind.PLAIN, EventKind.REFUSED
_log = logging.getLogger(__name__)


class Runner:
    """See the module. All of it happens in the thread that calls `run`."""

    def __init__(self, host: HostPort, workers: Sequence[Worker], folder: DescriptionFolder | None = None) -> None:
        """`folder`: where people describe the machines."""
        self._host = host
        self.workers = tuple(sorted(workers, key=lambda worker: worker.name))
        self._recorders = tuple(worker for worker in self.workers if worker.records)
        self._names = ", ".join(worker.name for worker in self.workers)
        self._marker_topic = topics.marker_of(self.workers[0].name)
        self._readers: dict[str, tuple[Worker, ...]] = {}  # by node
        self._ways: dict[str, dict[NodeId, list[tuple[Worker, Way | None]]]] = {}  # by device and node
        for worker in self.workers:
            worker.forget_ways = self._ways.clear
        self._descriptions = Descriptions(host, self.workers, folder)
        self._waiting: deque[HostEvent] = deque()
        self._is_restored = False
        self._turned_s = time.monotonic()
        self._backlog = Backlog()
        self._overload = Overload()
        self._lag = Lag(self._turned_s, time.time(), time.process_time())
        self._speaks_of_lag = False
        self._reported_s = 0.0
        self._patient_until_s = 0.0
        self._dropped = 0

    def run(self, stop: Event) -> None:
        """Work until `stop` is set, then save, say goodbye and disconnect."""
        with seldom_looked_for():
            self._run(stop)

    def _run(self, stop: Event) -> None:
        of_workers = (topic_filter for worker in self.workers for topic_filter in worker.plain_filters())
        for topic_filter in dict.fromkeys((*self._descriptions.plain_filters(), *of_workers)):
            self._host.subscribe_plain(topic_filter)
        self._host.subscribe_plain(self._marker_topic)
        self._host.start()
        for worker in self.workers:
            worker.start()
        try:
            if self._restore(stop):
                self._begin(stop)
                while not stop.is_set():
                    self.turn()
                until_s = time.monotonic() + FINISH_S_MAX
                while self._backlog and time.monotonic() < until_s:
                    self._fold_waiting()
        finally:
            self._close()

    def turn(self) -> None:
        """One round: what has come, else silence; then what is due."""
        called_s = time.monotonic()
        backlog = self._backlog
        events = self._host.poll(0.0) if backlog else self._host.poll(POLL_S, GATHER_S)
        now_s = time.monotonic()
        self._record(events, now_s)
        if not (self._host.backlog or any(worker.backlog for worker in self.workers)):
            self._lag.published(now_s)  # all of the turns before
        if backlog or self._host.queue_depth > WAITING_IN_ORDER_MAX:
            self._put(events)
        else:
            self._take_in_order(events, now_s)
        if backlog:
            self._work_off(now_s)
        if max(now_s - called_s, called_s - self._turned_s) > STALL_S:
            self._patient_until_s = now_s + STALL_S  # we slept: what came meanwhile is still on its way to the queue
        self._turned_s = now_s
        if self._host.online and not self._host.queue_depth and now_s >= self._patient_until_s:
            for worker in self.workers:
                worker.silence(now_s)
        if now_s - self._reported_s >= REPORT_S:
            self._report_due(now_s)
        for worker in self.workers:
            worker.turn(now_s)

    def _take_in_order(self, events: Sequence[HostEvent], now_s: float) -> None:
        """Fold what has come in the broker's order; what takes too long waits in the backlog."""
        for place, event in enumerate(events):
            self._take(event, now_s)
            folded_s = time.monotonic()
            if folded_s - self._reported_s >= REPORT_S:  # however much has come
                self._report_due(folded_s)
            if folded_s - now_s >= IN_ORDER_S_MAX:
                self._put(events[place + 1 :])
                return

    def _work_off(self, now_s: float) -> None:
        """More has come than can be folded: read all of it, and fold what is next by the backlog's order for a while."""
        host = self._host
        while host.queue_depth and time.monotonic() - now_s < READ_S_MAX:
            events = host.poll(0.0)
            self._record(events, now_s)
            self._put(events)
        self._fold_waiting()

    def _fold_waiting(self) -> None:
        backlog = self._backlog
        before_s = began_s = time.monotonic()
        while backlog and before_s - began_s < WORK_S:
            self._take(backlog.take(), before_s)
            after_s = time.monotonic()
            backlog.spent(after_s - before_s)
            before_s = after_s
            if after_s - self._reported_s >= REPORT_S:
                self._report_due(after_s)

    def _put(self, events: Sequence[HostEvent]) -> None:
        """Have events wait; those that are passed over for them are counted by each processor that would have read them."""
        for event in events:
            for passed_over in self._backlog.put(event):
                self._overload.passed_over(passed_over.node)
                for worker in self._readers_of(passed_over):
                    worker.engine.lost(passed_over, DropReason.OVERLOAD)

    # Start and end.

    def _restore(self, stop: Event) -> bool:
        """Take the retained descriptions and then the snapshots; False where `stop` came first, and nothing is known that may be
        saved."""
        marked_s: float | None = None  # when the marker was published, or the last message before it has come
        retained: list[HostEvent] = []
        while not stop.is_set():
            if marked_s is None and self._host.publish_plain(self._marker_topic, b"all retained snapshots have come", qos=1):
                marked_s = time.monotonic()
            complete = False
            for event in self._host.poll(POLL_S):
                if event.topic == self._marker_topic:
                    complete = marked_s is not None
                    continue
                if event.kind is EventKind.PLAIN:
                    retained.append(event)
                    marked_s = None if marked_s is None else time.monotonic()
                self._wait_with(event)  # a snapshot too: a recorder may want it
            if not complete and marked_s is not None and time.monotonic() - marked_s > RESTORE_S_MAX:
                _log.warning("%s: the broker says nothing for %g s; what has come by now is all", self._names, RESTORE_S_MAX)
                complete = True
            if complete:
                self._restore_from(retained)
                return True
        return False

    def _restore_from(self, retained: Sequence[HostEvent]) -> None:
        """Take the first description of each topic, which was retained, and then the snapshots; what has come on a topic later
        waits with the messages of the machines."""
        now_s = time.monotonic()
        first = {event.topic: event for event in reversed(retained) if event.topic.startswith(topics.DESCRIPTION)}
        for event in first.values():
            self._descriptions.take(event, now_s)
        self._waiting = deque(event for event in self._waiting if event is not first.get(event.topic))
        for event in retained:
            for worker in self.workers:
                worker.restore(event)

    def _begin(self, stop: Event) -> None:
        """Fold what has come while the snapshots were awaited."""
        self._is_restored = True
        self._await_edges(stop)
        now_s = time.monotonic()
        for worker in self.workers:
            worker.begin(now_s)
        waiting, self._waiting = list(self._waiting), deque()
        self._take_in_order(waiting, now_s)

    def _await_edges(self, stop: Event) -> None:
        """Results can go out once our own nodes are born; a moment's patience saves the first ones."""
        until_s = time.monotonic() + RESTORE_S_MAX
        while not (all(worker.online for worker in self.workers) or stop.is_set() or time.monotonic() > until_s):
            for event in self._host.poll(POLL_S):
                self._wait_with(event)

    def _wait_with(self, event: HostEvent) -> None:
        self._record((event,), time.monotonic())
        if len(self._waiting) < WAITING_MAX:
            self._waiting.append(event)
            return
        for worker in self._readers_of(event):
            worker.engine.lost(event, DropReason.QUEUE_FULL)

    def _close(self) -> None:
        if self._is_restored:
            self._note_dropped()
            now_s = time.monotonic()
            shared = self._report(now_s)
            for worker in self.workers:
                worker.finish(now_s, shared)
        for worker in self.workers:
            worker.stop()
        self._host.stop()

    # What has come.

    def _record(self, events: Sequence[HostEvent], now_s: float) -> None:
        """Have what has come recorded, in the broker's order, before anything is folded."""
        for worker in self._recorders:
            for event in events:
                if event.kind is not _REFUSED and (event.kind is _PLAIN or worker in self._readers_of(event)):
                    worker.record(event, now_s)

    def _take(self, event: HostEvent, now_s: float) -> None:
        if event.kind is _PLAIN:
            if event.topic.startswith(topics.DESCRIPTION) and (described := self._descriptions.take(event, now_s)) is not None:
                self._ways.pop(described, None)
            for worker in self.workers:
                worker.take_plain(event, now_s)
            return
        if event.names:
            self._stream(event, now_s)
            return
        if event.kind not in (_DATA, _REFUSED) and event.device is not None:
            self._ways.pop(event.device, None)
        for worker in self._readers_of(event):
            worker.take(event, now_s)

    def _stream(self, event: HostEvent, now_s: float) -> None:
        """Data whose names are given take the shortest way through each processor, from one birth or death of the machine to the
        next."""
        source, device = event.node, event.device or ""
        of_device = self._ways.get(device)
        if of_device is None:
            of_device = self._ways[device] = {}
        ways = of_device.get(source)
        if ways is None:
            ways = of_device[source] = [(worker, None) for worker in self._readers_of(event)]
        message = stream_of(event)
        for place, (worker, way) in enumerate(ways):
            if way is None:  # the first message shows the way
                worker.take(event, now_s)
                ways[place] = (worker, worker.way_of(source, device))
            else:
                try:
                    actions = way(message, now_s)
                except Exception as error:
                    worker.failed(event, error, now_s)
                else:
                    if actions:
                        worker.send(actions, event, now_s)
        if not is_twin_node(source.node):
            self._lag.folded(source.node, event.timestamp_ms, time.monotonic())

    def _readers_of(self, event: HostEvent) -> tuple[Worker, ...]:
        """The processors that read the node of an event; they are found once for each node."""
        node = event.node.node
        readers = self._readers.get(node)
        if readers is None:
            readers = tuple(worker for worker in self.workers if worker.listens_to(node))
            self._readers[node] = readers
        return readers

    def _report_due(self, now_s: float) -> None:
        self._reported_s = now_s
        self._descriptions.look()
        self._note_dropped()
        shared = self._report(now_s)
        for worker in self.workers:
            worker.beat(now_s, shared)
        if all(worker.is_hopeless for worker in self.workers):
            told = "; ".join(f"{worker.name}: {worker.fault}" for worker in self.workers)
            raise ProcessorsFailedError(f"all processors of this process go on failing; see the log, and start it again ({told})")

    def _report(self, now_s: float) -> Shared:
        """Work out the lag, and say it where somebody should know. The alerts of this process hear of it without the way over the
        broker, on which it would come late."""
        self._lag.report(now_s, time.time(), time.process_time())
        at_ms = time.time_ns() // 1_000_000
        machines = max(len(worker.engine.machines) for worker in self.workers)
        names = tuple(worker.name for worker in self.workers)
        lag_s, busy_pct = round(self._lag.published_s, 3), round(self._lag.busy_pct, 1)
        speaks = lag_s >= SPOKEN_OF_S
        if speaks or self._speaks_of_lag:
            report = LagReport(names, PROCESS, at_ms, lag_s, machines, busy_pct)
            topic, payload = topic_of(names[0]), report.payload()
            self._host.publish_plain(topic, payload)
            for worker in self.workers:
                worker.take_plain(HostEvent(EventKind.PLAIN, NodeId("", ""), None, at_ms, topic=topic, payload=payload), now_s)
        self._speaks_of_lag = speaks
        return {
            "lag_s": round(self._lag.folded_s, 3),
            "published_lag_s": lag_s,
            "busy_pct": busy_pct,
            "process": PROCESS,
            "processors": len(names),
            **quarantine_health(self._host.quarantine),
            "overloaded_by": self._overload.report(now_s),
        }

    def _note_dropped(self) -> None:
        """Count the messages that the shared queue has lost: each processor that reads them has lost them."""
        overflowed = self._host.dropped - self._dropped
        self._dropped += overflowed
        for worker in self.workers:
            worker.engine.overflowed(overflowed)
        for node, count in self._host.take_thinned().items():
            self._overload.passed_over(node, count)
            for worker in self.workers:
                if worker.listens_to(node.node):
                    worker.engine.overflowed(count, DropReason.OVERLOAD)
