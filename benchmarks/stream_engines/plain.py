"""The unit of cost: poll, fold, produce. No transaction, no saved state, offsets committed now and then by the client."""

from collections import defaultdict

from confluent_kafka import Consumer, Producer

from benchmarks.stream_engines.fold import folded
from benchmarks.stream_engines.order import Order


def main() -> None:
    """Run until killed."""
    order = Order.read()
    consumer = Consumer(
        {
            "bootstrap.servers": order.kafka,
            "group.id": order.group,
            "auto.offset.reset": "earliest",
            "isolation.level": "read_committed",
        }
    )
    producer = Producer({"bootstrap.servers": order.kafka, "enable.idempotence": True})
    consumer.subscribe([order.inputs])
    states = defaultdict[bytes, bytearray](lambda: bytearray(order.state_bytes))
    while True:
        taken = consumer.poll(order.commit_s)
        producer.poll(0)
        if taken is None:
            continue
        if taken.error():
            raise SystemExit(str(taken.error()))
        key, value = taken.key(), taken.value()
        assert key is not None and value is not None
        while True:
            try:
                producer.produce(order.outputs, folded(states[key], value), key, taken.partition())
                break
            except BufferError:
                producer.poll(0.1)


if __name__ == "__main__":
    main()
