"""An event of a host session as a record of a log, and back: headers and a value.

    header     content (UTF-8)
    version    1
    kind       birth, data, death, hole: of a device; plain: a message outside Sparkplug; watermark: see below
    node       group/edge node
    device     the machine
    at         when it was taken in, ms since 1970 by the writer's clock; then of its node's present life the
               birth/death number (bdSeq), the time stamp of the NBIRTH in ms, and the message's own number (seq, 0 to 255);
               -1 where there is none
    writer     name of whoever wrote it
    detail     of a death or a hole: why
    topic      of a plain message
    retain     1 where a plain message is retained

The value is a Sparkplug B payload by names (`named.py`), and what was published where the record is plain. A watermark says that
its writer had by then handed on all that it was told before, and that a machine from which nothing came is silent. It has no
value, node or device.

bdSeq, NBIRTH and seq name a message for good: who reads a log with two writers drops what it has already (`lives.py`).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from sparkplug.errors import PayloadError
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.layouts.memory import Room
from sparkplug.metric import NodeId
from sparkplug.records.named import NamedPayloads, handed_on, written

VERSION = b"1"
WATERMARK = b"watermark"
PLAIN = EventKind.PLAIN.value.encode()
NUMBER_MAX = 2**64 - 1  # as in a payload
SOURCES_MAX = 20_000  # whose layouts are remembered
NO_NODE = NodeId("", "")
Headers = list[tuple[str, str | bytes | None]]
_KINDS = {kind.value.encode(): kind for kind in EventKind if kind is not EventKind.REFUSED}
_DATA, _PLAIN = EventKind.DATA, EventKind.PLAIN


class Origin(NamedTuple):
    """The message of a node that an event comes from: numbers of its node's life and its own."""

    bd_seq: int = -1
    birth_ms: int = -1
    seq: int = -1


class Record(NamedTuple):
    """An event with what a log adds. `event` is None for a watermark."""

    event: HostEvent | None
    received_ms: int
    writer: str
    origin: Origin = Origin()
    retain: bool = False


class RecordError(PayloadError):
    """A record cannot be read."""


class RecordWriter:
    """Writes records of one writer. The headers that all data of a source share are made once."""

    def __init__(self, name: str) -> None:
        self._name = name.encode()
        self._known: dict[tuple[NodeId, str | None], Headers] = {}

    def written(self, event: HostEvent, received_ms: int, origin: Origin, *, retain: bool = False) -> tuple[Headers, bytes]:
        """Return headers and value of an event of a device, or of a plain message. Raises PayloadError."""
        kind, node, device, stamp_ms, readings, detail, topic, payload = event[:8]
        at = b"%d %d %d %d" % (received_ms, *origin)
        if kind is _DATA:
            common = self._known.get((node, device)) or self._of_source(node, device)
            value = written(stamp_ms, readings, max(origin[2], 0)) if event.packed is None else handed_on(event.packed)
            return [*common, ("at", at)], value
        headers: Headers = [("version", VERSION), ("kind", kind.value.encode()), ("writer", self._name), ("at", at)]
        if kind is _PLAIN:
            return [*headers, ("topic", topic.encode()), ("retain", b"1" if retain else b"0")], payload
        headers += [("node", str(node).encode()), ("device", (device or "").encode()), ("detail", detail.encode())]
        return headers, written(stamp_ms, readings, max(origin[2], 0))

    def watermark(self, at_ms: int) -> Headers:
        """Return the headers of a watermark."""
        return [("version", VERSION), ("kind", WATERMARK), ("writer", self._name), ("at", b"%d -1 -1 -1" % at_ms)]

    def _of_source(self, node: NodeId, device: str | None) -> Headers:
        if len(self._known) >= SOURCES_MAX:
            self._known.clear()
        of_source: Headers = [("node", str(node).encode()), ("device", (device or "").encode())]
        common: Headers = [("version", VERSION), ("kind", b"data"), *of_source, ("writer", self._name)]
        self._known[node, device] = common
        return common


class RecordReader:
    """Reads records. What is learnt of the payloads of a source is bounded, and forgotten with the oldest source."""

    def __init__(self) -> None:
        self._room = Room()
        self._sources: dict[tuple[bytes, bytes], tuple[NodeId, str, NamedPayloads]] = {}

    def read(self, headers: Sequence[tuple[str, Any]] | None, value: bytes | None) -> Record:
        """Return the record. Raises RecordError where it is none of this version."""
        told: dict[str, Any] = dict(headers or ())
        if told.get("version") != VERSION:
            raise RecordError(f"record of version {told.get('version', b'')!r:.40}; this program reads {VERSION.decode()}")
        try:
            received_ms, *origin = map(int, told["at"].split())
            if not 0 <= received_ms <= NUMBER_MAX or not all(-1 <= number <= NUMBER_MAX for number in origin):
                raise RecordError(f"no such time or number: {told['at']!r:.60}")
            writer, kind = told["writer"].decode(), told["kind"]
            if kind == WATERMARK:
                return Record(None, received_ms, writer)
            event = self._event(_KINDS[kind], told, value or b"", received_ms)
            return Record(event, received_ms, writer, Origin(*origin), told.get("retain") == b"1")
        except RecordError:
            raise
        except (KeyError, ValueError, TypeError, AttributeError, PayloadError) as error:  # a header may be without value
            raise RecordError(f"{type(error).__name__}: {error}") from error

    def _event(self, kind: EventKind, told: dict[str, Any], value: bytes, received_ms: int) -> HostEvent:
        if kind is _PLAIN:
            return HostEvent(kind, NO_NODE, None, received_ms, topic=told["topic"].decode(), payload=value)
        place = told["node"], told["device"]
        node, device, payloads = self._sources.get(place) or self._source(*place)
        stamp_ms, _, readings, names, oldest_ms, newest_ms = payloads.read(value)
        if kind is _DATA:
            event = (_DATA, node, device, stamp_ms, readings, "", "", b"", names, oldest_ms, newest_ms, 0, None, -1, None)
            return tuple.__new__(HostEvent, event)
        return HostEvent(kind, node, device, stamp_ms, readings, told.get("detail", b"").decode())

    def _source(self, node: bytes, device: bytes) -> tuple[NodeId, str, NamedPayloads]:
        group, _, name = node.decode().partition("/")
        if len(self._sources) >= SOURCES_MAX:
            self._sources.pop(next(iter(self._sources)))
        source = self._sources[node, device] = NodeId(group, name), device.decode(), NamedPayloads(self._room)
        return source
