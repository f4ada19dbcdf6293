"""A runner from its options: the consumer group's member, and beside alerts the courier that sends."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event

from cnctwin.kafka.bridging import cell_processors
from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.sink import Sink
from cnctwin.kafka.topics import Topics, ensure
from cnctwin.running.processors import courier_of
from processors.historian import HistorianConfig
from processors.running.runtime import Configured
from sparkplug.broker import BrokerAddress


def run_over_kafka(
    settings: KafkaSettings,
    pairs: Sequence[Configured],
    stop: Event,
    *,
    group: str,
    member: str,
    broker: BrokerAddress | None,
) -> None:
    """Run processors until `stop` is set. Raises ConfigurationError, and FencedError where another process has the name.

    broker: for the courier of alerts, which reads what is to be sent there; None where nobody is to be told
    """
    topics = Topics(group)
    ensure(settings, topics, cell_processors(pairs))
    with courier_of(pairs, broker, group), _sink(pairs) as sink:
        Runner(settings, topics, pairs, member, sink).run(stop)


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
