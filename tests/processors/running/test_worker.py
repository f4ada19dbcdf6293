"""The loop around the engine, with a host and an edge node that a test holds in its hands."""

import json
import logging
import time
from collections import deque
from collections.abc import Iterable, Sequence
from threading import Event, Timer
from typing import Any

import pytest

from processors.alerts.processor import PROCESSOR as ALERTS
from processors.config import Configuration
from processors.discovery import AnyProcessor
from processors.lag_report import parsed
from processors.running.ledger import DropReason
from processors.running.runner import Runner
from processors.running.worker import Worker
from processors.thermal import PROCESSOR as THERMAL
from sparkplug.actions import Publish
from sparkplug.admission.refusal import Quarantined
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId
from tests.processors.recorder import RECORDER
from tests.processors.streams import EDGE, birth, data, death, engine_of, fed

NOWHERE = NodeId("", "")


class FakeHost:
    """A broker that answers at once: retained snapshots first, then the marker, as Mosquitto does."""

    def __init__(self, *live: HostEvent, retained: dict[str, bytes] | None = None, marker: bool = True) -> None:
        self.dropped = 0
        self.online = True
        self.reconnects = 0
        self.started = self.stopped = False
        self.quarantine: tuple[Quarantined, ...] = ()
        self.retained = retained or {}
        self.thinned: dict[NodeId, int] = {}
        self.plain: list[tuple[str, bytes, bool]] = []
        self.subscriptions: list[str] = []
        self.wanted: list[NodeId] = []
        self.born: dict[tuple[NodeId, str | None], HostEvent] = {}  # a birth of each device that is online
        self._marker = marker
        self._events: deque[HostEvent] = deque(live)
        self._stop_when_empty: Event | None = None

    @property
    def queue_depth(self) -> int:
        return len(self._events)

    @property
    def backlog(self) -> int:
        return 0

    def start(self) -> None:
        self.started = True

    def stop(self) -> None:
        self.stopped = True

    def subscribe_plain(self, topic_filter: str) -> None:
        assert not self.started, "subscriptions come first"
        self.subscriptions.append(topic_filter)

    def want_birth(self, node: NodeId) -> None:
        self.wanted.append(node)

    def take_thinned(self) -> dict[NodeId, int]:
        thinned, self.thinned = self.thinned, {}
        return thinned

    def births(self) -> list[HostEvent]:
        return list(self.born.values())

    def publish_all(self, messages: Sequence[Publish]) -> bool:
        return all(self.publish_plain(topic, payload, qos=qos, retain=retain) for topic, payload, qos, retain in messages)

    def publish_plain(self, topic: str, payload: bytes, *, qos: int = 0, retain: bool = False) -> bool:
        if not self.online:
            return False
        self.plain.append((topic, payload, retain))
        if topic.startswith("cnctwin/marker/") and self._marker:
            snapshots = [HostEvent(EventKind.PLAIN, NOWHERE, None, 0, (), "", *item) for item in self.retained.items()]
            self._events.extend([*snapshots, HostEvent(EventKind.PLAIN, NOWHERE, None, 0, (), "", topic, payload)])
        return True

    def poll(self, timeout_s: float, gather_s: float = 0.0) -> list[HostEvent]:
        events = list(self._events)
        self._events.clear()
        if not events and self._stop_when_empty is not None:
            self._stop_when_empty.set()
        for event in events:
            if event.kind is EventKind.BIRTH:
                self.born[event.node, event.device] = event
            elif event.kind is EventKind.DEATH:
                self.born.pop((event.node, event.device), None)
        return events

    def give(self, *events: HostEvent) -> None:
        self._events.extend(events)

    def until_empty(self) -> Event:
        """A stop that is set when everything has been taken."""
        self._stop_when_empty = Event()
        return self._stop_when_empty


