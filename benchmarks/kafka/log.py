"""The log to be folded: what a bridge writes of simulated machines (benchmarks/hall/machine.py), written at once.

The machines' packets go through a host session and the bridge's own `Keying` and `Outward`; time is the log's, so that a hundred
seconds of a hall are there in some seconds. Twins say nothing in it: their results would have to be folded first.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from random import Random

from benchmarks.hall.machine import GROUP, POOL, Bodies, Machine, flags
from benchmarks.hall.packets import Stream
from cnctwin.kafka.bridge.keying import Keying
from cnctwin.kafka.bridge.origins import Origins
from cnctwin.kafka.bridge.outward import Outward
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics
from processors.running.runtime import Configured
from sparkplug.host_session import HostSession
from sparkplug.layouts.varint import written

START_MS = 1_790_000_000_000
STEP_MS = 100
ROUND, CHANGE = 1200, 50
"""Messages from one tool change of a machine to its next, and those that a change takes."""


@dataclass(frozen=True, slots=True)
class Filled:
    """The size of a log: messages of machines, and records by topic."""

    messages: int
    of_topic: Mapping[str, int]

    def records(self, topics: Iterable[str]) -> int:
        """Return how many records a reader of these topics has to come by."""
        return sum(self.of_topic[topic] for topic in topics)


class _Writer:
    """The way of the bridge, without a broker."""

    def __init__(self, settings: KafkaSettings, pairs: list[Configured]) -> None:
        self.topics = Topics(GROUP)
        self.keying, self.outward = Keying(self.topics, pairs), Outward(settings, "bench")
        self.session = HostSession("bench", chance=Random(0))
        self.session.connected(START_MS)
        self.origins = Origins(self.session.picture)
        self.counts = dict.fromkeys(self.keying.topics, 0)
        self.partitions = settings.partitions

    def take(self, packets: bytes, at_ms: int) -> None:
        """Hand on what a machine has sent."""
        for topic, payload in Stream().published(packets):
            for event in self.session.message(topic, payload, at_ms):
                origin = self.origins.of(event)
                if event.device is None:
                    continue
                for name, key, part in self.keying.addressed(event):
                    while not self.outward.put(name, key, part, at_ms, origin):
                        self.outward.poll()
                    self.counts[name] += 1
        self.outward.poll()

    def mark(self, at_ms: int) -> None:
        """Say how far the log has come."""
        for name in self.counts:
            for number in range(self.partitions):
                self.outward.watermark(name, number, at_ms)
                self.counts[name] += 1


def fill(settings: KafkaSettings, pairs: list[Configured], machines: int, messages: int) -> Filled:
    """Write so many messages of so many machines, and return what stands in the log."""
    writer, bodies = _Writer(settings, pairs), Bodies.made()
    fleet = [Machine(number, START_MS) for number in range(machines)]
    for one in fleet:
        one.hello(START_MS)
        writer.take(one.births(START_MS), START_MS)
    each = messages // machines
    for step in range(1, each + 1):
        at_ms = START_MS + step * STEP_MS
        stamp = written(at_ms)
        for number, one in enumerate(fleet):
            phase = (number * 7919 + step) % ROUND
            extra = b""
            if phase in (0, CHANGE):
                extra = flags(tool_change_active=phase == 0)
            made = (bodies.change if phase < CHANGE else bodies.cut)[(number * 37 + step) % POOL]
            writer.take(one.data(made + extra, stamp), at_ms + number % STEP_MS)
        if step * STEP_MS % 1000 == 0:
            writer.mark(at_ms + STEP_MS)
    if writer.outward.close() or writer.outward.failed:
        raise SystemExit(f"{writer.outward.waiting} records were not acknowledged, {writer.outward.failed} were refused")
    return Filled(each * machines, writer.counts)
