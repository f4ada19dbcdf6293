"""A runner from its options: the consumer group's member, and beside alerts the courier that sends, where they are."""

import logging
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from threading import Event

from cnctwin.kafka.assigned import Place
from cnctwin.kafka.courier import MovingCourier
from cnctwin.kafka.groups import refuse_overlap
from cnctwin.kafka.homes import home_of
from cnctwin.kafka.request import Request
from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.sink import Sink
from cnctwin.kafka.topics import Topics, cell_processors, ensure
from cnctwin.kafka.transaction import FencedError, Transactions
from cnctwin.running.processors import ALERTS, new_courier
from processors.config import ALL
from processors.historian import HistorianConfig
from processors.running.runtime import Configured
from sparkplug.broker import BrokerAddress

SETTLED_S = 60.0  # a runner that was in for so long has its name by right
_log = logging.getLogger(__name__)


def run_over_kafka(
    settings: KafkaSettings,
    pairs: Sequence[Configured],
    stop: Event,
    *,
    group: str,
    member: str,
    claimed: Transactions,
    broker: BrokerAddress | None,
) -> None:
    """Run processors until `stop` is set. Raises ConfigurationError, and FencedError where another process has the name.

    claimed: claims the name of the runner already (claim.py)
    broker: for the courier of alerts, which reads what is to be sent there; None where nobody is to be told
    """
    topics, transactions = Topics(group), claimed
    is_alone = Request(lambda: refuse_overlap(settings, topics, [processor.name for processor, _ in pairs], stop))
    ensure(settings, topics, cell_processors(pairs), without=(topics.births,))
    is_alone.answer()
    print(started([processor.name for processor, _ in pairs], settings.bootstrap, group, member), file=sys.stderr, flush=True)
    with _courier(settings, topics, pairs, broker, member) as hold, _sink(pairs) as sink:
        while not stop.is_set():
            began_s = time.monotonic()
            try:
                Runner(settings, topics, pairs, member, sink, hold=hold, transactions=transactions).run(stop)
            except FencedError as error:
                # A cluster that hung has two requests to join of one runner, and fences the one that waits for the first. So it
                # comes in once more; where another process has the name, the one that came last ends.
                if time.monotonic() - began_s < SETTLED_S:
                    raise
                _log.warning("%s; unless the cluster was away: this one comes in once more", error)
                transactions = Transactions(settings, claimed.name, stop.is_set)


def started(names: Sequence[str], bootstrap: str, group: str, member: str) -> str:
    """Return the line that says what runs, what it reads and under which name.

    >>> started(["gap"], "127.0.0.1:9092", "cnc", "left")
    'started gap: member left reads the machines of group cnc (cnctwin.cnc.*) on Kafka at 127.0.0.1:9092; Ctrl-C ends it'
    """
    where = f"the machines of group {group} (cnctwin.{group}.*) on Kafka at {bootstrap}"
    return f"started {', '.join(names)}: member {member} reads {where}; Ctrl-C ends it"


@contextmanager
def _courier(
    settings: KafkaSettings, topics: Topics, pairs: Sequence[Configured], broker: BrokerAddress | None, member: str
) -> Iterator[Callable[[Collection[Place]], None]]:
    """Yield what is to be told of the runner's partitions, and has the courier where the alerts are."""
    new = new_courier(pairs, broker, topics.group, member)
    if new is None:
        yield lambda _: None
        return
    with MovingCourier(new, (topics.cells(ALERTS), home_of(ALL, settings.partitions))) as courier:
        yield courier.hold


@contextmanager
def _sink(pairs: Sequence[Configured]) -> Iterator[Sink | None]:
    """The historian's store, where it is among the processors; else nothing, and no store is loaded."""
    config = next((one.default for processor, one in pairs if processor.records), None)
    if config is None:
        yield None
        return
    from cnctwin.kafka.store_sink import sink_of  # noqa: PLC0415  only what runs is loaded

    assert isinstance(config, HistorianConfig)
    sink = sink_of(config)
    try:
        yield sink
    finally:
        sink.close()
