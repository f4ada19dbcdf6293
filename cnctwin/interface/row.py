"""A machine's row: the last value of each of its signals, as the broker told them."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from types import MappingProxyType
from typing import Literal

from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId, Reading, is_command_metric
from sparkplug.values import Value
from twin.vocabulary.nodes import JOBS_NODE, is_twin_node

_EPOCH = datetime.fromtimestamp(0, UTC)


@dataclass(frozen=True, slots=True)
class Signal:
    """The last value of a signal.

    value: None is a null; quality: `stale` = its sender is gone, `bad` = not to be trusted; reason: why, where it was given
    t: when it became true
    """

    value: Value
    unit: str | None
    quality: Literal["good", "stale", "bad"]
    reason: str | None
    t: datetime


@dataclass(frozen=True, slots=True)
class Row:
    """The row of a machine after one message; what the twin says of it stands under `twin/…`.

    t: newest time of what the message told; changed: the signals that it told
    """

    machine: str
    t: datetime
    signals: Mapping[str, Signal]
    changed: tuple[str, ...]

    def __getitem__(self, name: str) -> Signal:
        """The signal `name`. Raises KeyError where the machine has none."""
        return self.signals[name]

    def values(self) -> dict[str, Value]:
        """Return the value of each signal that is good, and None for the others."""
        return {name: signal.value if signal.quality == "good" else None for name, signal in self.signals.items()}


class Rows:
    """The last values of one machine; each of its messages makes a row, from the birth of its own edge on.

    Before that only its twin may have been heard, and a row would lack what the control reports. Older values that a sender
    delivers late make none.
    """

    def __init__(self, machine: str) -> None:
        self._machine = machine
        self._told: dict[NodeId, dict[str, Signal]] = {}

    def after(self, event: HostEvent) -> Row | None:
        """The row after an event; None where it says nothing new of this machine."""
        if event.device != self._machine or event.node.node == JOBS_NODE or event.kind not in _KINDS:
            return None
        readings = (one for one in event.read() if not one.is_historical and not is_command_metric(one.name))
        new = {reading.name: _signal(reading) for reading in readings}
        if not new:
            return None
        if event.kind is EventKind.BIRTH:
            self._told[event.node] = new
        else:
            self._told.setdefault(event.node, {}).update(new)
        if all(is_twin_node(node.node) for node in self._told):
            return None
        signals = {name: signal for told in self._told.values() for name, signal in told.items()}
        return Row(self._machine, max(one.t for one in new.values()), MappingProxyType(signals), tuple(new))


_KINDS = frozenset({EventKind.BIRTH, EventKind.DATA, EventKind.DEATH})


def _signal(reading: Reading) -> Signal:
    quality: Literal["good", "stale", "bad"] = reading.quality.name.lower()  # type: ignore[assignment]  # the enum's names
    return Signal(reading.value, reading.unit, quality, reading.reason, _EPOCH + timedelta(milliseconds=reading.timestamp_ms))
