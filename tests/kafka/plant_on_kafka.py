"""A plant on Kafka: machines whose records a test writes itself, runners, and what a pure replay of the log says of them.

A test waits for what it wants to see, and never for time to pass.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any

from confluent_kafka import OFFSET_BEGINNING, Consumer, KafkaError, KafkaException, Message, TopicPartition

from cnctwin.kafka.assigned import by_topic
from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.kept import read_kept
from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, cell_processors, ensure
from cnctwin.kafka.transaction import FencedError
from processors.actions import PlainOutput
from processors.discovery import discover
from processors.partition.partition import Partition
from processors.partition.results import Results
from processors.running.runtime import Configured
from sparkplug.host_event import HostEvent
from sparkplug.records.record import Origin, RecordError, RecordReader, RecordWriter
from tests.kafka.kafka_server import KafkaServer
from tests.processors.streams import T0_MS, birth, data

WAIT_S_MAX = 60.0
WRITER = "bridge-0"
PASSING = (KafkaError.NOT_COORDINATOR, KafkaError.COORDINATOR_NOT_AVAILABLE, KafkaError.COORDINATOR_LOAD_IN_PROGRESS)
Told = tuple[bytes, frozenset[tuple[str, bytes]], bytes]
"""A result: key, headers without the writer's name, and value."""


def until(condition: Callable[[], bool], what: str, *, wait_s: float = WAIT_S_MAX) -> None:
    """Wait for it."""
    end_s = time.monotonic() + wait_s
    while not condition():
        assert time.monotonic() < end_s, f"not in {wait_s:g} s: {what}"
        time.sleep(0.02)


def processors(*names: str) -> list[Configured]:
    """Processors of the project by name, without configuration."""
    return [(discover()[name], discover()[name].configured({})) for name in names]