class FakeEdge:
    """An edge node that remembers what it was told."""

    def __init__(self) -> None:
        self.online = True
        self.starts = 0
        self.backlog = 0
        self.devices: dict[str, tuple[MetricSpec, ...]] = {}
        self.removed: list[str] = []
        self.published: list[tuple[str | None, tuple[Change, ...]]] = []
        self.stopped = False

    def start(self) -> None:
        self.devices.clear()
        self.starts += 1

    def stop(self, timeout_s: float = 5.0) -> None:
        self.stopped = True

    def declare_device(self, device: str, metrics: Iterable[MetricSpec]) -> None:
        self.devices[device] = tuple(metrics)

    def remove_device(self, device: str) -> None:
        del self.devices[device]
        self.removed.append(device)

    def publish(self, device: str | None, changes: Sequence[Change]) -> bool:
        self.published.append((device, tuple(changes)))
        return self.online

    def ledger(self) -> dict[str, Any]:
        """The last ledger: one message with all of it."""
        messages = [{c.name: c.value for c in changes} for device, changes in self.published if device is None]
        return [message for message in messages if "ledger/received" in message][-1]


def worked(processor: AnyProcessor, host: FakeHost, edge: FakeEdge | None = None, **table: Any) -> tuple[Worker, FakeEdge]:
    """Run a worker until its host has nothing more."""
    edge = edge or FakeEdge()
    worker = Worker(processor, Configuration(processor.config, table), host, edge)
    Runner(host, [worker]).run(host.until_empty())
    return worker, edge


def snapshots(host: FakeHost) -> dict[str, bytes]:
    """Return what is retained when the worker has ended."""
    return {topic: payload for topic, payload, retain in host.plain if topic.startswith("cnctwin/snapshot/") and retain}


def test_it_subscribes_first_and_folds_only_after_the_snapshots_have_come() -> None:
    before = engine_of(RECORDER)
    fed(before, birth(0.0, spindle_rpm=1.0))
    # The live birth is in the queue before the snapshot is: folding it at once would start from nothing.
    host = FakeHost(birth(0.5, spindle_rpm=2.0), retained={"cnctwin/snapshot/recorder/okuma": before.snapshot("okuma")})
    worker, edge = worked(RECORDER, host)
    log = worker.engine._machines["okuma"].live.state.log
    assert [kind for kind, *_ in log] == ["birth", "hole", "birth", "death"]  # the last one is the goodbye
    assert host.subscriptions == ["cnctwin/snapshot/recorder/+", "cnctwin/marker/recorder"]
    assert (host.stopped, edge.stopped) == (True, True)


def test_a_broker_that_never_gives_the_marker_back_costs_a_second(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("processors.running.runner.RESTORE_S_MAX", 0.01)
    host = FakeHost(birth(0.0, spindle_rpm=1.0), marker=False)
    worker = Worker(RECORDER, Configuration(RECORDER.config), host, FakeEdge())
    stop = Event()
    Timer(0.2, stop.set).start()
    with caplog.at_level(logging.WARNING):
        Runner(host, [worker]).run(stop)
    assert worker.engine.ledger.emitted == 1
    assert "what has come by now is all" in caplog.text


@pytest.mark.parametrize("payload", [b"{", b'{"machine":"okuma","format":0}'])
def test_a_snapshot_that_cannot_be_restored_is_one_clear_line(payload: bytes, caplog: pytest.LogCaptureFixture) -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), retained={"cnctwin/snapshot/recorder/okuma": payload})
    with caplog.at_level(logging.WARNING):
        worker, _ = worked(RECORDER, host)
    (record,) = caplog.records
    assert "snapshot on cnctwin/snapshot/recorder/okuma is not restored, the state starts fresh" in record.getMessage()
    assert worker.engine.counts.snapshots_rejected == 1
    assert worker.engine.ledger.emitted == 1


def test_the_state_is_retained_at_the_end_and_carries_over() -> None:
    first = FakeHost(birth(0.0, spindle_rpm=5000.0, spindle_load_pct=10.0), data(10.0, spindle_rpm=5000.0))
    one, _ = worked(THERMAL, first)
    second = FakeHost(retained=snapshots(first))
    other, _ = worked(THERMAL, second)
    assert other.engine._machines["okuma"].live.state == one.engine._machines["okuma"].live.state


