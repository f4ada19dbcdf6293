"""An edge node as a host session watches it: its picture, the order of its messages, and what is said to it."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from sparkplug.actions import Publish
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.edge_session import BD_SEQ, REBIRTH
from sparkplug.errors import UnknownMetricError
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.sequence import SequenceWindow
from sparkplug.topics import Topic, Verb
from sparkplug.values import Metric, Payload

DOUBTS_MAX = 3
DOUBT_MS = 600_000


@dataclass(slots=True)
class Watched:
    """See the module.

    received_ms: when its last birth or death came, by the host's clock
    awaiting: devices that were known before the last NBIRTH and have not been born since
    doubts_ms: when its numbers were last doubted
    """

    picture: NodePicture
    window: SequenceWindow
    received_ms: int = 0
    awaiting: set[str] | None = None
    doubts_ms: deque[int] = field(default_factory=lambda: deque(maxlen=DOUBTS_MAX))

    def is_doubted(self, now_ms: int) -> bool:
        """Its numbers did not fit: return True where its birth should be asked for.

        A peer that counts sloppily is let be; but its numbers may also have begun again with a birth that was lost. The birth is
        asked for, at most `DOUBTS_MAX` times in `DOUBT_MS`, so that a sloppy peer is not made to repeat it for ever.
        """
        doubts_ms = self.doubts_ms
        if len(doubts_ms) == DOUBTS_MAX and now_ms - doubts_ms[0] < DOUBT_MS:
            return False
        doubts_ms.append(now_ms)
        return True


class Received(NamedTuple):
    """A message and the bytes from which it was parsed."""

    topic: Topic
    message: Any
    payload: bytes


def is_sloppy(message: Any) -> bool:
    """Return True if an NBIRTH leaves out what the specification demands and we can do without: said, and accepted."""
    types = {metric.name: metric.datatype for metric in message.metrics}
    well_formed = types.get(BD_SEQ) == DataType.INT64 and types.get(REBIRTH) == DataType.BOOLEAN
    return not well_formed or not all(metric.timestamp for metric in message.metrics)


def bd_seq_of(message: Any) -> int | None:
    """Return the birth/death sequence number of an NBIRTH or NDEATH; None where it has none."""
    for metric in message.metrics:
        if metric.name == BD_SEQ:
            return int(metric.long_value or metric.int_value) % 256
    return None


def command(node: NodeId, picture: NodePicture | None, device: str | None, changes: Iterable[Change], now_ms: int) -> Publish:
    """Return the command; raises UnknownMetricError where the birth does not declare a metric."""
    owner = None if picture is None else picture.owner(device)
    if picture is None or owner is None:
        raise UnknownMetricError(f"{_name(node, device)} was never born; nothing to command")
    alias_of = {binding.name: alias for alias, binding in owner.aliases.items()}
    metrics = []
    for change in changes:
        if change.name == REBIRTH and owner.offers_rebirth:
            metrics.append(Metric(REBIRTH, change.value, DataType.BOOLEAN, change.timestamp_ms))
            continue
        binding = owner.bindings.get(change.name)
        if binding is None:
            raise UnknownMetricError(f"{_name(node, device)} has not declared {change.name!r}; nothing to command")
        alias = alias_of.get(change.name)
        name = change.name if alias is None else None
        metrics.append(Metric(name, change.value, binding.datatype, change.timestamp_ms, alias))
    verb = Verb.NCMD if device is None else Verb.DCMD
    return Publish(str(Topic(verb, node, device)), encode(Payload(now_ms, tuple(metrics))))


def rebirth_request(node: NodeId, now_ms: int) -> Publish:
    """Return the message that asks a node for its births."""
    metric = Metric(REBIRTH, True, DataType.BOOLEAN, now_ms)
    return Publish(str(Topic(Verb.NCMD, node)), encode(Payload(now_ms, (metric,))))


def _name(node: NodeId, device: str | None) -> str:
    return str(node) if device is None else f"{node}/{device}"
