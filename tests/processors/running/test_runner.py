"""Several processors on one host session: who is given what, in which order, and what they share."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from processors.actions import Pin
from processors.config import Configuration
from processors.discovery import AnyProcessor, find
from processors.running.ports import Receipt
from processors.running.runner import Runner
from processors.running.worker import Worker
from sparkplug.host_session import EventKind, HostEvent
from sparkplug.metric import NodeId
from tests.processors.recorder import RECORDER
from tests.processors.running.test_worker import NOWHERE, FakeEdge, FakeHost, snapshots
from tests.processors.streams import birth, data, death, engine_of, fed

READS_TWINS = replace(RECORDER, name="reads_twins", inputs=frozenset({"spindle_rpm", "twin/count"}))
THERMAL_NODE = NodeId("cnc", "twin-thermal")


class Kept:
    """A recorder that remembers what it was handed."""

    keeps_plain = ("cnctwin/snapshot/#",)

    def __init__(self) -> None:
        self.events: list[HostEvent] = []

    def keep(self, event: HostEvent, received_ms: int) -> None:
        self.events.append(event)

    def pin(self, pin: Pin) -> None: ...

    def begin_again(self) -> None: ...

    def receipts(self) -> Iterable[Receipt]:
        return ()

    def health(self) -> dict[str, int | float | str]:
        return {}


def workers_on(host: FakeHost, *processors: AnyProcessor, recorder: Kept | None = None) -> list[Worker]:
    return [Worker(one, Configuration(one.config), host, FakeEdge(), recorder if one.records else None) for one in processors]


def log_of(worker: Worker) -> list[tuple[str, float, tuple[str, ...], float | None]]:
    return list(worker.engine._machines["okuma"].live.state.log)


def test_each_message_is_folded_by_all_before_the_next_one_whatever_order_they_were_named_in() -> None:
    folded: list[tuple[str, float]] = []
    for order in ((RECORDER, READS_TWINS), (READS_TWINS, RECORDER)):
        folded.clear()
        host = FakeHost(birth(0.0, spindle_rpm=1.0), data(0.5, spindle_rpm=2.0))
        workers = workers_on(host, *order)
        for worker in workers:

            def noted(event: HostEvent, wall_s: float, worker: Worker = worker) -> Sequence[object]:
                folded.append((worker.name, event.timestamp_ms % 60_000 / 1000))
                return ()

            worker.engine.feed = noted  # type: ignore[method-assign,assignment]
        Runner(host, workers).run(host.until_empty())
        assert folded == [("reads_twins", 0.0), ("recorder", 0.0), ("reads_twins", 0.5), ("recorder", 0.5)]


def test_a_processor_that_reads_no_twin_metrics_is_never_given_one() -> None:
    host = FakeHost(
        birth(0.0, spindle_rpm=1.0),
        birth(0.0, node=THERMAL_NODE, **{"twin/count": 1}),
        data(0.5, node=THERMAL_NODE, **{"twin/count": 2}),
        death(0.9),
    )
    plain, twins = workers_on(host, RECORDER, READS_TWINS)
    Runner(host, [plain, twins]).run(host.until_empty())
    assert [kind for kind, *_ in log_of(plain)] == ["birth", "death"]
    assert (plain.engine.ledger.received, plain.engine.counts.ignored) == (2, 0)
    assert [names for _, _, names, _ in log_of(twins)][1:3] == [("twin/count",), ("twin/count",)]


def test_together_they_come_to_what_each_comes_to_alone() -> None:
    stream = [birth(0.0, spindle_rpm=1.0), *(data(i / 3, spindle_rpm=float(i)) for i in range(1, 40)), death(14.0)]
    together = FakeHost(*stream)
    workers = workers_on(together, find("thermal"), find("mirror"), RECORDER)
    Runner(together, workers).run(together.until_empty())
    for worker in workers:
        host = FakeHost(*stream)
        (alone,) = workers_on(host, worker._processor)
        Runner(host, [alone]).run(host.until_empty())
        (unit,) = worker.engine.known_units
        assert worker.engine.snapshot(unit) == alone.engine.snapshot(unit)
        assert worker.engine.ledger.metrics() == alone.engine.ledger.metrics()


def test_what_the_shared_queue_has_lost_each_of_them_has_lost() -> None:
    host = FakeHost(birth(0.0, spindle_rpm=1.0))
    host.dropped = 4
    workers = workers_on(host, RECORDER, find("thermal"))
    Runner(host, workers).run(host.until_empty())
    for worker in workers:
        metrics = worker.engine.ledger.metrics()
        assert metrics["ledger/dropped/queue_full"] == 4
        assert worker.engine.ledger.balance == 0


def test_each_is_given_its_own_snapshots_and_a_recorder_those_of_all() -> None:
    records = replace(RECORDER, name="records", records=True)
    retained = {}
    for processor in (RECORDER, records):
        engine = engine_of(processor)
        fed(engine, birth(0.0, spindle_rpm=1.0))
        retained[f"cnctwin/snapshot/{processor.name}/okuma"] = engine.snapshot("okuma")
    host, recorder = FakeHost(birth(0.5, spindle_rpm=2.0), retained=retained), Kept()
    workers = workers_on(host, RECORDER, records, recorder=recorder)
    Runner(host, workers).run(host.until_empty())
    for worker in workers:
        assert [kind for kind, *_ in log_of(worker)] == ["birth", "hole", "birth", "death"]
        assert worker.engine.counts.snapshots_rejected == 0
    assert {event.topic for event in recorder.events if event.kind is EventKind.PLAIN} == set(retained)
    assert set(snapshots(host)) == set(retained)


def test_a_plain_message_reaches_those_who_listen_to_its_topic() -> None:
    topic = find("alerts").listens[0].replace("+", "x").replace("#", "x")
    message = HostEvent(EventKind.PLAIN, NOWHERE, None, 0, (), "", topic, b"{}")
    host = FakeHost(message, message._replace(topic="elsewhere"))
    alerts, thermal = workers_on(host, find("alerts"), find("thermal"))
    heard: list[tuple[str, str]] = []
    for worker in (alerts, thermal):

        def noted(topic: str, payload: bytes, at_ms: int, name: str = worker.name) -> list[object]:
            heard.append((name, topic))
            return []

        worker.engine.plain = noted  # type: ignore[method-assign,assignment]
    Runner(host, [alerts, thermal]).run(host.until_empty())
    assert heard == [("alerts", topic)]
    assert set(find("alerts").listens) <= set(host.subscriptions)
