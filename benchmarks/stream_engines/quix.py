"""The fold on Quix Streams, its state kept as bytes: at-least-once, exactly-once as it comes, and exactly-once with stable names.

`stable` gives what the defaults leave out: a transactional id and a static member that survive a restart, a session and a
transaction of ten seconds, and the commit interval of the thin runner instead of five seconds.
"""

from quixstreams import Application, State

from benchmarks.stream_engines.fold import folded
from benchmarks.stream_engines.order import Order
from benchmarks.stream_engines.thin import SESSION_MS, TRANSACTION_MS


def application(order: Order) -> Application:
    """Return the application, set up as the order's mode says."""
    consumer = {"group.instance.id": order.member, "session.timeout.ms": SESSION_MS}
    producer = {"transactional.id": f"{order.group}.{order.member}", "transaction.timeout.ms": TRANSACTION_MS}
    settings = {"commit_interval": order.commit_s, "consumer_extra_config": consumer, "producer_extra_config": producer}
    return Application(
        order.kafka,
        consumer_group=order.group,
        auto_offset_reset="earliest",
        state_dir=order.state_dir,
        processing_guarantee="at-least-once" if order.mode == "at-least-once" else "exactly-once",
        loglevel="WARNING",
        **(settings if order.mode == "stable" else {}),
    )


def main() -> None:
    """Run until killed."""
    order = Order.read()
    app = application(order)
    empty = bytes(order.state_bytes)

    def step(value: bytes, state: State) -> bytes:
        buffer = bytearray(state.get_bytes("fold", empty))
        output = folded(buffer, value)
        state.set_bytes("fold", bytes(buffer))
        return output

    inputs = app.topic(order.inputs, key_deserializer="bytes", value_deserializer="bytes")
    outputs = app.topic(order.outputs, key_serializer="bytes", value_serializer="bytes")
    app.dataframe(inputs).apply(step, stateful=True).to_topic(outputs)
    app.run()


if __name__ == "__main__":
    main()
