"""Machines on a real Mosquitto, the bridge's process between it and Kafka, and a host that looks at what comes back."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from cnctwin.kafka.settings import KafkaSettings
from sparkplug.broker import BrokerAddress
from sparkplug.datatype import DataType
from sparkplug.edge_node import EdgeNode
from sparkplug.errors import SparkplugError
from sparkplug.host import HostApplication
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import Change, MetricSpec, NodeId, Reading
from sparkplug.records.record import Record, RecordError, RecordReader
from tests.kafka.plant_on_kafka import Plant, Program, environment_of, until
from tests.wire.mosquitto import Mosquitto

SIGNALS = (
    MetricSpec("spindle_rpm", DataType.DOUBLE, unit="rev/min", value=0.0),
    MetricSpec("spindle_load_pct", DataType.DOUBLE, unit="%", value=0.0),
    MetricSpec("ambient_temp_c", DataType.DOUBLE, unit="°C", value=21.5),
    MetricSpec("spindle_temp_c", DataType.DOUBLE, unit="°C", value=24.0),
    MetricSpec("program", DataType.STRING, value="A"),
)


class Hall:
    """Edge nodes with one machine each, which has the node's name; and a host that looks."""

    def __init__(self, mosquitto: Mosquitto, group: str, *machines: str, signals: Sequence[MetricSpec] = SIGNALS) -> None:
        self._signals = signals
        self.address, self.group, self.machines = BrokerAddress(*mosquitto.address), group, machines
        self.edges = {machine: EdgeNode(self.address, NodeId(group, f"edge-{machine}")) for machine in machines}
        self.look = HostApplication(self.address, "look", [f"spBv1.0/{group}/#"], publish_state=False)
        self.plain: dict[str, bytes] = {}
        self.events: list[HostEvent] = []

    def __enter__(self) -> Hall:
        self.look.subscribe_plain("cnc/#")
        self.look.start()
        return self

    def begin(self, plant: Plant, *bridges: str) -> None:
        """Have the machines come once bridges of these names read the broker: none asks those that it never heard."""
        self.until(lambda: set(bridges) <= writers_of(plant), "the bridges mark the log")
        for machine, edge in self.edges.items():
            edge.declare_device(machine, self._signals)
            edge.start()
        self.until(lambda: all(edge.online for edge in self.edges.values()), "the edges are born")
        self.until(lambda: all(records_of(plant, machine) for machine in self.machines), "the births are in the log")

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for edge in self.edges.values():
            edge.stop()
        self.look.stop()

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for it, and look."""

        def seen() -> bool:
            for event in self.look.poll(0.02):
                self.events.append(event)
                if event.kind is EventKind.PLAIN:
                    self.plain[event.topic] = event.payload
            return condition()

        until(seen, what)

    def say(self, machine: str, **values: Any) -> None:
        """Have a machine say something, as of now."""
        at_ms = time.time_ns() // 1_000_000
        assert self.edges[machine].publish(machine, [Change(name, value, at_ms) for name, value in values.items()])

    def twin(self, processor: str, machine: str) -> dict[str, Reading] | None:
        """The readings of a twin device that is online."""
        picture = self.look.picture(NodeId(self.group, f"twin-{processor}"))
        owner = None if picture is None else picture.devices.get(machine)
        return None if owner is None or not owner.online else dict(owner.readings)

    def life(self, processor: str) -> int | None:
        """The birth/death number of a processor's node while it is online."""
        picture = self.look.picture(NodeId(self.group, f"twin-{processor}"))
        return picture.bd_seq if picture is not None and picture.online else None

    def health(self, processor: str, name: str) -> Any:
        """A figure of the health of a processor's node."""
        picture = self.look.picture(NodeId(self.group, f"twin-{processor}"))
        reading = None if picture is None else picture.own.readings.get(f"health/{name}")
        return None if reading is None else reading.value


def bridge_program(folder: Path, hall: Hall, settings: KafkaSettings, names: Sequence[str], *options: str, name: str) -> Program:
    """`cnctwin bridge` between the hall and Kafka."""
    own = ["--broker", hall.address.url, "--group", hall.group, "--kafka", settings.bootstrap, "--name", name]
    command = ["bridge", *own, "--processors", ",".join(names), "--state-dir", str(folder / name), *options]
    return Program(folder, name, "cnctwin", *command, environment=environment_of(settings))


def records_of(plant: Plant, machine: str) -> list[Record]:
    """The records of a machine, in the order of the log."""
    reader, found = RecordReader(), []
    for messages in plant.read(plant.topics.readings).values():
        for message in messages:
            if message.key() == machine.encode():
                try:
                    found.append(reader.read(message.headers(), message.value()))  # type: ignore[arg-type]
                except RecordError as error:
                    raise AssertionError(f"{machine}: {error}") from error
    return found


def writers_of(plant: Plant) -> set[str]:
    """The names of those that have written to the log."""
    messages = [message for of in plant.read(plant.topics.readings).values() for message in of]
    headers: list[dict[str, Any]] = [dict(message.headers() or ()) for message in messages]
    return {told["writer"].decode() for told in headers}


def values_of(records: Sequence[Record], name: str) -> list[Any]:
    """The values of a signal in data records, in their order."""
    events = [record.event for record in records if record.event is not None and record.event.kind is EventKind.DATA]
    return [reading.value for event in events for reading in event.readings if reading.name == name]


def newest_results(plant: Plant, processor: str, machine: str) -> dict[str, Any]:
    """The newest value of each figure of a machine that is in the results."""
    reader, newest = RecordReader(), dict[str, Any]()
    for messages in plant.read(plant.topics.results).values():
        for message in messages:
            headers: Any = message.headers()
            try:
                record = reader.read(headers, message.value())
            except SparkplugError as error:
                raise AssertionError(str(error)) from error
            event = record.event
            if event is not None and event.device == machine and dict(headers)["processor"] == processor.encode():
                newest |= {reading.name: reading.value for reading in event.readings}
    return newest
