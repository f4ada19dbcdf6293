"""The trials of an engine: processor time of a backlog, a kill with restart, and the takeover by a second worker."""

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from confluent_kafka.admin import AdminClient

from benchmarks.stream_engines.fold import KEYS
from benchmarks.stream_engines.ledger import Ledger
from benchmarks.stream_engines.order import Order
from benchmarks.stream_engines.report import Disturbed
from benchmarks.stream_engines.traffic import Feed, Reader, create
from benchmarks.stream_engines.worker import Worker

WARM, FIRST = 20_000, 640
"""Messages before those that count: for the processor time, and to know that a worker is up."""
WAIT_S_MAX, SETTLE_S, DRAIN_S = 240.0, 1.5, 0.5


class TrialError(Exception):
    """An engine did not do what the trial waits for."""


@dataclass(frozen=True, slots=True)
class Engine:
    """An engine as it is run here."""

    name: str
    module: str
    environment: str
    python: Path
    commit_s: float
    mode: str = ""
    jar: str = ""
    recovers: bool = True
    shares: bool = True


@dataclass
class Bench:
    """The broker and the folder of a comparison; every trial has topics, group and state of its own."""

    kafka: str
    folder: Path
    numbers: Iterator[int] = field(default_factory=itertools.count)

    def __post_init__(self) -> None:
        self.admin = AdminClient({"bootstrap.servers": self.kafka})

    @contextmanager
    def trial(self, engine: Engine, state_bytes: int, messages: int, members: str = "a") -> "Iterator[Trial]":
        """Lay topics, workers that are not started yet, feed and reader; end all of them afterwards."""
        name = f"{engine.name}-{next(self.numbers)}"
        inputs, outputs, snapshots = topics = [f"{name}.{end}" for end in ("in", "out", "snapshots")]
        for topic in topics:
            create(self.admin, topic, compacted=topic == snapshots)
        workers = []
        for member in members:
            state = str(self.folder / name / member)
            names = self.kafka, inputs, outputs, snapshots, name, member
            order = Order(*names, state, state_bytes, engine.commit_s, engine.mode, engine.jar)
            workers.append(Worker(engine.python, engine.module, order, self.folder / f"{name}-{member}.log"))
        reader = Reader(self.kafka, outputs, Ledger(messages, state_bytes))
        try:
            yield Trial(self.admin, name, Feed(self.kafka, inputs), reader, workers)
        finally:
            for worker in workers:
                worker.kill()
            reader.close()
            self.admin.delete_topics(topics)

    def cpu_us(self, engine: Engine, state_bytes: int, messages: int) -> float:
        """Return the processor time of a message, in microseconds, of a backlog that becomes visible at once."""
        with self.trial(engine, state_bytes, WARM + messages) as trial:
            trial.begin(WARM)
            trial.feed.lay(WARM + messages)
            time.sleep(SETTLE_S)
            before = trial.workers[0].cpu_s()
            trial.feed.show()
            trial.read_until(lambda: trial.ledger.complete, "the outputs of the whole backlog")
            return (trial.workers[0].cpu_s() - before) / messages * 1e6

    def killed(self, engine: Engine, state_bytes: int, messages: int, per_s: float, part: float) -> Disturbed:
        """Kill the only worker when that part of the messages was sent, delete its state, start it again."""
        with self.trial(engine, state_bytes, messages) as trial:
            trial.begin(FIRST)
            trial.pace(per_s, messages, lambda: trial.feed.sent >= part * messages, "the middle")
            worker = trial.workers[0]
            worker.kill()
            began = time.monotonic()
            trial.pace(per_s, messages, lambda: time.monotonic() > began + DRAIN_S, "the drain")
            worker.start()
            began, before = time.monotonic(), len(trial.ledger.times)
            trial.pace(per_s, messages, lambda: len(trial.ledger.times) > before, "a new output after the restart")
            return trial.end(time.monotonic() - began, per_s, messages)

    def taken_over(self, engine: Engine, state_bytes: int, messages: int, per_s: float) -> Disturbed:
        """Kill one of two workers in the middle; the seconds are until every key has the output of a message sent after that.

        Any new output would not do: one that the dead worker committed may show late, behind an open transaction of the other.
        """
        with self.trial(engine, state_bytes, messages, "ab") as trial:
            trial.begin(FIRST)
            trial.workers[1].start()
            trial.read_until(trial.shared, "both workers to have partitions")
            trial.pace(per_s, messages, lambda: trial.feed.sent >= messages / 2, "the middle")
            for worker in trial.workers:
                if not worker.running:
                    raise TrialError(f"{worker.order.member} ended before the kill: {worker.last_words()}")
            trial.workers[0].kill()
            began, before = time.monotonic(), -(-trial.feed.sent // KEYS)

            def moved() -> bool:
                newest = trial.ledger.newest
                return len(newest) == KEYS and min(newest.values()) > before

            trial.pace(per_s, messages, moved, "a new output of every key after the takeover")
            return trial.end(time.monotonic() - began, per_s, messages)


class Trial:
    """A trial that goes on."""

    def __init__(self, admin: AdminClient, group: str, feed: Feed, reader: Reader, workers: list[Worker]) -> None:
        self.feed, self.reader, self.ledger, self.workers = feed, reader, reader.ledger, workers
        self._admin, self._group, self._pace = admin, group, (0.0, 0)

    def read_until(self, done: Callable[[], bool], awaited: str, also: Callable[[], None] = lambda: None) -> None:
        """Read the outputs until something is true; raise TrialError if it does not come, or if no worker is left."""
        until = time.monotonic() + WAIT_S_MAX
        while not done():
            also()
            self.reader.read()
            running = any(worker.running for worker in self.workers)
            if time.monotonic() > until or not (running or awaited == "the drain"):
                why = f"nothing within {WAIT_S_MAX:g} s" if running else "the worker ended"
                counts = f"{len(self.ledger.times)} of {len(self.ledger.due)} outputs"
                raise TrialError(f"waiting for {awaited}: {why} ({counts}): {self.workers[0].last_words()}")

    def begin(self, messages: int) -> None:
        """Start the first worker, and wait until it has folded the first messages."""
        self.workers[0].start()
        self.feed.lay(messages)
        self.feed.show()
        self.read_until(lambda: len(self.ledger.times) >= messages, "the first outputs")

    def pace(self, per_s: float, messages: int, done: Callable[[], bool], awaited: str) -> None:
        """Read as `read_until` does, and send what is due."""
        began, base = self._pace = self._pace if self._pace[1] else (time.monotonic(), self.feed.sent)
        self.read_until(done, awaited, lambda: self.feed.keep_pace(began, per_s, messages, base))

    def shared(self) -> bool:
        """True once each worker has partitions of its own."""
        told = self._admin.describe_consumer_groups([self._group])[self._group].result(10.0)
        parts = [len(member.assignment.topic_partitions) for member in told.members if member.assignment]
        time.sleep(0.2)
        return len(parts) == len(self.workers) and min(parts) > 0

    def end(self, seconds: float, per_s: float, messages: int) -> Disturbed:
        """Send what is left, read all outputs and those that come late, and return the outcome."""
        self.pace(per_s, messages, lambda: self.feed.sent >= messages, "the last message")
        self.feed.flush()
        until = time.monotonic() + WAIT_S_MAX
        while not self.ledger.complete and time.monotonic() < until:
            self.reader.read()
        late = time.monotonic() + 2 * SETTLE_S
        while time.monotonic() < late:
            self.reader.read()
        return Disturbed(seconds, self.ledger.repeated(), self.ledger.exact())
