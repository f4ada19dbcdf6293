"""The loop that runs one edge.

    connection thread: control → frames → parse → tool change → report by exception → store → edge node → broker
    main thread:       each tenth of a second: what is due in the store, the sensor, the health

Both hold the edge's lock while they work. A frame goes all its way in the thread that read it: handing it to another one costs
more, with many machines in one process, than the work itself. When that thread falls behind it reads no more, the agent's buffer
is the next to fill, and what it drops is a hole that is counted. Nothing is dropped without a reason in the ledger. Without a
store (`[store] enabled = false`) a row that finds no broker is dropped, and the next birth carries the values.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from edge import tool_change
from edge.accelerometer.sensor import Accelerometer
from edge.adapter import Adapter, Connection
from edge.clock import offset as clock
from edge.clock import signals as clock_signals
from edge.config import EdgeConfig
from edge.place import Place, PlaceFile
from edge.running.birth import device_metrics
from edge.running.forwarder import SEQUENCE, Forwarder, Sender
from edge.running.health import Health
from edge.running.ledger import Ledger
from edge.running.pipeline import Outcome, Pipeline
from edge.running.receipts import RECEIPT
from edge.sample import UNAVAILABLE, Drop, EdgeSample, Offer, SampleSet
from sparkplug.datatype import DataType
from sparkplug.edge_session import Command
from sparkplug.metric import Change, MetricSpec

_log = logging.getLogger(__name__)
TURN_S, HISTORY_TURN_S = 0.1, 0.02
FAREWELL_S_MAX = 5.0
SPEED_POLL_S = 0.35  # how far apart speeds of the spindle are at least
ENVELOPE_MAX = 3000  # of a sensor, ten a second
REPORT_INTERVAL_S = 1.0


class Publisher(Sender, Protocol):
    """What the loop needs of `sparkplug.edge_node.EdgeNode`."""

    def start(self) -> None: ...
    def stop(self, timeout_s: float = 5.0) -> None: ...
    def declare_device(self, device: str, metrics: Sequence[MetricSpec]) -> None: ...
    def remove_device(self, device: str) -> None: ...
    @property
    def reconnects(self) -> int: ...
    @property
    def unsent(self) -> int: ...


class Arrival(NamedTuple):
    """One parsed frame, when it came (by the monotonic clock and by the wall's), and where in the control's stream it ends."""

    frame: SampleSet
    at_s: float
    wall_ms: int
    place: Place | None = None


class EdgeRuntime:
    """One edge. `run` returns when `stop` is set."""

    def __init__(
        self,
        config: EdgeConfig[Any],
        adapter: Adapter,
        node: Publisher,
        *,
        ledger: Ledger | None = None,
        place_file: Path | None = None,
        open_store: Callable[[Publisher], Forwarder] | None = None,
        restarts: int = 0,
        wall_s: Callable[[], float] = time.time,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = config
        self.ledger = ledger or Ledger()
        self.stop = threading.Event()
        self._adapter = adapter
        self._node = node
        self._connection: Connection = adapter.connect(config)
        self._places = PlaceFile(place_file)
        self._open_store, self._restarts = open_store, restarts
        self._sensor = Accelerometer(config.accelerometer) if config.accelerometer.url else None
        self._forwarder: Forwarder | None = None
        self._wall_s, self._clock = wall_s, monotonic_s
        self._lock = threading.Lock()
        self._pipeline = Pipeline(config)
        self._clocks, self._signals = clock.State(), clock_signals.State()
        self._envelope: deque[tuple[float, float]] = deque(maxlen=ENVELOPE_MAX)
        self._clock_health: dict[str, int | float | str | bool | None] = {}
        self._offers: tuple[Offer, ...] = ()
        self._told: dict[str, EdgeSample] = {}  # the latest of each signal, as far as the rows have gone
        self._is_declared = False
        self._is_reporting = True  # whether the control gives values, as far as its server knows
        self._was_available = False
        self._fault = 0, ""
        self._reported_s = monotonic_s()
        self.health = Health()
        self._crash: BaseException | None = None

    def run(self) -> None:
        """Read, fold and publish until stopped; then publish the last ledger and the death certificates."""
        place = self._places.read()
        if self._open_store is not None:
            self._forwarder = self._open_store(self._node)
            self._pipeline = Pipeline(self.config, self._forwarder.memory())
            self.ledger.recover(self._forwarder.observations, self._pipeline.held)
            place = self._forwarder.place() or place
        reader = threading.Thread(target=self._read, args=(place,), name=f"{self._adapter.name}-reader", daemon=True)
        self._node.start()
        reader.start()
        if self._sensor is not None:
            self._sensor.start()
        due_s = self._clock()
        try:
            while not self.stop.wait(self._pause_s):
                self._turn()
                if self._clock() >= due_s:
                    due_s = self._clock() + REPORT_INTERVAL_S
                    self._report()
        finally:
            self.stop.set()
            try:
                self._connection.close()
                if self._sensor is not None:
                    self._sensor.close()
                self._finish(reader)
            finally:  # a node that is not stopped would keep the name of this edge, and throw out the next one that has it
                self._node.stop()
                if self._forwarder is not None:
                    with self._lock:
                        self._forwarder.close()
        if self._crash is not None:
            raise self._crash

    def _finish(self, reader: threading.Thread) -> None:
        deadline_s = self._clock() + FAREWELL_S_MAX
        reader.join(FAREWELL_S_MAX)
        if self._forwarder is not None:
            with self._lock:
                self._forwarder.declare(())  # what history is not out yet waits for the next life
        while self._forwarder is not None and not self._forwarder.is_done and self._node.online and self._clock() < deadline_s:
            self._turn()
            time.sleep(0.01)
        self._report()

    def confirmed(self, token: int) -> None:
        """The broker has acknowledged a barrier of the store. From any thread."""
        if self._forwarder is not None:
            self._forwarder.confirmed(token)

    def commanded(self, command: Command) -> None:
        """A host has written a value. The only one that is heeded is the receipt of a memory. From any thread."""
        is_receipt = command.name == RECEIPT and command.device == self.config.machine.name
        if is_receipt and self._forwarder is not None and isinstance(command.value, str):
            self._forwarder.receipt(command.value)

    def _read(self, place: Place | None) -> None:
        """The connection thread. Whatever ends it that was not asked for ends the edge, loudly."""
        try:
            cursor = self._adapter.start(self.config) if place is None else self._adapter.resume(self.config, place)
            self._connection.follow(cursor)
            for raw in self._connection.frames():
                cursor, frame = self._adapter.parse(self.config, cursor, raw)
                self._connection.follow(cursor)
                self.ledger.queue(frame.received)
                now = self._clock(), round(self._wall_s() * 1000)
                with self._lock:
                    self._take(Arrival(frame, *now, self._adapter.place(cursor)))
        except BaseException as error:
            self._crash = error
        finally:
            self.stop.set()

    @property
    def _pause_s(self) -> float:
        """Until the next turn: short while history waits, which goes out a little at a time."""
        return HISTORY_TURN_S if self._forwarder is not None and self._forwarder.is_behind else TURN_S

    def _turn(self) -> None:
        with self._lock:
            self._settle()
            self._sense()
            self._watch()

    def _take(self, arrival: Arrival) -> None:
        frame = arrival.frame
        self.health.note(frame, self._wall_s())
        if frame.offers is not None:
            self._offered(frame.offers)
        self._compare_clocks(arrival)
        outcome = self._pipeline.take(frame, arrival.at_s)
        self._judge(frame, arrival.at_s)
        emitted, dropped = self._publish(outcome, arrival.place)
        self.ledger.settle(taken=frame.received, emitted=emitted, dropped=dropped, held=self._pipeline.held, stored=self._stored)
        if self._forwarder is None:
            self._places.keep(arrival.place)

    def _sense(self) -> None:
        """What the accelerometer has sent: figures like those of the control, and raw blocks, which are live or lost."""
        for delivery in self._sensor.taken() if self._sensor is not None else ():
            self.health.holes_in(delivery.frame.gaps)
            self._envelope.extend(delivery.envelope)
            self._publish(self._pipeline.declare(delivery.frame.samples), None)
            for change in delivery.changes if self._is_declared else ():
                self._node.publish(self.config.machine.name, [change])

    def _compare_clocks(self, arrival: Arrival) -> None:
        """What the frame says of the control's clock."""
        peak = None
        if self._sensor is not None:  # whose clock is the edge's own: what the spindle does shows in both
            news = clock_signals.News(clock_signals.speed_of(arrival.frame.samples), tuple(self._envelope))
            self._envelope.clear()
            known = None if self._clocks.told is None else self._clocks.told.bound
            around_s = 0.0 if known is None else known.offset_s
            self._signals, peak = clock_signals.step(
                self._signals, news, at_s=arrival.at_s, around_s=around_s, poll_s=SPEED_POLL_S
            )
        done = clock.step(self._clocks, clock.heard(arrival.frame, arrival.at_s, arrival.wall_ms, peak))
        self._clocks = done.state
        self._clock_health |= done.health
        if done.samples:
            self._publish(self._pipeline.declare(done.samples), None)

    @property
    def _stored(self) -> int:
        return 0 if self._forwarder is None else self._forwarder.observations

    def _settle(self) -> None:
        """What has come to its end in the store."""
        if self._forwarder is not None:
            emitted, dropped = self._forwarder.pump()
            self.ledger.settle(taken=0, emitted=emitted, dropped=dropped, held=self._pipeline.held, stored=self._stored)

    def _offered(self, offers: tuple[Offer, ...]) -> None:
        """The control has described itself. Other signals than before need a new birth."""
        if self._is_declared and offers != self._offers:
            self._remove()
        self._offers = offers
        if not {offer.signal for offer in offers} & {"tool_number", "nc_block"}:
            self._publish(self._pipeline.declare(tool_change.not_observable(round(self._wall_s() * 1000))), None)

    def _judge(self, frame: SampleSet, at_s: float) -> None:
        """Does the control report? Its server says so; where that never did, one signal that is not unavailable is enough."""
        if frame.available is not None and (frame.available or self._was_available):
            self._is_reporting = frame.available
        elif not self._was_available:
            told = [sample for sample in self._pipeline.last if sample.observations and sample.signal != "alarm"]
            self._is_reporting = not told or any(sample.reason != UNAVAILABLE for sample in told)
        self._was_available |= frame.available is True
        if self._is_reporting and frame.error is None:
            self._reported_s = at_s

    def _publish(self, outcome: Outcome, place: Place | None) -> tuple[int, dict[Drop, int]]:
        """Send the rows. While the control is lost its device is dead, and what still comes is dropped with that reason."""
        emitted, dropped = 0, dict(outcome.dropped)
        stored: list[Sequence[EdgeSample]] = []
        self._declare_if_due()
        for row in outcome.rows:
            # The birth shows the state up to this row and no further: what follows must not be older than what is known.
            self._told.update((sample.signal, sample) for sample in row)
            self._declare_if_due()
            observations = sum(sample.observations for sample in row)
            if not self._is_declared:
                dropped[Drop.CONTROL_LOST] = dropped.get(Drop.CONTROL_LOST, 0) + observations
            elif self._forwarder is not None:
                stored.append(row)
            elif self._send(row):
                emitted += observations
            else:
                dropped[Drop.BROKER_OFFLINE] = dropped.get(Drop.BROKER_OFFLINE, 0) + observations
        if self._forwarder is not None:
            self._forwarder.put(stored, place, self._pipeline.memory())
        return emitted, dropped

    def _send(self, row: Iterable[EdgeSample]) -> bool:
        changes = [Change(s.signal, s.value, s.timestamp_ms, s.quality, s.reason) for s in row]
        return self._node.publish(self.config.machine.name, changes)

    def _declare_if_due(self) -> None:
        """The birth, as soon as there is something to say and the control reports."""
        if self._is_declared or not self._is_reporting or not self._offers or not self._told:
            return
        sensed = () if self._sensor is None else self._sensor.offers()
        metrics = device_metrics((*self._offers, *sensed), self._told)
        if self._sensor is not None:
            metrics.extend(self._sensor.metrics())
        if self._forwarder is not None:
            metrics.append(MetricSpec(SEQUENCE, DataType.INT64))
            if self.config.store.await_receipt:
                metrics.append(MetricSpec(RECEIPT, DataType.STRING))
            self._forwarder.declare(metric.name for metric in metrics)
        self._node.declare_device(self.config.machine.name, metrics)
        self._is_declared = True

    def _remove(self) -> None:
        self._node.remove_device(self.config.machine.name)
        self._is_declared = False
        if self._forwarder is not None:
            self._forwarder.declare(())

    def _watch(self) -> None:
        """Declare the device dead when the control has been lost for long."""
        if self._is_declared and self._clock() - self._reported_s > self.config.machine.lost_after_s:
            self._remove()

    def _report(self) -> None:
        """The ledger in one message, the health in another."""
        with self._lock:
            self._tell_health()

    def _tell_health(self) -> None:
        now_ms = round(self._wall_s() * 1000)
        counters = self.ledger.snapshot()
        outside: dict[str, int | float | str | bool] = {
            "health/reconnects": self._connection.reconnects,
            "health/control_online": self._is_declared,
            "health/broker_reconnects": self._node.reconnects,
            "health/unsent_messages": self._node.unsent,
            "health/restarts": self._restarts,
            "health/ledger_difference": Ledger.difference(counters),
        }
        outside |= {name: value for name, value in self._clock_health.items() if value is not None}
        if self._forwarder is not None:
            outside |= self._forwarder.health()
        if self._sensor is not None:
            outside |= self._sensor.health()
        fault = self._connection.reconnects, self._connection.last_error
        if fault != self._fault:
            if fault[1] != self._fault[1]:
                _log.warning("%s: %s", self.config.machine.name, fault[1] or "the control answers again")
            self._fault, self.health.last_error = fault, fault[1]
        self._node.publish(None, [Change(name, number, now_ms) for name, number in counters.items()])
        self._node.publish(None, self.health.changes(now_ms, outside))