def test_who_told_what_a_snapshot_holds_is_asked_for_births_also_a_machine_that_stands_still() -> None:
    before = FakeHost(birth(0.0, spindle_rpm=5000.0, spindle_load_pct=10.0))
    worked(THERMAL, before)
    assert before.wanted == [], "nothing was known before"
    still = FakeHost(retained=snapshots(before))
    worked(THERMAL, still)
    assert still.wanted == [EDGE]


def test_a_twin_device_is_born_with_units_and_dies_with_its_machine() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0, spindle_load_pct=1.0))
    _, edge = worked(THERMAL, host)
    specs = {spec.name: spec for spec in edge.devices["okuma"]}
    assert specs["twin/spindle_temp_c"].unit == "°C"
    assert specs["twin/spindle_temp_c"].properties["provenance"] == "modelled"
    _, edge = worked(THERMAL, FakeHost(birth(0.0, spindle_rpm=1.0, spindle_load_pct=1.0), death(1.0)))
    assert (edge.devices, edge.removed) == ({}, ["okuma"])


def test_the_ledger_is_one_message_and_balances() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), data(0.1, spindle_rpm=2.0), data(0.05, spindle_rpm=9.0))
    host.dropped = 4
    _, edge = worked(RECORDER, host)
    ledger = edge.ledger()
    assert ledger["ledger/received"] == 7
    assert ledger["ledger/dropped/queue_full"] == 4
    assert ledger["ledger/dropped/superseded"] == 1
    assert ledger["ledger/received"] == ledger["ledger/emitted"] + ledger["ledger/dropped"] + ledger["ledger/buffered"]
    assert ledger["ledger/dropped"] == sum(count for name, count in ledger.items() if name.startswith("ledger/dropped/"))


def test_what_cannot_be_sent_is_dropped_with_that_reason() -> None:
    edge = FakeEdge()
    edge.online = False
    worker, _ = worked(RECORDER, FakeHost(birth(0.0, spindle_rpm=1.0)), edge)
    assert worker.engine.ledger.dropped[DropReason.BROKER_OFFLINE] == 1
    assert worker.engine.ledger.balance == 0


def test_dead_letters_are_published_a_few_at_a_time_and_all_counted(caplog: pytest.LogCaptureFixture) -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), *(data(0.01 * i, spindle_rpm=13.0) for i in range(1, 40)))
    worker, _ = worked(RECORDER, host, fail_at=13.0)
    letters = [json.loads(payload) for topic, payload, retain in host.plain if topic == "cnctwin/deadletter/recorder/okuma"]
    assert 10 <= len(letters) < 39
    assert worker.engine.counts.dead_letters == 39
    assert "dead letter of okuma" in caplog.text


def test_after_a_reconnect_every_snapshot_is_given_again() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0))
    edge = FakeEdge()
    worker = Worker(RECORDER, Configuration(RECORDER.config), host, edge)
    Runner(host, [worker]).run(host.until_empty())
    host.plain.clear()
    worker.finish(0.0, {})
    assert snapshots(host) == {}
    host.reconnects = 1
    worker.finish(0.0, {})
    assert list(snapshots(host)) == ["cnctwin/snapshot/recorder/okuma"]


def test_a_stop_before_the_snapshots_have_come_overwrites_none() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), marker=False)
    worker = Worker(RECORDER, Configuration(RECORDER.config), host, FakeEdge())
    stop = Event()
    stop.set()
    Runner(host, [worker]).run(stop)
    assert snapshots(host) == {}
    assert host.stopped


