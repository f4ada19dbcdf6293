"""A log folded once from its beginning, in a process of its own: by a runner, or by a plain loop without any guarantee.

    python -m benchmarks.kafka.fold '{"kind": "runner", …}'      # a Task as JSON; prints a Spent as JSON

The plain loop consumes, reads the records, feeds the same engines, and produces the same results: without transactions, states,
marks, health, and without looking whether a message was there before. It has the runner's rare collections of garbage too.
"""

import cProfile
import gc
import json
import resource
import sys
import time
from collections import Counter
from dataclasses import asdict, dataclass
from threading import Event
from typing import ClassVar

from confluent_kafka import Consumer, Producer

from benchmarks.hall.machine import GROUP
from cnctwin.kafka import runner as runner_module
from cnctwin.kafka.assigned import by_topic
from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, ensure
from cnctwin.kafka.transaction import Transactions
from cnctwin.processes.stopping import stopped_by_signals
from processors.partition.results import Results
from processors.running.cycles import SELDOM
from processors.running.engine import Engine
from processors.running.runtime import Configured, configured
from sparkplug.host_event import EventKind
from sparkplug.records.record import Headers, Origin, RecordReader, RecordWriter

LIMIT_S = 300.0


@dataclass(frozen=True, slots=True)
class Task:
    """The task of one process. `run` makes the names of its topics and groups; `records`: after so many it is done."""

    kind: str
    bootstrap: str
    partitions: int
    processors: list[str]
    run: str
    records: int
    snapshot_s: float = 5.0
    member: str = "r0"
    profile: str = ""


@dataclass(frozen=True, slots=True)
class Spent:
    """The cost of a run, all threads; start-up is left out. `committed`: transactions."""

    cpu_s: float
    wall_s: float
    records: int
    results: int
    snapshots: int
    snapshot_bytes: int
    committed: int
    rss_mb: float


class Again(Topics):
    """Topics of a run of its own, but for those that are read."""

    @property
    def readings(self) -> str:
        """The common log."""
        return Topics(GROUP).readings

    def cells(self, processor: str) -> str:
        """Return the common log of a processor that compares machines."""
        return Topics(GROUP).cells(processor)


def cpu_s() -> float:
    """Return the CPU time of this process, all threads."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


class _Counted(Transactions):
    """Transactions whose messages are counted by topic."""

    counts: ClassVar[Counter[str]] = Counter()
    sizes: ClassVar[Counter[str]] = Counter()

    def produce(self, topic: str, key: str, value: bytes | None, partition: int, headers: Headers) -> None:
        kind = "marks" if key.startswith("~") else topic.rpartition(".")[2]
        self.counts[kind] += 1
        self.sizes[kind] += len(value or b"")
        super().produce(topic, key, value, partition, headers)


def settings_of(task: Task) -> KafkaSettings:
    """Return the settings of a run."""
    return KafkaSettings(
        bootstrap=task.bootstrap, partitions=task.partitions, replication_factor=1, snapshot_s=task.snapshot_s, session_s=10.0
    )


def by_runner(task: Task, pairs: list[Configured]) -> Spent:
    """Fold with a runner."""
    topics, settings = Again(task.run), settings_of(task)
    ensure(settings, topics, [])
    stop = Event()
    began = [cpu_s(), time.monotonic()]

    class Measured(Runner):
        def turn(self) -> None:
            super().turn()
            if not self._health.records:
                began[:] = cpu_s(), time.monotonic()
            if self._health.records >= task.records or time.monotonic() - began[1] > LIMIT_S:
                stop.set()
                ended[:] = cpu_s(), time.monotonic()

    ended = [0.0, 0.0]
    runner_module.__dict__["Transactions"] = _Counted
    runner = Measured(settings, topics, pairs, task.member)
    runner.run(stop)
    return Spent(
        ended[0] - began[0],
        ended[1] - began[1],
        runner._health.records,
        _Counted.counts["results"],
        _Counted.counts["snapshots"],
        _Counted.sizes["snapshots"],
        runner._transactions.committed,
        rss_mb(),
    )


def as_member(task: Task, pairs: list[Configured]) -> None:
    """Fold as one of several runners until told to stop."""
    settings, topics = settings_of(task), Again(task.run)
    ensure(settings, topics, [])
    with stopped_by_signals() as stop:
        Runner(settings, topics, pairs, task.member).run(stop)


def by_plain_loop(task: Task, pairs: list[Configured]) -> Spent:
    """Fold with a loop of confluent-kafka."""
    topics, settings = Again(task.run), settings_of(task)
    ensure(settings, topics, [])
    engines = {
        topic: [(processor, Engine(processor, one), Results(task.run, processor)) for processor, one in own]
        for topic, own in by_topic(topics, pairs).items()
    }
    reader, writer = RecordReader(), RecordWriter("plain")
    producer = Producer(settings.client() | {"compression.type": "lz4", "linger.ms": 5})
    consumer = Consumer(
        settings.client()
        | {"group.id": task.run, "auto.offset.reset": "earliest", "enable.auto.commit": True, "fetch.wait.max.ms": 50}
    )
    consumer.subscribe(list(engines))
    gc.set_threshold(*SELDOM)
    records = results = 0
    began = cpu_s(), time.monotonic()
    while records < task.records and time.monotonic() - began[1] < LIMIT_S:
        messages = consumer.consume(1000, 0.05)
        if not records:
            began = cpu_s(), time.monotonic()
        for message in messages:
            topic = message.topic() or ""
            record = reader.read(message.headers(), message.value())  # type: ignore[arg-type]
            records += 1
            event, wall_s = record.event, record.received_ms / 1000
            for processor, engine, of_processor in engines[topic]:
                if event is None:
                    actions = engine.silence(wall_s) + engine.beat(record.received_ms) if message.partition() == 0 else []
                elif event.kind is EventKind.PLAIN:
                    continue
                else:
                    actions = engine.feed(event, wall_s)
                for action in actions:
                    told = of_processor.event(action, record.received_ms)
                    if told is not None:
                        headers, value = writer.written(told, record.received_ms, Origin())
                        headers.append(("processor", processor.name.encode()))
                        key = (told.device or processor.name).encode()
                        while True:
                            try:
                                producer.produce(topics.results, value, key, message.partition() or 0, headers=headers)
                                break
                            except BufferError:
                                producer.poll(0.1)
                        results += 1
        producer.poll(0)
    producer.flush(30.0)
    ended = cpu_s(), time.monotonic()
    consumer.close()
    return Spent(ended[0] - began[0], ended[1] - began[1], records, results, 0, 0, 0, rss_mb())


def rss_mb() -> float:
    """Return the most memory that this process had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Do a task and print what it took."""
    task = Task(**json.loads(sys.argv[1]))
    pairs = configured(task.processors, None)
    if task.kind == "member":
        as_member(task, pairs)
        return
    fold = by_runner if task.kind == "runner" else by_plain_loop
    if task.profile:
        profile = cProfile.Profile()
        spent = profile.runcall(fold, task, pairs)
        profile.dump_stats(task.profile)
    else:
        spent = fold(task, pairs)
    print(json.dumps(asdict(spent)))


if __name__ == "__main__":
    main()