class Plant:
    """One MQTT group on Kafka with machines of its own. Its records follow from the order of the calls alone."""

    def __init__(
        self, kafka: KafkaServer, group: str, pairs: Sequence[Configured], *, machines: int = 8, **settings: Any
    ) -> None:
        own = {"partitions": 4, "replication_factor": 1, "session_s": 2.0, "snapshot_s": 0.5} | settings
        self.settings = KafkaSettings(bootstrap=kafka.bootstrap, **own)
        self.kafka, self.pairs, self.topics = kafka, pairs, Topics(group)
        self.machines = [f"m-{number}" for number in range(machines)]
        ensure(self.settings, self.topics, cell_processors(pairs))
        self.log = Outward(self.settings, WRITER)
        self._next_s = 0
        self._seq = 0

    @property
    def reader(self) -> str:
        """The consumer group of the runners."""
        return self.topics.runners([processor.name for processor, _ in self.pairs])

    def __enter__(self) -> Plant:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.log.close()

    # What machines say.

    def say(self, event: HostEvent, at_s: float) -> None:
        """Write the event of a machine to its partition."""
        self._seq = (self._seq + 1) % 256
        origin = Origin(0, T0_MS, self._seq)
        assert self.log.put(self.topics.readings, event.device or "", event, T0_MS + round(at_s * 1000), origin)

    def mark(self, at_s: float) -> None:
        """Write a watermark to all partitions."""
        for number in range(self.settings.partitions):
            self.log.watermark(self.topics.readings, number, T0_MS + round(at_s * 1000))

    def play(self, seconds: int, *, machines: Sequence[str] | None = None) -> None:
        """Have the machines cut for some more seconds of theirs, ten messages in each."""
        for second in range(self._next_s, self._next_s + seconds):
            for place, machine in enumerate(self.machines if machines is None else machines):
                if second == 0:
                    self.say(birth(0.0, device=machine, **START), 0.0)
                for tenth in range(10):
                    at_s = second + tenth / 10 + 0.05
                    self.say(data(at_s, device=machine, **_cut(place, second, tenth)), at_s)
                self.log.poll()
            self.mark(second + 1.0)
        self._next_s += seconds
        self.delivered()

    def delivered(self) -> None:
        """Wait until the cluster has acknowledged all that was written."""
        until(lambda: (self.log.poll(), self.log.waiting == 0)[1], "all records are acknowledged")

    # What came of it.

    def read(self, topic: str, *, committed: bool = True) -> dict[int, list[Message]]:
        """All messages of a topic by partition, up to where a reader of this kind gets."""
        isolation = "read_committed" if committed else "read_uncommitted"
        options = {"group.id": "look", "enable.auto.commit": False, "enable.partition.eof": True, "fetch.wait.max.ms": 10}
        consumer = Consumer(self.kafka.client() | options | {"isolation.level": isolation})
        found: dict[int, list[Message]] = {number: [] for number in range(self.settings.partitions)}
        left = set(found)
        end_s = time.monotonic() + WAIT_S_MAX
        try:
            consumer.assign([TopicPartition(topic, number, OFFSET_BEGINNING) for number in found])
            while left:
                assert time.monotonic() < end_s, f"no end of {topic} in {WAIT_S_MAX:g} s"
                for message in consumer.consume(1000, 0.02):
                    if (error := message.error()) is None:
                        found[message.partition() or 0].append(message)
                    elif error.code() == KafkaError._PARTITION_EOF:
                        left.discard(message.partition() or 0)
        finally:
            consumer.close()
        return found

    def results(self) -> dict[int, list[Told]]:
        """All results that were committed."""
        return {number: [_told(message) for message in messages] for number, messages in self.read(self.topics.results).items()}

    def replayed(self) -> dict[int, Partition]:
        """The partitions of `readings` as a pure fold of the log has them, and in `told` what it says."""
        self.told: dict[int, list[Told]] = {}
        partitions = {}
        reader, writer = RecordReader(), RecordWriter("replay")
        makers = {processor.name: Results(self.topics.group, processor) for processor, _ in self.pairs}
        for number, messages in self.read(self.topics.readings).items():
            partition = partitions[number] = Partition(self.reader, by_topic(self.topics, self.pairs)[self.topics.readings])
            partition.restore({})
            told = self.told[number] = []
            for message in messages:
                try:
                    record = reader.read(message.headers(), message.value())  # type: ignore[arg-type]
                except RecordError:
                    continue
                for result in partition.take(message.offset() or 0, record):
                    for action in result.actions:
                        event = makers[result.seat.name].event(action, result.at_ms)
                        if event is None:
                            continue
                        retain = isinstance(action, PlainOutput) and action.retain
                        headers, value = writer.written(event, record.received_ms, Origin(), retain=retain)
                        headers.append(("processor", result.seat.name.encode()))
                        key = (event.device or result.seat.name).encode()
                        told.append((key, _without_writer(headers), value))
        return partitions

    def holds_as_replayed(self, *, states: bool = True) -> None:
        """Assert that results, and the states that a stopped runner has left, are those of a pure replay of the log, bit for bit.

        A result that was told twice, or not at all, or in another order, is a difference.
        """
        partitions, results = self.replayed(), self.results()
        for number, expected in self.told.items():
            for place, (result, wanted) in enumerate(zip(results[number], expected, strict=False)):
                assert result == wanted, f"result {place} of partition {number}: {result} in place of {wanted}"
            assert len(results[number]) == len(expected), f"results of partition {number}"
        assert sum(map(len, self.told.values())) > 0
        if not states:
            return
        kept = read_kept(self.kafka.client(), self.topics.snapshots, list(partitions), timeout_s=WAIT_S_MAX)
        for number, partition in partitions.items():
            own = {key: _settled(value) for key, value in kept[number].items() if not key.startswith("~")}
            replayed = {
                f"{seat.name}/{unit}": seat.state_of(unit) for seat in partition.seats for unit in seat.engine.known_units
            }
            assert own == {key: _settled(value) for key, value in replayed.items()}, f"states of partition {number}"

    def lags(self) -> dict[int, int]:
        """The number of records of each partition that no runner has committed, where there are any."""
        places = [TopicPartition(self.topics.readings, number) for number in range(self.settings.partitions)]
        consumer = Consumer(self.kafka.client() | {"group.id": self.reader})
        try:
            committed = {one.partition: max(one.offset, 0) for one in consumer.committed(places, WAIT_S_MAX)}
            ends = {one.partition: consumer.get_watermark_offsets(one, WAIT_S_MAX) for one in places}
        finally:
            consumer.close()
        lags = {number: end[1] - committed[number] for number, end in ends.items() if end is not None}
        return {number: lag for number, lag in lags.items() if lag}

    def folded(self) -> None:
        """Wait until runners have committed all that is in the log."""
        until(self._is_folded, "all records are folded")

    def _is_folded(self) -> bool:
        try:
            return not self.lags()
        except KafkaException as error:  # of a cluster that has just begun
            assert error.args[0].retriable() or error.args[0].code() in PASSING, error
            return False

    def committed(self) -> int:
        """The number of results that were committed."""
        return sum(map(len, self.results().values()))


