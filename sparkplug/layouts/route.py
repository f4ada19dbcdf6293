"""The way of the data messages of one topic: an edge node's or device's picture, read by remembered layouts."""

from dataclasses import dataclass
from typing import Any

from sparkplug.admission.gate import Gate
from sparkplug.codec import read_properties
from sparkplug.datatype import DataType
from sparkplug.errors import PayloadError
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.layouts.layout import Packed
from sparkplug.layouts.learning import learn
from sparkplug.layouts.memory import Memory
from sparkplug.metric import Reading
from sparkplug.node_picture import NodePicture, Owner
from sparkplug.sequence import SequenceWindow

_DATA, _NEW = EventKind.DATA, tuple.__new__


@dataclass(slots=True)
class Route:
    """One topic's owner, the order of its node's messages, and the layouts that are known.

    packs: leaves messages packed that can be handed on in pieces
    """

    picture: NodePicture
    window: SequenceWindow
    owner: Owner
    device: str | None
    layouts: Memory
    gate: Gate
    packs: bool = False

    def take(self, payload: bytes) -> HostEvent | None:
        """Take a data message of a known layout; None, and nothing has changed, where it has to go the long way."""
        found = self.layouts.read(payload)
        if found is None:
            return None
        layout, (stamp_ms, seq, values, stamps_ms, oldest_ms, newest_ms) = found
        picture, owner, gate = self.picture, self.owner, self.gate
        if stamp_ms > gate.newest_ms or newest_ms > gate.newest_ms or oldest_ms < gate.oldest_ms or stamp_ms < gate.oldest_ms:
            return None
        if not (picture.own.online and owner.online) or stamp_ms < picture.own.birth_ms:
            return None
        if not self.window.is_next(seq, stamp_ms):
            return None
        names = layout.names
        if self.packs and layout.pieces is not None:
            packed = Packed(layout, payload)
            owner.take_packed(packed)
            told = _DATA, picture.node, self.device, stamp_ms, (), "", "", b"", names, oldest_ms, newest_ms, 0, None, seq, packed
            return _NEW(HostEvent, told)
        readings = layout.readings(values, stamps_ms)
        if layout.has_history:
            owner.take_history(readings)
            names, oldest_ms, newest_ms = (), 0, 0
        else:
            owner.take_present(names, readings)
        event = (
            _DATA,
            picture.node,
            self.device,
            stamp_ms,
            readings,
            "",
            "",
            b"",
            names,
            oldest_ms,
            newest_ms,
            0,
            None,
            seq,
            None,
        )
        return _NEW(HostEvent, event)

    def learn(self, payload: bytes, message: Any, readings: tuple[Reading, ...], names: tuple[str, ...]) -> None:
        """Remember the layout of a message whose metrics were all read the long way, and gave these readings."""
        if not self.layouts.may_learn():
            return
        datatypes = self._datatypes(message)
        layout = None if datatypes is None else learn(payload, datatypes, readings, names)
        if layout is not None:
            self.layouts.keep(layout)

    def _datatypes(self, message: Any) -> list[DataType] | None:
        """Return the declared types of a message's metrics; None where a property set cannot be read.

        Properties are read only where the bytes hold the name of one that counts, and those may stand in a text, too.
        """
        datatypes = []
        for metric in message.metrics:
            binding = self.owner.binding(metric)
            if binding is None:
                return None
            if metric.HasField("properties"):
                try:
                    read_properties(metric.properties)
                except PayloadError:
                    return None
            datatypes.append(binding.datatype)
        return datatypes
