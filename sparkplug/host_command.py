"""The messages of a host application to a node or device: write values, tell your births."""

from collections.abc import Iterable

from sparkplug.actions import Publish
from sparkplug.codec import encode
from sparkplug.datatype import DataType
from sparkplug.edge_session import REBIRTH
from sparkplug.errors import UnknownMetricError
from sparkplug.metric import Change, NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.topics import Topic, Verb
from sparkplug.values import Metric, Payload


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
