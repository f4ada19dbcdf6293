"""The loop that runs one edge.

    reader: control → frames → parse → tool change → report by exception → store → edge node → broker
    turns:  each tenth of a second: what is due in the store, the sensor, the health

Both are in the thread that all edges of the process share (`edge.running.driver`), but for a control that has to be waited for:
its reader is a thread of its own. So both hold the edge's lock while they work. A frame goes all its way in the thread that read
it: handing it to another one costs more, with many machines in one process, than the work itself. When that thread falls behind
it reads no more, the agent's buffer is the next to fill, and what it drops is a hole that is counted. Nothing is dropped without
a reason in the ledger. Without a store (`[store] enabled = false`) a row that finds no broker is dropped, and the next birth
carries the values.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from edge import tool_change
from edge.adapter import Adapter, Connection
from edge.clock import offset as clock
from edge.config import EdgeConfig
from edge.place import Place, PlaceFile
from edge.running.birth import device_metrics
from edge.running.driver import TURN_S, Driver
from edge.running.forwarder import Sender, Settled
from edge.running.health import Health
from edge.running.ledger import Ledger
from edge.running.pipeline import Outcome, Pipeline
from edge.running.reader import Reader
from edge.running.receipts import RECEIPT
from edge.running.sensor import sensor_of
from edge.running.unstored import Unstored
from edge.sample import UNAVAILABLE, Drop, EdgeSample, Offer, SampleSet, observations_of
from sparkplug.actions import HostState
from sparkplug.edge_session import Command
from sparkplug.metric import Change, MetricSpec

_log = logging.getLogger(__name__)
HISTORY_TURN_S = 0.02
FAREWELL_S_MAX = 5.0
REPORT_INTERVAL_S = 1.0


class Publisher(Sender, Protocol):
    """The part of `sparkplug.edge_node.EdgeNode` that is needed here."""

    def start(self) -> None: ...
    def stop(self, timeout_s: float = 5.0) -> None: ...
    def declare_device(self, device: str, metrics: Sequence[MetricSpec]) -> None: ...
    def remove_device(self, device: str) -> None: ...
    @property
    def reconnects(self) -> int: ...
    @property
    def unsent(self) -> int: ...


class Store(Protocol):
    """A store as the loop uses it: `Forwarder`, or `Unstored` where nothing is kept."""

    def place(self) -> Place | None: ...
    def memory(self) -> str | None: ...
    def metrics(self) -> Sequence[MetricSpec]: ...
    def declare(self, names: Iterable[str]) -> None: ...
    def put(self, rows: Sequence[Sequence[EdgeSample]], place: Place | None, memory: str | None = None) -> Settled: ...
    def confirmed(self, token: int) -> None: ...
    def receipt(self, text: str) -> None: ...
    def host_state(self, host: str, state: HostState | None) -> None: ...
    def pump(self) -> Settled: ...
    def close(self) -> None: ...
    @property
    def observations(self) -> int: ...
    @property
    def is_done(self) -> bool: ...
    @property
    def is_behind(self) -> bool: ...
    def health(self) -> Mapping[str, int | float | str | bool]: ...


class Arrival(NamedTuple):
    """One parsed frame, when it came (by the monotonic clock and by the wall's), and where in the control's stream it ends."""

    frame: SampleSet
    at_s: float
    wall_ms: int
    place: Place | None = None


class EdgeRuntime:
    """One edge. `run` returns when `stop` is set. `driver`: the one that edges share; None: one of its own."""

    def __init__(
        self,
        config: EdgeConfig[Any],
        adapter: Adapter,
        node: Publisher,
        *,
        ledger: Ledger | None = None,
        place_file: Path | None = None,
        open_store: Callable[[Publisher], Store] | None = None,
        restarts: int = 0,
        driver: Driver | None = None,
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
        self._restarts = restarts
        self._driver = driver
        self._cursor: Any = None
        self._sensor = sensor_of(config.accelerometer)
        self._store: Store = Unstored(node, config.machine.name, self._places)
        self._open_store = open_store or (lambda _: self._store)
        self._wall_s, self._clock = wall_s, monotonic_s
        self._lock = threading.Lock()
        self._pipeline = Pipeline(config)
        self._clocks = clock.State()
        self._clock_health: dict[str, int | float | str | bool | None] = {}
        self._offers: tuple[Offer, ...] = ()
        self._told: dict[str, EdgeSample] = {}  # the latest of each signal, as far as the rows have gone
        self._is_declared = False
        self._is_reporting = True  # whether the control gives values, as far as its server knows
        self._was_available = False
        self._fault = 0, ""
        self._reported_s = self._due_s = monotonic_s()
        self.health = Health()
        self._crash: BaseException | None = None

    def run(self) -> None:
        """Read, fold and publish until stopped; then publish the last ledger and the death certificates."""
        if self._driver is not None:
            self._run(self._driver)
            return
        driver = Driver()
        driver.start()
        try:
            self._run(driver)
        finally:
            driver.stop()

    def _run(self, driver: Driver) -> None:
        place = self._places.read()
        self._store = self._open_store(self._node)
        self._pipeline = Pipeline(self.config, self._store.memory())
        self.ledger.recover(self._store.observations, self._pipeline.held)
        place = self._store.place() or place
        self._cursor = self._adapter.start(self.config) if place is None else self._adapter.resume(self.config, place)
        self._connection.follow(self._cursor)
        reader = Reader(self._adapter.name, self._connection, driver, self._read, self._ended)
        self._node.start()
        reader.start()
        self._sensor.start()
        driver.add(self)
        try:
            self.stop.wait()
        finally:
            self.stop.set()
            driver.remove(self)
            try:
                self._connection.close()
                self._sensor.close()
                self._finish(reader)
            finally:  # a node that is not stopped would keep the name of this edge, and throw out the next one that has it
                self._node.stop()
                with self._lock:
                    self._store.close()
        if self._crash is not None:
            raise self._crash

    def turn(self) -> float:
        """Do what is due; the seconds until the next turn. An error of ours ends the edge, loudly."""
        try:
            self._turn()
            if self._clock() >= self._due_s:
                self._due_s = self._clock() + REPORT_INTERVAL_S
                self._report()
        except BaseException as error:
            self._ended(error)
        return HISTORY_TURN_S if self._store.is_behind else TURN_S  # history goes out a little at a time

    def _finish(self, reader: Reader) -> None:
        deadline_s = self._clock() + FAREWELL_S_MAX
        reader.join(FAREWELL_S_MAX)
        with self._lock:
            self._store.declare(())  # what history is not out yet waits for the next life
        while not self._store.is_done and self._node.online and self._clock() < deadline_s:
            self._turn()
            time.sleep(0.01)
        self._report()

    def confirmed(self, token: int) -> None:
        """The broker has acknowledged a barrier of the store. From any thread."""
        self._store.confirmed(token)

    def commanded(self, command: Command) -> None:
        """A host has written a value. The only one that is heeded is the receipt of a memory. From any thread."""
        is_receipt = command.name == RECEIPT and command.device == self.config.machine.name
        if is_receipt and isinstance(command.value, str):
            self._store.receipt(command.value)

    def host_state(self, host: str, state: HostState | None) -> None:
        """A historian has said whether it is there. From any thread."""
        self._store.host_state(host, state)

    def _read(self, raw: bytes) -> None:
        """One frame, all its way."""
        self._cursor, frame = self._adapter.parse(self.config, self._cursor, raw)
        self._connection.follow(self._cursor)
        self.ledger.queue(frame.received)
        now = self._clock(), round(self._wall_s() * 1000)
        with self._lock:
            self._take(Arrival(frame, *now, self._adapter.place(self._cursor)))

    def _ended(self, error: BaseException | None) -> None:
        """Whatever ends the reader, or a turn, that was not asked for ends the edge."""
        self._crash = self._crash or error
        self.stop.set()

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
        self.ledger.settle(
            taken=frame.received, emitted=emitted, dropped=dropped, held=self._pipeline.held, stored=self._store.observations
        )

    def _sense(self) -> None:
        """Publish what the accelerometer has sent: figures like those of the control, and raw blocks, which are live or lost."""
        for delivery in self._sensor.taken():
            self.health.holes_in(delivery.frame.gaps)
            self._publish(self._pipeline.declare(delivery.frame.samples), None)
            for change in delivery.changes if self._is_declared else ():
                self._node.publish(self.config.machine.name, [change])

    def _compare_clocks(self, arrival: Arrival) -> None:
        """Take in what the frame says of the control's clock."""
        known = None if self._clocks.published is None else self._clocks.published.bound
        peak = self._sensor.peak(arrival.frame.samples, arrival.at_s, 0.0 if known is None else known.offset_s)
        done = clock.step(self._clocks, clock.heard(arrival.frame, arrival.at_s, arrival.wall_ms, peak))
        self._clocks = done.state
        self._clock_health |= done.health
        if done.samples:
            self._publish(self._pipeline.declare(done.samples), None)

    def _settle(self) -> None:
        """Count what has come to its end in the store."""
        emitted, dropped = self._store.pump()
        held, stored = self._pipeline.held, self._store.observations
        self.ledger.settle(taken=0, emitted=emitted, dropped=dropped, held=held, stored=stored)

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
        dropped = dict(outcome.dropped)
        rows: list[Sequence[EdgeSample]] = []
        self._declare_if_due()
        for row in outcome.rows:
            # The birth shows the state up to this row and no further: what follows must not be older than what is known.
            self._told.update((sample.signal, sample) for sample in row)
            self._declare_if_due()
            if self._is_declared:
                rows.append(row)
            else:
                dropped[Drop.CONTROL_LOST] = dropped.get(Drop.CONTROL_LOST, 0) + observations_of(row)
        memory = self._pipeline.memory()
        settled = self._store.put(rows, place, memory)
        if memory is not None:
            self._pipeline.keep_memory()
        for reason, number in settled.dropped.items():
            dropped[reason] = dropped.get(reason, 0) + number
        return settled.emitted, dropped

    def _declare_if_due(self) -> None:
        """The birth, as soon as there is something to say and the control reports."""
        if self._is_declared or not self._is_reporting or not self._offers or not self._told:
            return
        now_ms = round(self._wall_s() * 1000)
        known = device_metrics((*self._offers, *self._sensor.offers()), self._told, now_ms)
        metrics = [*known, *self._sensor.metrics(), *self._store.metrics()]
        self._store.declare(metric.name for metric in metrics)
        self._node.declare_device(self.config.machine.name, metrics)
        self._is_declared = True

    def _remove(self) -> None:
        self._node.remove_device(self.config.machine.name)
        self._is_declared = False
        self._store.declare(())

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
        outside |= {**self._store.health(), **self._sensor.health()}
        fault = self._connection.reconnects, self._connection.last_error
        if fault != self._fault:
            if fault[1] != self._fault[1]:
                _log.warning("%s: %s", self.config.machine.name, fault[1] or "the control answers again")
            self._fault, self.health.last_error = fault, fault[1]
        self._node.publish(None, [Change(name, number, now_ms) for name, number in counters.items()])
        self._node.publish(None, self.health.changes(now_ms, outside))
