"""The watcher: a thread that reads the log as it grows, and says when what was waited for stood there, committed."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from confluent_kafka import OFFSET_END, Consumer, Message, TopicPartition

from cnctwin.kafka.topics import Topics
from twin.vocabulary.nodes import is_twin_node
from twin.vocabulary.topics import ALERT_OUTBOX

Headers = dict[str, Any]
GONE_S = 10.0
SAMPLED = 16
_OUTBOX = ALERT_OUTBOX.encode()


@dataclass(slots=True)
class Awaited:
    """A record of a topic, made at or after a moment, that fits. `came_s`: when it came, by the wall clock."""

    topic: str
    since_s: float
    fits: Callable[[int, Headers], bool]
    came_s: float | None = None
    came: threading.Event = field(default_factory=threading.Event)

    @property
    def took_s(self) -> float | None:
        """The time from the moment until it came; None where it never did."""
        return None if self.came_s is None else self.came_s - self.since_s


class Watcher:
    """See the module. It reads what is committed only."""

    def __init__(self, bootstrap: str, topics: Topics, partitions: int, cell_processors: frozenset[str]) -> None:
        self._cell_processors = cell_processors
        self._cells = {name.encode() for name in cell_processors}  # the keys of their plain messages
        self.topics = topics
        self.results = self.readings = 0
        self.lag_s = 0.0  # of the newest result: from the bridge's taking in to the commit
        self.emitted: set[str] = set()
        """Ids of notifications that were handed to the courier."""
        self._writers: dict[tuple[int, bool], tuple[str, float]] = {}
        self._awaited: list[Awaited] = []
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._consumer = Consumer(
            {
                "bootstrap.servers": bootstrap,
                "group.id": "kill-run-watcher",
                "enable.auto.commit": False,
                "isolation.level": "read_committed",
                "auto.offset.reset": "earliest",
                "fetch.wait.max.ms": 20,
                "reconnect.backoff.ms": 50,
                "reconnect.backoff.max.ms": 250,
                "log_level": 0,
            }
        )
        watched = [
            TopicPartition(name, number, OFFSET_END) for name in (topics.readings, topics.results) for number in range(partitions)
        ]
        self._consumer.assign(watched)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def first_result(self, since_s: float, *, is_fresh: bool = False) -> Awaited:
        """Wait for the first committed result made after a moment; with `is_fresh`, of an input taken in after it."""
        fits = (lambda _, headers: _at_s(headers) >= since_s) if is_fresh else (lambda _, headers: True)
        return self._wait(Awaited(self.topics.results, since_s, fits))

    def first_data(self, since_s: float) -> Awaited:
        """Wait for the first data message of a machine that was taken in after a moment."""

        def fits(_: int, headers: Headers) -> bool:
            if headers.get("kind") != b"data" or _at_s(headers) < since_s:
                return False
            return not is_twin_node(headers["node"].decode().partition("/")[2])

        return self._wait(Awaited(self.topics.readings, since_s, fits))

    def results_of(self, places: list[tuple[int, bool]], since_s: float, but: str) -> dict[tuple[int, bool], Awaited]:
        """Wait for results of some partitions by any other writer. True stands for a topic of cells."""
        return {place: self._wait(Awaited(self.topics.results, since_s, self._of(place, but))) for place in places}

    def _of(self, place: tuple[int, bool], but: str) -> Callable[[int, Headers], bool]:
        return lambda number, headers: self._place(number, headers) == place and not _writer(headers).endswith(f".{but}")

    def places_of(self, member: str) -> list[tuple[int, bool]]:
        """Return the partitions of which a runner has committed the newest results, lately."""
        now_s = time.time()
        with self._lock:
            known = dict(self._writers)
        return [place for place, (writer, at_s) in known.items() if writer.endswith(f".{member}") and now_s - at_s < GONE_S]

    def _wait(self, awaited: Awaited) -> Awaited:
        with self._lock:
            self._awaited.append(awaited)
        return awaited

    def _place(self, number: int, headers: Headers) -> tuple[int, bool]:
        return number, headers.get("processor", b"").decode() in self._cell_processors

    def _run(self) -> None:
        while not self._stop.is_set():
            for message in self._consumer.consume(2000, 0.1):
                if message.error() is None:
                    self._take(message)
        self._consumer.close()

    def _take(self, message: Message) -> None:
        topic, number = message.topic() or "", message.partition() or 0
        is_result = topic == self.topics.results
        self.results += is_result
        self.readings += not is_result
        # To read all headers of all that is written takes half a core from what is measured.
        is_plain = is_result and message.key() in self._cells
        if not (is_plain or self._awaited or (is_result and (message.offset() or 0) % SAMPLED == 0)):
            return
        raw: Any = message.headers()
        headers: Headers = dict(raw or ())
        if "at" not in headers:
            return
        if is_result:
            if headers.get("topic", b"").startswith(_OUTBOX) and message.value():
                self.emitted.add(headers["topic"].removeprefix(_OUTBOX).decode())
            self.lag_s = time.time() - _at_s(headers)
            with self._lock:
                self._writers[self._place(number, headers)] = _writer(headers), time.time()
        made_s = message.timestamp()[1] / 1000
        with self._lock:
            for one in list(self._awaited):
                if one.topic == topic and made_s >= one.since_s and one.fits(number, headers):
                    one.came_s = time.time()
                    one.came.set()
                    self._awaited.remove(one)

    def stop(self) -> None:
        """End it."""
        self._stop.set()
        self._thread.join(10.0)


def _at_s(headers: Headers) -> float:
    return int(headers["at"].split()[0]) / 1000


def _writer(headers: Headers) -> str:
    return bytes(headers.get("writer", b"")).decode()