class Clock:
    """The worker's clock, which a test can let leap; `waits_s` of what it shows have passed since a message was sent."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.leapt_s = 0.0
        monkeypatch.setattr("processors.running.runner.time.monotonic", lambda: time.perf_counter() + self.leapt_s)

    def message(self, waits_s: float) -> HostEvent:
        """A message that has waited so long."""
        return data(time.perf_counter() + self.leapt_s - waits_s, spindle_rpm=1.0)


def health_of(edge: FakeEdge) -> dict[str, Any]:
    messages = [{c.name: c.value for c in changes} for device, changes in edge.published if device is None]
    return [message for message in messages if "health/lag_s" in message][-1]


def test_a_processor_that_is_behind_says_so_until_it_has_caught_up(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, host, edge = Clock(monkeypatch), FakeHost(birth(0.0, spindle_rpm=1.0)), FakeEdge()
    runner = Runner(host, [Worker(RECORDER, Configuration(RECORDER.config), host, edge)])
    for passed_s, waits_s in ((0.0, 0.0), (60.0, 18.0), (2.0, 18.5), (2.0, 0.0), (2.0, 0.0)):
        runner.turn()
        clock.leapt_s += passed_s
        host.give(clock.message(waits_s))
        runner.turn()
        assert health_of(edge)["health/lag_s"] == pytest.approx(waits_s, abs=0.5)
        assert health_of(edge)["health/published_lag_s"] == pytest.approx(waits_s, abs=0.5)
        assert health_of(edge)["health/busy_pct"] >= 0.0
    reports = [(parsed(payload.decode()), retain) for topic, payload, retain in host.plain if topic == "cnctwin/lag/recorder"]
    assert [report.processors for report, _ in reports] == [("recorder",)] * 3
    assert [report.lag_s for report, _ in reports] == pytest.approx([18.0, 18.5, 0.0], abs=0.5)
    assert not any(retain for _, retain in reports)


def test_results_that_cannot_be_sent_yet_are_not_published(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, host, edge = Clock(monkeypatch), FakeHost(birth(0.0, spindle_rpm=1.0)), FakeEdge()
    runner = Runner(host, [Worker(RECORDER, Configuration(RECORDER.config), host, edge)])
    for backlog, late_s in ((0, 0.0), (1, 0.0), (1, 7.0), (1, 14.0), (0, 21.0), (0, 0.0)):
        edge.backlog = backlog
        host.give(clock.message(0.0))
        runner.turn()
        assert health_of(edge)["health/lag_s"] == pytest.approx(0.0, abs=0.5)
        assert health_of(edge)["health/published_lag_s"] == pytest.approx(late_s, abs=0.5)
        if not backlog:
            runner.turn()
        clock.leapt_s += 7.0


def test_alerts_hear_of_the_lag_of_their_own_process_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, host = Clock(monkeypatch), FakeHost(birth(0.0, spindle_rpm=1.0))
    worker = Worker(ALERTS, Configuration(ALERTS.config), host, FakeEdge())
    runner = Runner(host, [worker])
    for passed_s, waits_s in ((0.0, 0.0), (60.0, 18.0)):
        runner.turn()
        clock.leapt_s += passed_s
        host.give(clock.message(waits_s))
        runner.turn()
    (unit,) = worker.engine.known_units.values()
    assert unit.live.state.lags["alerts"].report.lag_s == pytest.approx(18.0, abs=0.5)


def test_a_batch_that_takes_long_is_reported_amid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("processors.running.runner.REPORT_S", 0.0)
    host, edge = FakeHost(birth(0.0, spindle_rpm=1.0), *(data(i / 10, spindle_rpm=float(i)) for i in range(1, 5))), FakeEdge()
    Runner(host, [Worker(RECORDER, Configuration(RECORDER.config), host, edge)]).turn()
    assert sum("health/lag_s" in {c.name for c in changes} for _, changes in edge.published) >= 5


def test_stamps_of_years_ago_are_no_lag() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0), *(data(float(i), spindle_rpm=float(i)) for i in range(1, 30)))
    _, edge = worked(RECORDER, host)
    assert health_of(edge)["health/lag_s"] == 0.0
