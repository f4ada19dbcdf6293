"""Admission to a host session: the gate, with what it has to know of each node, and the table of what it refuses."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

from sparkplug.admission.gate import Fault, Gate
from sparkplug.admission.rates import Excess
from sparkplug.admission.refusal import Quarantine, Refusal, shown
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading
from sparkplug.topics import Topic

_NOTHING = (0, 0)


class _Declared:
    """The metrics and bytes that the births of a node and its devices hold."""

    __slots__ = ("bytes", "metrics", "of")

    def __init__(self) -> None:
        self.metrics = self.bytes = 0
        self.of: dict[str | None, tuple[int, int]] = {}

    def take(self, device: str | None, metrics: int, size: int) -> None:
        old_metrics, old_size = self.of.pop(device, _NOTHING)
        self.metrics += metrics - old_metrics
        self.bytes += size - old_size
        if metrics or size:
            self.of[device] = (metrics, size)


class Admission:
    """See the module. It hands back faults and events of kind REFUSED; the session does what follows from them."""

    __slots__ = ("_declared", "_in_group", "counts", "gate", "quarantine")

    def __init__(self, gate: Gate, counts: Counter[str]) -> None:
        self.gate, self.counts = gate, counts
        self.quarantine = Quarantine()
        self._declared: dict[NodeId, _Declared] = {}
        self._in_group: Counter[str] = Counter()

    # Nodes.

    def stranger(self, topic: Topic, now_ms: int) -> HostEvent | None:
        """A node is heard for the first time: None where it is let in."""
        node, limits = topic.node, self.gate.limits
        fault = self.gate.node_fault(node)
        if fault is None and self._in_group[node.group] >= limits.nodes_a_group_max and not self.gate.trusted(node):
            fault = Fault(Refusal.QUOTA, f"more than {limits.nodes_a_group_max} edge nodes in the group: {shown(str(node))}")
        if fault is None:
            self._in_group[node.group] += 1
            return None
        others = NodeId(shown(node.group), "…")  # they share a row: anybody can think of names
        return self.refuse(others, None, fault, now_ms, messages=1 if topic.device is not None else 0)

    def held(self, topic: Topic, now_ms: int) -> HostEvent | None:
        """Return the event of a message whose node or device is in quarantine; None where neither is."""
        node, device = topic.node, topic.device
        refusal = self.quarantine.of(node, device)
        if refusal is None and device is not None:
            device = None
            refusal = self.quarantine.of(node, None)
        if refusal is None:
            if not self.quarantine.is_full(node):
                return None
            refusal = Refusal.QUOTA  # so many are refused that they are not told apart
        self.quarantine.again(node, device, now_ms)
        return self._event(node, topic.device, Fault(refusal, "in quarantine"), now_ms, 1 if topic.device is not None else 0)

    def exceeded(self, excess: Excess, now_ms: int) -> HostEvent:
        """Messages of a node were dropped since they were too many."""
        limits = self.gate.limits
        text = (
            f"{excess.messages} messages dropped: above {limits.messages_a_second_max} messages or "
            f"{limits.data_bytes_a_second_max} bytes a second, or {limits.births_a_second_max} births or "
            f"{limits.birth_bytes_a_second_max} bytes of them"
        )
        self.quarantine.note(excess.node, None, Refusal.RATE, text, now_ms, count=excess.messages)
        return self._event(excess.node, None, Fault(Refusal.RATE, text), now_ms, excess.of_devices)

    # Births.

    def birth_fault(self, node: NodeId, device: str | None, message: Any, size: int, devices: int) -> Fault | None:
        """Return what is wrong with a birth of `size` bytes of a node that has so many devices already."""
        gate, limits, count = self.gate, self.gate.limits, len(message.metrics)
        fault = None if device is None else gate.device_fault(device)
        if fault is not None or gate.trusted(node):
            return fault or gate.birth_fault(message, size)
        declared = self._declared.get(node) or _Declared()
        metrics, bytes_before = declared.of.get(device, _NOTHING)
        if count > limits.metrics_a_device_max:
            text = f"the birth declares {count} metrics; at most {limits.metrics_a_device_max}"
        elif declared.metrics - metrics + count > limits.metrics_a_node_max:
            text = f"with this birth, {node} declares more than {limits.metrics_a_node_max} metrics"
        elif declared.bytes - bytes_before + size > limits.births_a_node_bytes_max:
            text = f"with this one, the births of {node} take more than {limits.births_a_node_bytes_max} bytes"
        elif devices >= limits.devices_a_node_max:
            text = f"{node} has more than {limits.devices_a_node_max} devices"
        else:
            return gate.birth_fault(message, size)
        return Fault(Refusal.QUOTA, text)

    def born(self, node: NodeId, device: str | None, message: Any, size: int) -> None:
        """A good birth has come."""
        self.quarantine.release(node, device)
        if not self.gate.trusted(node):
            self._declared.setdefault(node, _Declared()).take(device, len(message.metrics), size)

    def forget(self, node: NodeId, device: str) -> None:
        """A device is forgotten, and what it declared."""
        if (declared := self._declared.get(node)) is not None:
            declared.take(device, 0, 0)

    def refuse(
        self, node: NodeId, device: str | None, fault: Fault, now_ms: int, *, is_whole: bool = False, messages: int | None = None
    ) -> HostEvent:
        """Note what is refused and return the event; `messages` of devices, where it is not one of a device."""
        self.quarantine.note(node, device, fault.refusal, fault.text, now_ms, is_whole=is_whole)
        return self._event(node, device, fault, now_ms, messages if messages is not None else 0 if device is None else 1)

    # Readings.

    def believed(
        self, node: NodeId, device: str | None, readings: Sequence[Reading], stamp_ms: int, now_ms: int
    ) -> tuple[tuple[Reading, ...], list[HostEvent]]:
        """Return the readings of a birth, those without a value whose time stamp no clock has, and the event that says so."""
        gate = self.gate
        strange = [reading.timestamp_ms for reading in readings if not gate.oldest_ms <= reading.timestamp_ms <= gate.newest_ms]
        if not strange:
            return tuple(readings), []
        text = f"{len(strange)} values kept out, the first one: {gate.stamp_text(strange[0])}"
        event = self.refuse(node, device, Fault(Refusal.STAMP, text), now_ms)
        return tuple(gate.believed(reading, stamp_ms) for reading in readings), [event]

    def kept(
        self, node: NodeId, device: str | None, readings: Iterable[Reading], trimmed: str | None, now_ms: int
    ) -> tuple[tuple[Reading, ...], list[HostEvent]]:
        """Return the readings of a data message whose time stamps are believed, and the event of what was kept out."""
        oldest_ms, newest_ms = self.gate.oldest_ms, self.gate.newest_ms
        kept: list[Reading] = []
        strange: list[Reading] = []
        for reading in readings:
            (kept if oldest_ms <= reading[2] <= newest_ms else strange).append(reading)
        if not strange and trimmed is None:
            return tuple(kept), []
        fault = Fault(Refusal.SIZE, trimmed or "")
        if strange:
            name, text = shown(strange[0].name), self.gate.stamp_text(strange[0].timestamp_ms)
            fault = Fault(Refusal.STAMP, f"{len(strange)} values kept out, the first one: {name}: {text}")
        return tuple(kept), [self.refuse(node, device, fault, now_ms)]

    def _event(self, node: NodeId, device: str | None, fault: Fault, now_ms: int, messages: int) -> HostEvent:
        self.counts["refused"] += 1
        told = None if device is None else shown(device)
        return HostEvent(EventKind.REFUSED, node, told, now_ms, detail=fault.text, refused=messages, refusal=fault.refusal)
