"""The fold on PyFlink: a local cluster of one slot, Kafka source and sink exactly-once, checkpoints on a disk that survives.

A restart goes on from the newest checkpoint that is complete. The folder of checkpoints stands for the object store of a real
cluster, so a kill leaves it, while it takes the local state of the other engines.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from pyflink.common import Configuration, SimpleStringSchema, Types, WatermarkStrategy
from pyflink.datastream import KeyedProcessFunction, RuntimeContext, StreamExecutionEnvironment
from pyflink.datastream.connectors.base import DeliveryGuarantee
from pyflink.datastream.connectors.kafka import KafkaOffsetsInitializer, KafkaRecordSerializationSchema, KafkaSink, KafkaSource
from pyflink.datastream.state import ValueStateDescriptor

from benchmarks.stream_engines.fold import folded
from benchmarks.stream_engines.order import Order


class Fold(KeyedProcessFunction):  # type: ignore[misc]  # comes without types
    """The fold of a key, its state in Flink's hands."""

    def __init__(self, state_bytes: int) -> None:
        self.state_bytes = state_bytes

    def open(self, runtime_context: RuntimeContext) -> None:
        """Ask for the state."""
        self.state = runtime_context.get_state(ValueStateDescriptor("fold", Types.PRIMITIVE_ARRAY(Types.BYTE())))

    def process_element(self, value: str, _ctx: KeyedProcessFunction.Context) -> Iterator[str]:
        """Fold a message."""
        buffer = bytearray(self.state.value() or bytes(self.state_bytes))
        output = folded(buffer, value.encode())
        self.state.update(bytes(buffer))
        yield output.decode()


def configuration(order: Order, checkpoints: Path) -> Configuration:
    """Return the settings of the cluster, with the checkpoint to go on from."""
    config = Configuration()
    interval_ms = max(1, round(1000 * order.commit_s))
    settings = {
        "pipeline.jars": Path(order.jar).resolve().as_uri(),
        "python.executable": sys.executable,
        "python.client.executable": sys.executable,
        "python.fn-execution.bundle.time": str(interval_ms // 2),
        "parallelism.default": "1",
        "rest.port": "0",
        "execution.checkpointing.interval": f"{interval_ms} ms",
        "execution.checkpointing.mode": "EXACTLY_ONCE",
        "execution.checkpointing.dir": checkpoints.as_uri(),
        "execution.checkpointing.externalized-checkpoint-retention": "RETAIN_ON_CANCELLATION",
    }
    whole = [path.parent for path in checkpoints.glob("*/chk-*/_metadata")]
    if whole:
        newest = max(whole, key=lambda path: (path / "_metadata").stat().st_mtime_ns)
        settings["execution.state-recovery.path"] = newest.as_uri()
    for name, value in settings.items():
        config.set_string(name, value)
    return config


def main() -> None:
    """Run until killed."""
    order = Order.read()
    checkpoints = Path(f"{order.state_dir}.checkpoints").resolve()
    checkpoints.mkdir(parents=True, exist_ok=True)
    cluster = StreamExecutionEnvironment.get_execution_environment(configuration(order, checkpoints))
    source = (
        KafkaSource.builder()
        .set_bootstrap_servers(order.kafka)
        .set_topics(order.inputs)
        .set_group_id(order.group)
        .set_starting_offsets(KafkaOffsetsInitializer.earliest())
        .set_value_only_deserializer(SimpleStringSchema())
        .set_property("isolation.level", "read_committed")
        .build()
    )
    records = KafkaRecordSerializationSchema.builder().set_topic(order.outputs)
    sink = (
        KafkaSink.builder()
        .set_bootstrap_servers(order.kafka)
        .set_record_serializer(records.set_value_serialization_schema(SimpleStringSchema()).build())
        .set_delivery_guarantee(DeliveryGuarantee.EXACTLY_ONCE)
        .set_transactional_id_prefix(order.group)
        .set_property("transaction.timeout.ms", "60000")
        .build()
    )
    stream = cluster.from_source(source, WatermarkStrategy.no_watermarks(), "inputs")
    keyed = stream.key_by(lambda value: json.loads(value)["machine"], key_type=Types.STRING())
    keyed.process(Fold(order.state_bytes), output_type=Types.STRING()).sink_to(sink)
    cluster.execute(order.group)


if __name__ == "__main__":
    main()