START = {"spindle_rpm": 0.0, "spindle_load_pct": 0.0, "ambient_temp_c": 21.5, "spindle_temp_c": 24.0, "tool_number": 1}


def _cut(place: int, second: int, tenth: int) -> dict[str, float]:
    """Values that differ from one message to the next, and between machines."""
    return {"spindle_rpm": 3000.0 + 10 * place + second + tenth / 8, "spindle_load_pct": 20.0 + (second + tenth) % 7}


def _without_writer(headers: Sequence[tuple[str, Any]]) -> frozenset[tuple[str, bytes]]:
    return frozenset((name, value) for name, value in headers if name != "writer")


def _told(message: Message) -> Told:
    headers: Any = message.headers()
    return message.key() or b"", _without_writer(headers), message.value() or b""  # type: ignore[return-value]


def _settled(state: bytes) -> bytes:
    return state.replace(b'"births_are_old":true', b'"births_are_old":false')


class RunnerHere:
    """A runner in a thread of the test: for processors that discovery does not find, and where nobody is killed."""

    def __init__(self, plant: Plant, member: str, *, comes_again: bool = False) -> None:
        """`comes_again`: as run_over_kafka does, where the cluster takes it for two after an outage."""
        self._new = lambda: Runner(plant.settings, plant.topics, plant.pairs, member)
        self.runner = self._new()
        self._comes_again = comes_again
        self._stop = Event()
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, name=member)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self.runner.run(self._stop)
            except FencedError as error:
                if not self._comes_again:
                    self._error = error
                    return
                self.runner = self._new()
            except Exception as error:
                self._error = error
                return

    @property
    def partitions(self) -> int:
        """The number of partitions that it has."""
        return len(self.runner._assigned.partitions)

    def check(self) -> None:
        """Raise what has ended it."""
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """Have it save and leave."""
        self._stop.set()
        self._thread.join(WAIT_S_MAX)
        assert not self._thread.is_alive(), "the runner does not end"
        self.check()

    def __enter__(self) -> RunnerHere:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stop.set()
        self._thread.join(WAIT_S_MAX)
        if kind is None:
            self.stop()


class Program:
    """A process of ours that a test may kill; it ends with the test."""

    def __init__(self, folder: Path, name: str, *command: str, environment: dict[str, str] | None = None) -> None:
        self.log = folder / f"{name}.log"
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", *command],
                env={**os.environ, "CNCTWIN_KAFKA_REPLICATION_FACTOR": "1", **(environment or {})},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    @property
    def running(self) -> bool:
        """True while it lives."""
        return self._process.poll() is None

    @property
    def said(self) -> str:
        """All that it wrote."""
        return self.log.read_text(errors="replace")

    def wait(self, timeout_s: float = WAIT_S_MAX) -> int:
        """Wait for its end; its exit status, negative where a signal ended it."""
        return self._process.wait(timeout_s)

    def kill(self) -> None:
        """End it by -9."""
        self._process.kill()
        self._process.wait()

    def send(self, number: signal.Signals) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def stop(self) -> int:
        """Ask it to end by SIGTERM; its exit status."""
        self.send(signal.SIGTERM)
        return self.wait()

    def __enter__(self) -> Program:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self.running:
            self.kill()


def runner_program(folder: Path, plant: Plant, member: str) -> Program:
    """`cnctwin process … --kafka` for the plant."""
    names = [processor.name for processor, _ in plant.pairs]
    own = ["--group", plant.topics.group, "--kafka", plant.kafka.bootstrap, "--member", member]
    return Program(folder, member, "cnctwin", "process", *names, *own, environment=environment_of(plant.settings))


def environment_of(settings: KafkaSettings) -> dict[str, str]:
    """The settings of a plant as a process is given them."""
    keys = ("partitions", "session_s", "snapshot_s", "transaction_s", "buffer_mb")
    return {f"CNCTWIN_KAFKA_{key.upper()}": str(getattr(settings, key)) for key in keys}
