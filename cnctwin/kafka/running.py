"""A runner from its options: the consumer group's member, and beside alerts the courier that sends."""

from collections.abc import Sequence
from threading import Event

from cnctwin.kafka.bridging import cell_processors
from cnctwin.kafka.runner import Runner
from cnctwin.kafka.settings import KafkaSettings
from cnctwin.kafka.topics import Topics, ensure
from cnctwin.running.processors import courier_of
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
    with courier_of(pairs, broker, group):
        Runner(settings, topics, pairs, member).run(stop)
