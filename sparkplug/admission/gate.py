"""The gate of a host session: what may be let in of what was decoded, and why not. It keeps nothing but the present."""

import re
from collections.abc import Callable, Collection
from functools import lru_cache
from typing import Any, NamedTuple

from sparkplug.admission.limits import DEFAULTS, Limits
from sparkplug.admission.refusal import Refusal, shown
from sparkplug.metric import NodeId, Reading
from sparkplug.quality import Quality

# Control characters (C0, DEL, C1), surrogates, the byte order mark, and what Unicode calls noncharacters: MQTT lets a broker
# close the connection of who sends them in a topic (1.5.4), and Mosquitto does.
_UNPRINTABLE = re.compile(
    "[\\x00-\\x1f\\x7f-\\x9f\\ud800-\\udfff\\ufeff\\ufdd0-\\ufdef"
    + "".join(f"{chr(plane << 16 | 0xFFFE)}{chr(plane << 16 | 0xFFFF)}" for plane in range(17))
    + "]"
)
_ESCAPED = ("%", "+", "#")
_ESCAPED_IN_ID = (*_ESCAPED, "/")


class Fault(NamedTuple):
    """A finding against something: why it is not let in."""

    refusal: Refusal
    text: str


class Gate:
    """The limits of one host session. Time stamps from `oldest_ms` to `newest_ms` are believed."""

    __slots__ = ("_reserved", "limits", "newest_ms", "oldest_ms", "trusted")

    def __init__(
        self, limits: Limits = DEFAULTS, reserved: Collection[str] = (), trusted: Callable[[NodeId], bool] = lambda _: False
    ) -> None:
        self.limits = limits
        self.trusted = trusted
        self.oldest_ms = limits.oldest_ms
        self.newest_ms = limits.ahead_ms_max
        self._reserved = frozenset(reserved)

    def at(self, now_ms: int) -> None:
        """Move the window of time to the present."""
        self.newest_ms = now_ms + self.limits.ahead_ms_max

    def believes(self, stamp_ms: int) -> bool:
        """Return True for a time stamp in the window."""
        return self.oldest_ms <= stamp_ms <= self.newest_ms

    def stamp(self, message: Any) -> int:
        """Return the time stamp of a payload; 0 where it has none that is believed."""
        stamp_ms: int = message.timestamp
        return stamp_ms if self.oldest_ms <= stamp_ms <= self.newest_ms else 0

    # Names.

    def node_fault(self, node: NodeId) -> Fault | None:
        """Return what is wrong with the name of a node."""
        bytes_max = self.limits.id_bytes_max
        return _id_fault("group", node.group, bytes_max) or _id_fault("edge node", node.node, bytes_max)

    def device_fault(self, device: str) -> Fault | None:
        """Return what is wrong with the name of a device."""
        if device in self._reserved:
            return Fault(Refusal.RESERVED, f"the name {device!r} is the host's own; give the device another one")
        return _id_fault("device", device, self.limits.id_bytes_max)

    # Births.

    def birth_fault(self, message: Any, size: int) -> Fault | None:
        """Return what is wrong with the names and the values of a birth of `size` bytes."""
        limits = self.limits
        for metric in message.metrics:
            if (text := _name_fault(metric.name, limits.name_bytes_max, limits.name_levels_max)) is not None:
                return Fault(Refusal.NAME, text)
        if size > limits.text_bytes_max:
            for metric in message.metrics:
                if (text := self._size_fault(metric)) is not None:
                    return Fault(Refusal.SIZE, f"metric {shown(metric.name)!r}: {text}")
        return None

    def believed(self, reading: Reading, stamp_ms: int) -> Reading:
        """Return a reading of a birth: without its value, as of `stamp_ms`, where no clock has its time stamp."""
        if self.believes(reading.timestamp_ms):
            return reading
        reason = f"kept out: {self.stamp_text(reading.timestamp_ms)}"
        return Reading(reading.name, None, stamp_ms, Quality.BAD, reading.unit, reason, False)

    # Data.

    def trim(self, message: Any, size: int) -> str | None:
        """Take values that are too long out of a data message of `size` bytes; return what was wrong, None where nothing was."""
        if size <= self.limits.text_bytes_max:
            return None
        faults = [(place, text) for place, one in enumerate(message.metrics) if (text := self._size_fault(one)) is not None]
        for place, _ in reversed(faults):
            del message.metrics[place]
        return f"{len(faults)} values kept out, the first one: {faults[0][1]}" if faults else None

    def stamp_text(self, stamp_ms: int) -> str:
        """Say what is wrong with a time stamp."""
        if stamp_ms < self.oldest_ms:
            return f"time stamp {stamp_ms} ms lies before oldest_ms = {self.oldest_ms}"
        ahead_s = (stamp_ms - self.newest_ms + self.limits.ahead_ms_max) / 1000
        most_s = self.limits.ahead_ms_max / 1000
        return f"time stamp {stamp_ms} ms is {ahead_s:.6g} s ahead of the host's clock; at most {most_s:g} s"

    def _size_fault(self, metric: Any) -> str | None:
        limits = self.limits
        if metric.ByteSize() <= limits.text_bytes_max:
            return None
        which = metric.WhichOneof("value")
        if which == "string_value":
            value = metric.string_value
            size = len(value if isinstance(value, bytes) else value.encode())
            if size > limits.text_bytes_max:
                return f"a text of {size} bytes; at most {limits.text_bytes_max}"
        elif which == "bytes_value":
            if len(metric.bytes_value) > limits.value_bytes_max:
                return f"a value of {len(metric.bytes_value)} bytes; at most {limits.value_bytes_max}"
        elif which is not None and (size := metric.ByteSize()) > limits.value_bytes_max:
            return f"a value of {size} bytes; at most {limits.value_bytes_max}"
        if (size := metric.properties.ByteSize()) > limits.text_bytes_max:
            return f"properties of {size} bytes; at most {limits.text_bytes_max}"
        return None


def _id_fault(what: str, name: str, bytes_max: int) -> Fault | None:
    if (found := _UNPRINTABLE.search(name)) is not None:
        return Fault(Refusal.NAME, f"{what} {shown(name)!r} holds {found[0]!a}, which no topic may hold")
    size = len(name.encode()) + 2 * sum(map(name.count, _ESCAPED_IN_ID))
    if size > bytes_max:
        return Fault(Refusal.NAME, f"{what} {shown(name)!r} takes {size} bytes in a topic; at most {bytes_max}")
    return None


@lru_cache(maxsize=16_384)
def _name_fault(name: str, bytes_max: int, levels_max: int) -> str | None:
    """Return what is wrong with the name of a metric; machines of one kind share theirs."""
    if not isinstance(name, str):
        return None  # what protobuf makes of bytes that are not UTF-8; the birth is unreadable
    if (found := _UNPRINTABLE.search(name)) is not None:
        return f"metric {shown(name)!r} holds {found[0]!a}, which no topic may hold"
    size = len(name.encode()) + 2 * sum(map(name.count, _ESCAPED))
    if size > bytes_max:
        return f"metric {shown(name)!r} takes {size} bytes in a topic; at most {bytes_max}"
    if (levels := name.count("/") + 1) > levels_max:
        return f"metric {shown(name)!r} has {levels} levels in a topic; at most {levels_max}"
    return None
